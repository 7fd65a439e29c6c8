"""Walls, cones and the YAML they come from."""

import math

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from sim_arduino.serve.factory import Options, make
from sim_arduino.world.world import Wall, World
from sim_arduino.world.world_file import load, parse_pose

CONE_RAD = math.radians(18)
RANGE_M = 6.45
ORIGIN = Pose(0.0, 0.0, 0.0)
SLANT = math.tan(math.radians(10))


@pytest.mark.parametrize(
    ("walls", "range_m"),
    [
        ([Wall(2, -1, 2, 1)], 2.0),
        ([Wall(-2, -1, -2, 1)], math.inf),
        ([Wall(2, 1, 2, 3)], math.inf),
        ([Wall(0, 1, 9, 1)], 1 / math.sin(CONE_RAD)),
        ([Wall(2 - SLANT, -1, 2 + SLANT, 1)], 2 * math.cos(math.radians(10))),
        ([Wall(2, 0.5, 2, 9)], math.hypot(2, 0.5)),
        ([Wall(3, -1, 3, 1), Wall(2, -1, 2, 1)], 2.0),
        ([Wall(6.46, -1, 6.46, 1)], math.inf),
        ([Wall(2, 0, 2, 0)], math.inf),
    ],
    ids=["across", "behind", "beside", "along", "slanting", "edge", "nearer", "beyond", "no_length"],
)
def test_the_nearest_point_of_the_walls_in_a_cone(walls, range_m):
    assert World(walls).nearest(ORIGIN, CONE_RAD, RANGE_M) == pytest.approx(range_m)


def write(folder, text):
    path = folder / "world.yaml"
    path.write_text(text)
    return str(path)


def test_the_default_is_a_room_around_the_robot():
    world = load()
    seen = [world.nearest(Pose(0, 0, turn * math.pi / 2), CONE_RAD, RANGE_M) for turn in range(4)]
    assert seen == pytest.approx([2.0] * 4)


def test_a_robot_of_the_file_stands_there_until_a_board_of_its_name_comes(tmp_path):
    world = load(write(tmp_path, "robots: {two: [1, 0, 90, stingbot]}"))
    footprint = world.standing["two"].footprint
    assert world.nearest(ORIGIN, CONE_RAD, RANGE_M) == pytest.approx(1.0 - 0.5 * footprint.width_m)
    assert world.nearest(ORIGIN, CONE_RAD, RANGE_M, "two") == math.inf
    world.place("two", Pose(0.0, 3.0, 0.0), footprint)
    assert world.nearest(ORIGIN, CONE_RAD, RANGE_M) == math.inf


def test_a_board_starts_where_its_robot_stands(tmp_path):
    path = write(tmp_path, "start: [5, 5, 0]\nrobots: {two: [1, 2, 90]}")
    poses = {name: make(Options(world=path, name=name)).plant.true_pose for name in ("one", "two")}
    assert poses["one"][:2] == (5.0, 5.0)
    assert poses["two"] == pytest.approx((1, 2, math.pi / 2))


@pytest.mark.parametrize(
    "text, message",
    [
        ("walls: [[0, 0, 1]]", r"walls\[0\] is \[0, 0, 1\], expected \[x1, y1, x2, y2\], 4 numbers"),
        ("walls: [[0, 0, 1, .nan]]", "from -1000 to 1000"),
        ("walls: [[0, 0, 1, 1001]]", "from -1000 to 1000"),
        ("wals: []", "key wals is unknown, expected start, walls, boxes"),
        ("robots: {one: [0, 0]}", r"robots.one is \[0, 0\], expected \[x, y, yaw\], 3 numbers"),
        ("robots: {one: [0, 0, 0, 7]}", "robots.one is 7, expected as its model one of"),
        ("walls: [" + "[" * 9999 + "]" * 10000, "line 1: no YAML of this kind is nested deeper than 10"),
        (f"walls: [[0, 0, 1, {10**99}]]", r"is \[0, 0, 1, 10+\.\.\., expected"),
        ("robots: {a b: [0, 0, 0]}", "robots.a b is .* as its name 1 to 40 letters"),
        ("walls: [[!!timestamp x, 1, 2, 3]]", "line 1: no YAML"),
        ("north: 1\nnorth: 2", "line 2: no YAML: the key 'north' stands twice"),
    ],
)
def test_bad_worlds_name_file_key_and_value(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(ConfigError, match=message) as caught:
        load(path)
    assert path in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_robot_is_not_put_inside_a_box(tmp_path):
    path = write(tmp_path, "boxes: [[0, 0, 2, 2, 30]]")
    with pytest.raises(ConfigError, match="pose 0,0 is in a wall"):
        make(Options(world=path))


@pytest.mark.parametrize("text", ["", "1,2", "1,2,3,4", "a,b,c", "1,2,nan", "1,2,inf"])
def test_bad_pose(text):
    with pytest.raises(ConfigError, match="expected X,Y,YAW"):
        parse_pose(text, ORIGIN)
