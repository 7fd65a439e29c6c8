"""What stops a robot."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.shapes import Footprint, Wall, polygon
from sim_arduino.world.world import World

TRAXBOT = models.load("traxbot")
HALF_M = 0.5 * TRAXBOT.body.length_m
CONTACT_M = 1e-4
"""How near to the wall a robot comes to rest."""


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


def test_its_wheels_go_on():
    """They slip on the floor: the encoders count what the robot does not move."""
    plant = driven(World([Wall(0.5, -1, 0.5, 1)]))
    assert plant.robot.motors[0].travel * TRAXBOT.drive.metres_per_count > 1.0


def test_leaning_on_a_wall_takes_few_looks(monkeypatch):
    """At 50 steps a second; the first contact alone is searched for."""
    plant, looks = driven(World([Wall(0.5, -1, 0.5, 1)])), []
    touching = World.touching
    monkeypatch.setattr(World, "touching", lambda *args: looks.append(args) or touching(*args))
    plant.advance(5.0)
    assert 50 <= len(looks) <= 500


def test_it_can_back_out():
    world = World([Wall(0.5, -1, 0.5, 1)])
    plant = driven(world)
    plant.motor_board.move_differential(4.0, -400, 0)
    plant.advance(9.0)
    assert plant.true_pose.x_m < 0.3
    assert not plant.robot.state.bumped


def test_without_a_body_nothing_stops_it():
    assert driven(World([Wall(0.5, -1, 0.5, 1)]), footprint="none").true_pose.x_m > 1.0


def test_a_round_robot_is_stopped_by_its_radius():
    plant = driven(World([Wall(0.5, -1, 0.5, 1)]), footprint="circle:0.102")
    assert plant.true_pose.x_m == pytest.approx(0.5 - 0.102, abs=CONTACT_M)


def test_a_box_cannot_turn_beside_a_wall():
    """Its side is 1 mm away, its corners need 50 mm more."""
    gap = 0.5 * TRAXBOT.body.width_m + 0.001
    plant = driven(World([Wall(-1, gap, 1, gap)]), linear=0, angular=1000)
    assert abs(plant.true_pose.yaw_rad) < math.radians(3)


def test_a_round_one_can():
    gap = 0.5 * TRAXBOT.body.width_m + 0.001
    world = World([Wall(-1, gap, 1, gap)])
    assert driven(world, linear=0, angular=500, footprint="circle:0.102").true_pose.yaw_rad > 1.0


def test_another_robot_stops_it():
    world = World()
    world.place("other", Pose(0.6, 0.0, 0.0), Footprint(0.2, 0.2))
    assert driven(world).true_pose.x_m == pytest.approx(0.5 - HALF_M, abs=CONTACT_M)


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


def test_a_robot_is_gone_when_it_is_removed():
    world = World()
    world.place("other", Pose(0.6, 0.0, 0.0), Footprint(0.2, 0.2))
    world.remove("other")
    assert driven(world).true_pose.x_m > 1.0


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


def test_far_from_everything_the_robot_looks_at_nothing():
    """The way that is surely free is used up before the next look around."""
    world = World([Wall(50, -1, 50, 1)])
    looks = []
    world.clearance = lambda x, y, without, inner=world.clearance: looks.append(x) or inner(x, y, without)
    driven(world)
    assert len(looks) <= 2


@pytest.mark.parametrize("text", ["square", "circle", "circle:0", "circle:nan", "circle:9", "box:1"])
def test_bad_footprint(text):
    with pytest.raises(ConfigError, match="expected box, none or circle:RADIUS, 0.01 to 5 m"):
        footprint_for(TRAXBOT, text)
