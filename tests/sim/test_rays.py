"""Arrays of walls against one wall at a time, a laser against closed forms, and a real robot in a virtual world."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot.models import LaserMount, SonarMount
from sim_arduino.hardware.laser import URG_04LX, LaserScanner
from sim_arduino.hardware.mirror import Margin, Mirror
from sim_arduino.world import rays
from sim_arduino.world.shapes import Footprint, Wall, distance, nearest_in_cone, polygon
from sim_arduino.world.world import World

CONE_RAD, RANGE_M, EXACT_M = math.radians(18), 6.45, 1e-9
coordinate = st.floats(-5, 5)
walls = st.lists(st.builds(Wall, coordinate, coordinate, coordinate, coordinate), min_size=1, max_size=8)
poses = st.builds(Pose, coordinate, coordinate, st.floats(-7, 7))
SQUARE = World(polygon([(-2, -2), (2, -2), (2, 2), (-2, 2)]))


@given(walls=walls, pose=poses)
def test_walls_in_a_cone_are_among_those_near_it(walls, pose):
    near = rays.near_cone(rays.circles(np.array(walls)), pose, CONE_RAD, RANGE_M)
    heard = [i for i, wall in enumerate(walls) if nearest_in_cone([wall], pose, CONE_RAD, RANGE_M) < math.inf]
    assert set(heard) <= set(near)


@given(pose=poses, others=st.lists(poses, min_size=1, max_size=8), round_one=st.booleans())
def test_a_sonar_hears_the_nearest_outline_of_all_robots(pose, others, round_one):
    world, footprint = World(), Footprint(0.4, 0.3, round_one)
    for number, other in enumerate(others):
        world.place(f"r{number}", other, footprint)
    sides = [side for other in others for side in footprint.outline(other)]
    expected = nearest_in_cone(sides, pose, CONE_RAD, RANGE_M)
    assert world.nearest(pose, CONE_RAD, RANGE_M) == pytest.approx(expected)


@given(walls=walls, pose=poses)
def test_arrays_and_the_loop_measure_the_same_distances(walls, pose):
    each = [distance(wall, pose.x_m, pose.y_m) for wall in walls]
    assert rays.distances(np.array(walls), pose.x_m, pose.y_m) == pytest.approx(each)


def along(wall, pose, angle):
    """Distance to a wall along one ray, by solving the two lines."""
    dx, dy = math.cos(pose.yaw_rad + angle), math.sin(pose.yaw_rad + angle)
    ex, ey = wall.x2 - wall.x1, wall.y2 - wall.y1
    cross = dx * ey - dy * ex
    if abs(cross) < 1e-9:
        return math.inf
    px, py = wall.x1 - pose.x_m, wall.y1 - pose.y_m
    far, part = (px * ey - py * ex) / cross, (px * dy - py * dx) / cross
    return far if far >= 0 and 0 <= part <= 1 else math.inf


def beside_line(wall, pose):
    """Distance from the line that a wall lies on; 0 for a wall of no length."""
    ex, ey = wall.x2 - wall.x1, wall.y2 - wall.y1
    length = math.hypot(ex, ey)
    return abs(ex * (pose.y_m - wall.y1) - ey * (pose.x_m - wall.x1)) / length if length > 0.01 else 0.0


@settings(deadline=None, max_examples=40)
@given(walls=walls, pose=poses, first=st.floats(-4, 4))
def test_each_ray_of_a_fan_is_exact(walls, pose, first):
    assume(all(beside_line(wall, pose) > 0.05 for wall in walls))
    got = rays.cast(np.array(walls), pose, first, 0.09, 69, 100.0)
    assert len(got) == 69
    for i, far in enumerate(got):
        each = [min(along(wall, pose, first + 0.09 * i + e) for wall in walls) for e in (-1e-6, 0.0, 1e-6)]
        assert min(each) - 0.01 <= far <= max(each) + 0.01 if far < math.inf else max(each) == math.inf


@pytest.mark.parametrize("yaw_deg", range(0, 360, 15))
def test_a_square_room_all_around(yaw_deg):
    """2 m over the larger of cosine and sine of the ray's direction."""
    yaw = math.radians(yaw_deg)
    got = SQUARE.scan(Pose(0, 0, yaw), -math.pi, math.tau / 360, 360, 10.0)
    angles = yaw - math.pi + np.arange(360) * math.tau / 360
    assert got == pytest.approx(2.0 / np.maximum(abs(np.cos(angles)), abs(np.sin(angles))), abs=EXACT_M)


def test_a_fan_that_begins_behind_a_wall_and_ends_on_it():
    """The wall covers 90 to 225 deg; the fan goes round once from 115 deg, its last rays meet the wall's beginning."""
    wall, pose = Wall(-1.0, 0.0, 0.0, 2.0), Pose(0.0, 1.0, 0.0)
    got = rays.cast(np.array([wall]), pose, 2.0, 0.09, 69, 100.0)
    assert got[68] == pytest.approx(along(wall, pose, 2.0 + 68 * 0.09))


def test_a_ray_meets_another_robot():
    world = World()
    world.place("other", Pose(1.0, 0.0, 0.0), Footprint(0.2, 0.2))
    assert world.scan(Pose(0, 0, 0), 0.0, 0.1, 1, 9.0)[0] == pytest.approx(0.9)
    assert world.scan(Pose(0, 0, 0), 0.0, 0.1, 1, 9.0, without="other")[0] == math.inf


SHARP = URG_04LX._replace(error_m=1e-12, error_share=1e-12)


def test_laser_looks_from_where_it_is_mounted():
    laser = SHARP._replace(mount=LaserMount(x_m=0.1, y_m=0.3, yaw_deg=90.0))
    scan = LaserScanner(SQUARE, laser).scan(Pose(0, 0, 0))
    assert scan[256] == pytest.approx(1.7) and scan[0] == pytest.approx(1.9)


def errors_at(range_m):
    world = World([Wall(URG_04LX.mount.x_m + range_m, -50, URG_04LX.mount.x_m + range_m, 50)])
    scanner, exact = LaserScanner(world, seed=3), LaserScanner(world, SHARP)
    true = exact.scan(Pose(0, 0, 0))
    near = np.isfinite(true) & (true < range_m * 1.05) & (true <= 4.0)
    return np.concatenate([scanner.scan(Pose(0, 0, 0))[near] - true[near] for _ in range(20)])


@pytest.mark.parametrize(
    ("range_m", "least_m", "most_m"), [(0.8, 0.005, 0.010), (3.0, 0.03, 0.02 * 3.0 * 1.05)]
)
def test_errors_stay_within_10_mm_below_a_metre_and_2_percent_beyond(range_m, least_m, most_m):
    assert least_m < abs(errors_at(range_m)).max() <= most_m + EXACT_M


def test_too_near_is_minus_infinite():
    world = World([Wall(URG_04LX.mount.x_m + 0.01, -1, URG_04LX.mount.x_m + 0.01, 1)])
    assert LaserScanner(world, SHARP).scan(Pose(0, 0, 0))[256] == -math.inf


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


@pytest.mark.parametrize(("ahead_m", "used_m"), [(0.8, 0.7), (1.0, math.inf), (0.19, -math.inf)])
def test_a_virtual_robot_is_seen_as_far_as_the_type_of_the_sensor_reaches(ahead_m, used_m):
    beam = FRONT._replace(type="GP2Y0A21")
    assert mirror(world(ahead_m=ahead_m)).closer(math.inf, beam) == pytest.approx(used_m)


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
