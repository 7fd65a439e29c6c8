"""A real robot in a virtual world: the ranges that it uses, and the margin for the drift of its odometry."""

import math

import pytest

from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot.models import SonarMount
from sim_arduino.hardware.mirror import Margin, Mirror
from sim_arduino.world.shapes import Footprint, Wall
from sim_arduino.world.world import World

BOX, FRONT = Footprint(0.2, 0.2), SonarMount(0.1, 0.0, 0.0)


def world(*walls, ahead_m=1.0):
    """A virtual robot ahead, its tail at `ahead_m` from the origin."""
    made = World(walls)
    made.place("virtual", Pose(ahead_m + 0.1, 0.0, 0.0), BOX)
    return made


def mirror(place, margin=Margin(0.0, 0.0)):  # noqa: B008
    made = Mirror(place, "real", BOX, margin=margin)
    made.moved(*ORIGIN)
    return made


@pytest.mark.parametrize(
    "real_m, used_m", [(2.0, 0.9), (math.inf, 0.9), (0.5, 0.5), (-math.inf, -math.inf), (math.nan, math.nan)]
)
def test_the_nearer_range_is_used_unless_the_real_one_is_invalid(real_m, used_m):
    assert mirror(world()).closer(real_m, FRONT) == pytest.approx(used_m, nan_ok=True)


def test_robot_without_walls_hears_robots_alone():
    walled = world(Wall(0.5, -1.0, 0.5, 1.0))
    assert mirror(walled).closer(2.0, FRONT) == pytest.approx(0.4)
    assert mirror(walled.without_walls()).closer(2.0, FRONT) == pytest.approx(0.9)


def test_margin_grows_with_the_distance_driven_there_and_back():
    """2 m at 5 %, and 0.1 m at the start: virtual robots seem closer, and the robot larger to them."""
    place = world()
    made = mirror(place, Margin(0.1, 0.05))
    made.moved(-1.0, 0.0, 0.0)
    made.moved(0.0, 0.0, 0.0)
    assert made.margin_m == pytest.approx(0.2) and made.closer(2.0, FRONT) == pytest.approx(0.7)
    (real,) = place.robots("virtual")
    assert real.footprint == pytest.approx(Footprint(0.6, 0.6, False))


def test_localised_robot_has_the_first_margin_again():
    made = mirror(world(), Margin(0.1, 0.05))
    made.moved(1.0, 0.0, 0.0)
    made.locate(Pose(-1.0, 0.0, 0.0))
    assert made.moved(1.0, 0.0, 0.0) == pytest.approx((0.0, 0.0, 0.0)) and made.margin_m == 0.1


def test_laser_ranges_are_shorter_by_the_margin():
    ranges = mirror(world(), Margin(0.1, 0.0)).scan(Pose(0.1, 0.0, 0.0), -0.5, 0.5, 3, 4.0, 0.02)
    assert ranges == pytest.approx([math.inf, 0.8, math.inf])
