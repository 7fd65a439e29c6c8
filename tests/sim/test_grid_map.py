"""map_server maps in and out, the score of a robot's map, and free places to start from."""

import io
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from sim_arduino.world import grid_map, map_score, world_file
from sim_arduino.world.free_places import GAP_M, free_places
from sim_arduino.world.grid_map import FREE, OCCUPIED, UNKNOWN, GridMap
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.world import World
from sim_arduino.world.world_file import load

GOOD = {"image": "map.pgm", "resolution": 0.1, "origin": [0.0, 0.0, 0.0], "negate": 0}
PICTURE = b"P5\n# made by hand\n4 3\n255\n" + bytes([254, 254, 254, 254, 254, 0, 0, 254, 205, 254, 254, 254])
"""Two occupied cells side by side in the middle row, an unknown one at the lower left."""


def write(folder, picture=PICTURE, **changes):
    (folder / "map.pgm").write_bytes(picture)
    path = folder / "map.yaml"
    path.write_text(yaml.safe_dump({**GOOD, **changes}))
    return str(path)


def read(folder, **changes):
    path = write(folder, **changes)
    return grid_map.read(path, {**GOOD, **changes})


@pytest.mark.parametrize(
    "picture",
    [
        b"P2 2 1 # comment\n15\n0 15\n",
        b"P5 2 1 65535\n\x00\x00\xff\xff",
        b"P5\r\n2 1\r\n255\r\n\x00\xfe",
        b"P5 # made by\n# hand\n2 # wide\n 1\n255\n\x00\xfe",
    ],
)
def test_pictures_of_other_programs(tmp_path, picture):
    """Plain, with two bytes a pixel, with other line ends, with comments."""
    write(tmp_path, picture=picture)
    assert grid_map.read(str(tmp_path / "map.yaml"), GOOD).cells.tolist() == [[OCCUPIED, FREE]]


def test_origin_moves_and_turns():
    grid = GridMap(np.full((1, 1), OCCUPIED, np.int8), 1.0, Pose(5.0, 0.0, math.pi / 2))
    xs = [x for wall in grid_map.walls_of(grid) for x in (wall.x1, wall.x2)]
    assert (min(xs), max(xs)) == pytest.approx((4.0, 5.0))


def test_a_world_file_may_name_a_map(tmp_path):
    write(tmp_path)
    path = tmp_path / "world.yaml"
    path.write_text("map: map.yaml\nwalls: [[0, 0, 1, 0]]\n")
    assert len(load(str(path)).walls) == 5


def test_a_drawn_map_has_walls_floor_and_outside():
    grid = grid_map.draw(load("l-course"), 0.05)
    x, y = ((grid.origin.x_m, grid.origin.y_m), grid.cells.shape)
    assert set(np.unique(grid.cells)) == {UNKNOWN, FREE, OCCUPIED}
    assert (grid.cells == FREE).sum() * 0.05**2 == pytest.approx(2 * 1 + 0.6 * 1, rel=0.12)
    assert (x, y) == ((-0.25, -0.25), (42, 50))


@pytest.mark.parametrize(
    "text",
    [
        "walls: [[-1000, -1000, 1000, 1000]]",
        "walls: [[-1000, 0, 1000, 0]" + ", [-1000, 0, 1000, 0]" * 999 + "]",
        "image: map.pgm\nresolution: 10\norigin: [1.0e+6, 1.0e+6, 0]",
    ],
    ids=["far walls", "long walls", "far map"],
)
def test_a_world_that_is_too_large_to_draw_is_refused_before_memory_is_taken(tmp_path, text):
    write(tmp_path)
    path = tmp_path / "world.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match="too much for a map with cells of 0.025 m.*; give larger cells"):
        grid_map.draw(load(str(path)))


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"resolution": 0}, "map.yaml: resolution is 0, expected a number from 0.001 to 10"),
        ({"origin": [0, 0]}, r"origin is \[0, 0\], expected \[x m, y m, yaw rad\]"),
        ({"origin": 7}, "origin is 7, expected"),
        ({"image": 5}, "image is 5, expected the name of a PGM or PNG file"),
        ({"mode": "fine"}, "mode is 'fine', expected trinary or scale or raw"),
        ({"resolutoin": 1}, "key resolutoin is unknown, expected image, resolution"),
        ({"picture": b"\x89PNG\r\n"}, r"map.pgm: begins with b'\\x89PNG"),
        ({"picture": b"\x89PNG\r\n\x1a\n123"}, "map.pgm: .*, expected a PNG picture"),
        ({"picture": b"P5 4 3 255\n123"}, "has 3 pixels, expected 4 x 3 = 12"),
        ({"picture": b"P2 1 1 255\n" + b"9" * 30}, "expected whole numbers of at most 9 digits"),
        ({"picture": b"P2 2 1 255\n-1 0"}, "has b'-1 0' among the pixels, expected whole numbers"),
        ({"picture": b"P2 2 1 255\n999 0"}, "has pixels from 0 to 999, expected 0 to 255"),
        ({"picture": b"P5 1 65537 255\n"}, "1 x 65537 pixels .* and sides up to 65536"),
        ({"picture": b"P5 " + b"9" * 5000 + b" 1 255\n"}, "expected a PGM header"),
        ({"picture": b"P5 9000 9000 255\n"}, "9000 x 9000 pixels up to 255, expected 1 to 64000000"),
        ({"free_thresh": 0.7}, "free_thresh is 0.7, expected a number from 0 to 0.65"),
    ],
)
def test_bad_maps_name_file_key_and_value(tmp_path, changes, message):
    path = write(tmp_path, **changes)
    with pytest.raises(ConfigError, match=message) as caught:
        load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "changes",
    [
        {"origin": [0.0, 0.0, "nan"]},
        {"origin": [0.0, 0.0, math.nan]},
        {"origin": [0.0, 0.0, 0.0, 1.0]},
        {"occupied_thresh": 0.65, "free_thresh": 0.196, "cost_translation_table": "default"},
    ],
    ids=str,
)
def test_what_ros_takes_is_taken(tmp_path, changes):
    """map_saver writes a yaw that it does not know as nan; other programs write further keys and numbers."""
    assert load(write(tmp_path, **changes)).walls == load(write(tmp_path)).walls


@pytest.mark.parametrize(("negate", "grey"), [(0, (0, 100, 255, 50)), (1, (255, 155, 0, 205))])
def test_raw_values_are_states(tmp_path, negate, grey):
    write(tmp_path, picture=b"P5 4 1 255\n" + bytes(grey))
    found = grid_map.read(str(tmp_path / "map.yaml"), {**GOOD, "mode": "raw", "negate": negate})
    assert found.cells.tolist() == [[FREE, OCCUPIED, UNKNOWN, UNKNOWN]]


PIXELS = {
    "1": [0, 255, 255, 255],
    "L": [0, 254, 205, 254],
    "RGB": [(0, 0, 0), (254, 254, 254), (0, 254, 254), (254, 254, 254)],
    "I;16": [0, 65000, 52000, 65000],
    "LA": [(0, 255), (254, 255), (254, 0), (254, 255)],
    "RGBA": [(0, 0, 0, 0), (254, 254, 254, 255), (254, 254, 254, 0), (254, 254, 254, 255)],
}
"""Occupied, free, unknown (white in two colours), free.  In the mode trinary, ROS counts the opacity as a colour."""


def picture(mode, pixels, size):
    """A PNG with these pixels."""
    from PIL import Image

    made, data = Image.new(mode, size), io.BytesIO()
    for i, pixel in enumerate(pixels):
        made.putpixel((i % size[0], i // size[0]), pixel)
    made.save(data, "PNG")
    return data.getvalue()


@pytest.mark.parametrize("kind", PIXELS)
def test_png_pictures_are_read(tmp_path, kind):
    write(tmp_path, picture=picture(kind, PIXELS[kind], (2, 2)))
    cells = grid_map.read(str(tmp_path / "map.yaml"), GOOD).cells.tolist()
    assert cells == [[FREE if kind == "1" else UNKNOWN, FREE], [OCCUPIED, FREE]]


def test_a_pipe_in_place_of_the_picture_is_not_waited_for(tmp_path):
    path = write(tmp_path)
    (tmp_path / "map.pgm").unlink()
    os.mkfifo(tmp_path / "map.pgm")
    with pytest.raises(ConfigError, match="map.pgm: it is not a plain file, expected a PGM or PNG picture"):
        load(path)


CELL_M = 0.05


@pytest.fixture(scope="module")
def room():
    return load("room")


def test_the_true_map_is_perfect(room):
    found = map_score.score(grid_map.draw(room, CELL_M), room)
    assert (found.found, found.false) == (1.0, 0.0)
    assert found.farthest_m < CELL_M


def test_a_wall_that_is_missing_is_not_found(room):
    made = grid_map.draw(room, CELL_M)
    cells = made.cells.copy()
    cells[:, : cells.shape[1] // 4] = FREE
    assert map_score.score(made._replace(cells=cells), room).found == pytest.approx(0.625, abs=0.03)


def test_the_frame_of_the_map_is_turned_and_moved(room):
    """A mapper that began at 1, 0 and looked to the left has the world a quarter to the right."""
    frame = Pose(1.0, 0.0, math.pi / 2)
    made = grid_map.draw(room, CELL_M)
    back = Pose(0.0, 0.0, 0.0).relative_to(frame)
    turned = made._replace(origin=back.compose(*made.origin))
    assert map_score.score(turned, room, frame) == pytest.approx(map_score.score(made, room), abs=1e-6)


def test_a_map_that_is_turned_and_moved_is_fitted_to_the_walls():
    """As those of mappers are, by 1 to 3 deg."""
    house = load("house")
    off = Pose(0.1, -0.15, math.radians(3))
    made = grid_map.draw(house, CELL_M)
    fit = map_score.fitted(made, house, off)
    assert math.hypot(fit.x_m, fit.y_m) < 0.03 and abs(fit.yaw_rad) < math.radians(0.3)
    assert map_score.score(made, house, off).found < 0.8 < 0.99 < map_score.score(made, house, fit).found


def test_compare_map_prints_shares_before_and_after_the_fit(tmp_path):
    path = tmp_path / "room.yaml"
    grid_map.write(grid_map.draw(load("room"), CELL_M), str(path))
    program = Path(__file__).parents[2] / "ros1_bridge" / "nodes" / "compare_map"
    command = [sys.executable, str(program), "room", str(path), "--frame", "0.2,0,0"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    before, after = re.findall(r"[\d.]+(?= %)", done.stdout.splitlines()[0])
    assert float(before) < 80 < 99 < float(after)


RADIUS_M = 0.16


def test_the_first_robot_has_the_start_and_the_next_stand_beside_it():
    places = free_places(World(start=Pose(1.0, 2.0, 0.0)), RADIUS_M, 3)
    assert places == [Pose(1.0, 2.0, 0.0), Pose(1.0, 2.5, 0.0), Pose(1.0, 1.5, 0.0)]


@pytest.mark.parametrize("name", ["room", "house", "corridor", "hazards", "steps"])
def test_twenty_robots_keep_away_from_walls_and_from_each_other(name):
    world = world_file.load(name)
    places = free_places(world, RADIUS_M, 20)
    assert len(places) == 20
    for place in places:
        assert world.clearance(place.x_m, place.y_m) >= RADIUS_M + GAP_M - 1e-9
        world.place(f"{place}", place, Footprint(2 * RADIUS_M, 2 * RADIUS_M, True))


def test_a_world_that_is_too_small_says_how_many_fit():
    with pytest.raises(ConfigError, match="expected at most 6: there is no free floor"):
        free_places(world_file.load("l-course"), RADIUS_M, 20)
