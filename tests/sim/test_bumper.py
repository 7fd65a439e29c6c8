"""The bumper: how far a motion is possible, when the world is searched, and which bodies there are."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.hardware.collision import Bumper, footprint_for, touched
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.shapes import Footprint, Wall, polygon
from sim_arduino.world.world import World

TRAXBOT = models.load("traxbot")
ROUND = Footprint(0.2, 0.2, True)  # A robot of 100 mm radius
STEP = 0.5**12  # Share of a motion to which a contact is found
CONTACT_M = 1e-4
HALF_M = 0.5 * TRAXBOT.body.length_m
AHEAD = Wall(1.0, -5.0, 1.0, 5.0)
START = Pose(0.0, 0.0, 0.0)


def straight(start, way_m):
    """Poses on a straight way along x."""
    return lambda share: Pose(start.x_m + share * way_m, start.y_m, start.yaw_rad)


def share_of(way_m, start=START, walls=(AHEAD,)):
    bumper = Bumper(World(list(walls)), ROUND, "robot")
    return bumper.share(start, abs(way_m), straight(start, way_m), 0.0)


@pytest.mark.parametrize(
    "x_m, y_m, bumpers",
    [
        *((0.104, 0.079, "left"), (0.104, 0.001, "left"), (0.096, 0.04, "left")),
        *((0.104, -0.079, "right"), (0.104, -0.001, "right"), (0.096, -0.04, "right")),
        *((-0.104, 0.079, "rear"), (-0.104, -0.079, "rear"), (-0.096, 0.0, "rear")),
        *((0.106, 0.04, ""), (0.094, 0.04, ""), (0.104, 0.081, ""), (0.104, -0.081, "")),
        *((-0.106, 0.0, ""), (-0.094, 0.0, ""), (-0.104, 0.081, ""), (-0.104, -0.081, "")),
    ],
)
def test_a_bumper_is_a_strip_of_5_mm_before_and_behind_an_edge(x_m, y_m, bumpers):
    """Of a robot of 0.2 m by 0.16 m that stands elsewhere, looking aside."""
    pose = Pose(3.0, -2.0, 1.0)
    there = pose.compose(x_m, y_m)
    world = World([Wall(there.x_m, there.y_m, there.x_m + 1e-6, there.y_m)])
    assert touched(world, Footprint(0.2, 0.16), "robot", pose) == {
        f"bumper_{each}" for each in bumpers.split()
    }


class Watched(World):
    """A world that counts how often its clearance is searched."""

    looks = 0

    def clearance(self, *args):
        self.looks += 1
        return super().clearance(*args)


def test_a_box_has_the_length_and_width_of_the_model():
    assert footprint_for(TRAXBOT) == Footprint(0.225, 0.204)
    assert footprint_for(TRAXBOT, "box") == footprint_for(TRAXBOT)


@pytest.mark.parametrize(("text", "size_m"), [("circle:0.01", 0.02), ("circle:0.1", 0.2), ("circle:5", 10.0)])
def test_a_circle_has_its_radius(text, size_m):
    assert footprint_for(TRAXBOT, text) == Footprint(size_m, size_m, True)


def test_a_board_without_motors_has_no_box_but_may_be_a_circle():
    board = models.load("pioneer")
    assert footprint_for(board) is None
    assert footprint_for(board, "circle:0.25") == Footprint(0.5, 0.5, True)
    assert footprint_for(TRAXBOT, "none") is None


@pytest.mark.parametrize("way_m", [0.89, -0.5, 0.0])
def test_a_motion_that_hits_nothing_is_whole(way_m):
    assert share_of(way_m) == 1.0


@pytest.mark.parametrize(("way_m", "share"), [(0.2, 0.5), (0.12, 0.1 / 0.12), (0.101, 0.1 / 0.101)])
def test_a_motion_ends_at_the_wall(way_m, share):
    """100 mm are free; the contact is found to a part in 4096, on the free side of it."""
    possible = share_of(way_m, start=Pose(0.8, 0.0, 0.0))
    assert share - STEP <= possible <= share


def test_a_motion_that_is_free_for_less_than_a_part_in_4096_is_not_possible():
    way_m = 0.1
    begin = 0.9 - 0.9 * STEP * way_m
    assert share_of(way_m, start=Pose(begin, 0.0, 0.0)) == 0.0
    begin = 0.9 - 1.1 * STEP * way_m
    assert share_of(way_m, start=Pose(begin, 0.0, 0.0)) == STEP


@pytest.mark.parametrize(("way_m", "share"), [(-0.01, 1.0), (0.01, 0.0)])
def test_a_robot_in_contact_may_move_away_and_not_further_in(way_m, share):
    """It is 20 mm in the wall."""
    assert share_of(way_m, start=Pose(0.92, 0.0, 0.0)) == share


def test_a_robot_in_contact_may_slide_along_the_wall():
    along = Wall(-5.0, 0.09, 5.0, 0.09)
    assert share_of(0.3, walls=[along]) == 1.0


def test_a_robot_that_is_clear_may_not_begin_a_contact_that_is_no_deeper_than_none():
    assert share_of(0.02, start=Pose(0.89, 0.0, 0.0)) == pytest.approx(0.5, abs=2 * STEP)


@pytest.mark.parametrize(
    ("distance_m", "dt", "free_motions"), [(0.1, 0.0, 4), (0.0, 0.1, 5), (0.05, 0.1, 3), (0.45, 0.0, 0)]
)
def test_the_world_is_searched_after_the_free_distance_is_used_up(distance_m, dt, free_motions):
    """900 mm are free; the middle moves twice the distance of a wheel at most, and others come at 1.5 m/s."""
    world = Watched([AHEAD])
    bumper = Bumper(world, ROUND, "robot")
    searched = []
    for _ in range(free_motions + 2):
        before = world.looks
        bumper.share(START, distance_m, straight(START, 0.0), dt)
        searched.append(world.looks > before)
    assert searched == [True, *[False] * free_motions, True]


def test_a_robot_in_contact_has_nothing_free():
    """After each motion the world is searched again, however small the next one is."""
    world = Watched([AHEAD])
    bumper = Bumper(world, ROUND, "robot")
    start = Pose(0.92, 0.0, 0.0)
    for _ in range(3):
        before = world.looks
        bumper.share(start, 1e-6, straight(start, -1e-6), 0.0)
        assert world.looks == before + 1


def test_a_robot_does_not_bump_into_itself_but_into_another():
    world = World([])
    world.place("robot", Pose(0.25, 0.0, 0.0), ROUND)
    shares = [
        Bumper(world, ROUND, name).share(START, 0.1, straight(START, 0.1), 0.0) for name in ("robot", "other")
    ]
    assert shares == [1.0, pytest.approx(0.5, abs=0.02)]


def driven(world, seconds=4.0, linear=400, angular=0, **options):
    plant = Plant(TRAXBOT, world, **options)
    plant.motor_board.move_differential(0.0, linear, angular)
    for i in range(round(seconds * 20)):
        plant.advance((i + 1) / 20)
    return plant


def test_a_wall_stops_the_robot_at_its_bow():
    plant = driven(World([Wall(0.5, -1, 0.5, 1)]))
    assert plant.true_pose.x_m == pytest.approx(0.5 - HALF_M, abs=CONTACT_M)
    assert plant.true_pose.x_m <= 0.5 - HALF_M
    assert plant.robot.state.bumped
    slipping_m = plant.robot.motors[0].travel * TRAXBOT.drive.metres_per_count
    assert slipping_m > 1.0


def test_two_robots_of_a_world_meet():
    world = World()
    one = Plant(TRAXBOT, world, (0.0, 0.0, 0.0), name="one")
    two = Plant(TRAXBOT, world, (1.0, 0.0, math.pi), name="two")
    for plant in (one, two):
        plant.motor_board.move_differential(0.0, 300, 0)
    for i in range(100):
        one.advance((i + 1) / 20)
        two.advance((i + 1) / 20)
    assert two.true_pose.x_m - one.true_pose.x_m == pytest.approx(2 * HALF_M, abs=0.03)
    assert two.true_pose.x_m - one.true_pose.x_m >= 2 * HALF_M


@settings(max_examples=25, deadline=None)
@given(
    linear=st.integers(-600, 600),
    angular=st.integers(-3000, 3000),
    pose=st.builds(Pose, st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.floats(-4, 4)),
)
def test_no_robot_leaves_its_room(linear, angular, pose):
    room = World(polygon([(-1, -1), (1, -1), (1, 1), (-1, 1)]))
    plant = driven(room, 3.0, linear, angular, pose=pose)
    corners = [c for side in plant.footprint.outline(plant.true_pose) for c in side]
    assert max(map(abs, corners)) <= 1.0 + 1e-9


@pytest.mark.parametrize("text", ["square", "circle", "circle:0", "circle:nan", "circle:9", "box:1"])
def test_bad_footprint(text):
    with pytest.raises(ConfigError, match="expected box, none or circle:RADIUS, 0.01 to 5 m"):
        footprint_for(TRAXBOT, text)
