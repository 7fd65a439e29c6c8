"""Free distance to its limits: the edges of outlines, cones, scans and what a sensor remembers."""

import math

import pytest

from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot.models import Body, SonarMount
from mrl_driver.robot.sonar import FIELD_OF_VIEW_RAD
from mrl_driver.safety import free_distance

OUTLINE = free_distance.Outline(
    0.2, 0.1, 0.05
)  # 40 cm long and 20 cm wide; the swept path is 5 cm wider on each side
NARROW = free_distance.Outline(0.05, 0.01, 0.0)
AHEAD, LEFT, BACK, RIGHT = (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)
SLANT = (0.6, 0.8)
ALMOST_M, TOUCHES_M = 1.5e-9, 1e-9
"""A point this much beside the path does not touch it any more, and still does."""
SLIGHT_RAD = 1e-6
ARC_POINTS = 2000
ARC_ERROR_M = 2e-3  # Of the nearest of so many points on an arc of 2 m


def towards(angle_deg):
    return math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))


# -- the outline


@pytest.mark.parametrize(
    ("point", "direction", "room_m"),
    [
        *((way, way, room_m) for way, room_m in ((AHEAD, 0.8), (LEFT, 0.9), (BACK, 0.8), (RIGHT, 0.9))),
        ((0.01, 0.0), AHEAD, -0.19),
        *(((place_m, 0.05), AHEAD, math.inf) for place_m in (0.0, -0.01, -1.0)),
    ],
    ids=str,
)
def test_the_room_is_the_way_until_the_body_itself_touches(point, direction, room_m):
    """The clearance is beside the path, not ahead.  The robot may drive away even from what is inside its outline."""
    assert OUTLINE.room(point, direction) == pytest.approx(room_m)


@pytest.mark.parametrize(("direction", "half_m"), [(AHEAD, 0.15), (LEFT, 0.25), (BACK, 0.15), (RIGHT, 0.25)])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("beyond_m", "free"), [(0.0, False), (TOUCHES_M, False), (ALMOST_M, True)])
def test_a_point_at_the_edge_of_the_path_is_in_the_way(direction, half_m, side, beyond_m, free):
    beside_m = side * (half_m + beyond_m)
    point = direction[0] - direction[1] * beside_m, direction[1] + direction[0] * beside_m
    assert math.isinf(OUTLINE.room(point, direction)) == free


@pytest.mark.parametrize(
    ("x_m", "room_m"), [(0.2, math.inf), (0.25, 0.8625), (0.6, 0.8625), (0.85, 1.05), (1.4, math.inf)]
)
def test_a_slanting_way_ends_where_the_outline_with_its_clearance_meets_the_point(x_m, room_m):
    """With the left side, which reaches all points of a line after the same way, or with the front."""
    assert OUTLINE.room((x_m, 0.8), SLANT) == pytest.approx(room_m)


@pytest.mark.parametrize(("beyond_m", "free"), [(-1e-6, False), (0.0, False), (1e-6, True)])
@pytest.mark.parametrize("corner", [(0.25, -0.15), (-0.25, 0.15)])
def test_a_corner_that_grazes_a_point_touches_it(corner, beyond_m, free):
    """1 m ahead of the right front corner, or of the left rear one; `beyond_m` is away from the path."""
    away = beyond_m if corner[0] > 0 else -beyond_m
    point = corner[0] + SLANT[0] + away * SLANT[1], corner[1] + SLANT[1] - away * SLANT[0]
    assert math.isinf(OUTLINE.room(point, SLANT)) == free


@pytest.mark.parametrize(
    ("direction", "room_m"), [(AHEAD, 0.3), (BACK, -0.7), (LEFT, 0.2), (SLANT, 0.34), ((-0.6, -0.8), -0.74)]
)
def test_a_wall_is_as_far_as_the_outlines_foremost_point_from_it(direction, room_m):
    """Across the path through a point 0.5 m ahead and 0.3 m to the left; without the clearance."""
    assert OUTLINE.wall_room((0.5, 0.3), direction) == pytest.approx(room_m)


def test_the_outline_of_a_body_is_half_of_it_to_each_side():
    assert free_distance.outline_of(Body(0.4, 0.2, 0.1, 1.0, False), 0.05) == OUTLINE


# -- scans


def scan(*ranges, first_deg=0.0, step_deg=90.0, near_m=0.1, mount=ORIGIN):
    return free_distance.Scan(ranges, math.radians(first_deg), math.radians(step_deg), near_m, mount)


@pytest.mark.parametrize(
    ("range_m", "given", "gaps", "distances_m"),
    [
        (0.1, {}, [0], [0.1]),
        (0.0999, {}, [0, 1], []),
        (5.0, {}, [0], [5.0]),
        (-math.inf, {}, [0], [0.1]),
        (math.inf, {}, [0, 1], []),
        (math.inf, {"inf_is_free": True}, [0], []),
        (5.0, {"far_m": 5.0}, [0], [5.0]),
        (5.0, {"far_m": 4.9}, [0, 1], []),
        (5.0, {"far_m": 4.9, "inf_is_free": True}, [0], []),
        (math.nan, {"inf_is_free": True}, [0, 1], []),
        (-1.0, {}, [0, 1], []),
    ],
)
def test_a_reading_is_valid_from_the_shortest_range_to_the_longest(range_m, given, gaps, distances_m):
    """-inf is too near, and counts as the shortest range; a ray without a hit keeps its place."""
    found = scan(math.nan, range_m)._replace(**given)
    assert found.gaps() == gaps
    assert list(found.points().values()) == [
        (pytest.approx(0.0), pytest.approx(each)) for each in distances_m
    ]


@pytest.mark.parametrize(("lost", "step_deg", "gaps"), [(2, 1.0, 0), (3, 1.0, 3), (2, -1.1, 2), (1, 0.0, 0)])
def test_rays_without_a_reading_are_a_gap_of_more_than_three_degrees(lost, step_deg, gaps):
    """Single rays are lost at edges."""
    assert scan(1.0, *[math.nan] * lost, 1.0, step_deg=step_deg).gaps() == list(range(1, 1 + gaps))


def test_a_scan_without_a_reading_is_a_gap_however_narrow_it_is():
    assert scan(math.nan, step_deg=0.1).gaps() == [0]


@pytest.mark.parametrize(
    ("first", "seen", "last", "gaps"),
    [
        (2, 356, 2, [0, 1, 358, 359]),
        (1, 358, 1, []),
        (2, 176, 2, []),
        (3, 176, 0, [0, 1, 2]),
        (1, 359, 0, []),
    ],
)
def test_the_ends_of_a_full_circle_meet(first, seen, last, gaps):
    """A laser loses single rays there, too, and depth cameras lack those at their edges."""
    assert scan(*[math.nan] * first, *[1.0] * seen, *[math.nan] * last, step_deg=1.0).gaps() == gaps


@pytest.mark.parametrize(
    ("start", "angle_deg", "meets"),
    [
        ((0.0, 0.0), 0.0, True),
        ((0.0, 0.0), 180.0, False),
        ((0.0, 0.0), 90.0, False),
        ((0.0, 0.0), 56.0, True),  # by hand: the corner is at atan(0.3 / 0.2) = 56.3 deg
        ((0.0, 0.0), -57.0, False),
        ((0.3, 0.0), 89.0, True),
        ((0.0, 1.0), 0.0, False),
        ((0.0, 1.0), 10.0, False),
        ((0.0, 1.0), -10.0, True),
        ((0.0, -1.0), 10.0, True),
    ],
)
def test_a_ray_meets_the_way_that_it_crosses_or_begins_in(start, angle_deg, meets):
    outline = free_distance.Outline(0.2, 0.2, 0.1)
    ray = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    assert outline.meets(start, ray, AHEAD) == meets
    assert outline.meets((-start[1], start[0]), (-ray[1], ray[0]), LEFT) == meets  # the same to the left


def test_points_of_a_scan_are_where_its_rays_end_seen_from_the_robot():
    """The laser is 0.2 m ahead and 0.1 m to the left, and its first ray looks straight ahead."""
    points = scan(1.0, 2.0, 3.0, first_deg=-30.0, mount=Pose(0.2, 0.1, math.radians(30.0))).points()
    assert [round(each, 9) for point in points.values() for each in point] == [1.2, 0.1, 0.2, 2.1, -2.8, 0.1]


@pytest.mark.parametrize(("first_deg", "step_deg"), [(-60.0, 60.0), (60.0, -60.0)])
@pytest.mark.parametrize(
    ("angle_rad", "seen"),
    [
        (0.0, True),
        (math.radians(60) - SLIGHT_RAD, True),
        (math.radians(60) + SLIGHT_RAD, False),
        (SLIGHT_RAD - math.radians(60), True),
        (-SLIGHT_RAD - math.radians(60), False),
        (math.pi, False),
    ],
)
def test_a_laser_looks_from_its_first_ray_to_its_last(first_deg, step_deg, angle_rad, seen):
    """Whether it turns to the left or to the right."""
    laser = scan(1.0, 1.0, 1.0, first_deg=first_deg, step_deg=step_deg)
    assert laser.looks((math.cos(angle_rad), math.sin(angle_rad))) == seen


@pytest.mark.parametrize(
    ("angle_deg", "seen"), [(171, True), (180, True), (-171, True), (-169, False), (169, False), (0, False)]
)
def test_a_laser_that_looks_back_sees_across_half_a_turn(angle_deg, seen):
    laser = scan(1.0, 1.0, 1.0, first_deg=-10.0, step_deg=10.0, mount=Pose(0.0, 0.0, math.pi))
    assert laser.looks(towards(angle_deg)) == seen


def test_a_laser_with_one_ray_looks_along_it():
    assert [scan(1.0).looks(towards(deg)) for deg in (-1, 0, 1)] == [False, True, False]


def test_the_free_distance_of_a_scan_is_that_of_its_nearest_point():
    assert free_distance.scan_room(OUTLINE, [(2.0, 0.0), (1.0, 0.1), (0.5, 1.0)], AHEAD) == pytest.approx(0.8)
    assert free_distance.scan_room(OUTLINE, [], AHEAD) == math.inf


# -- sonars


def mount(yaw_deg=0.0, x_m=0.0, y_m=0.0):
    return SonarMount(x_m, y_m, yaw_deg)


@pytest.mark.parametrize(
    ("yaw_deg", "angle_deg", "off_deg"),
    [(45, 90, 45), (-45, 90, 135), (170, -170, 20), (0, 180, 180), (30, 30, 0)],
)
def test_a_direction_is_off_the_axis_by_the_smaller_angle(yaw_deg, angle_deg, off_deg):
    assert free_distance.off_axis(mount(yaw_deg), towards(angle_deg)) == pytest.approx(math.radians(off_deg))


@pytest.mark.parametrize(
    ("yaw_deg", "ahead"),
    [(0, True), (71.99, True), (72.0, False), (72.01, False), (-72.01, False), (180, False)],
)
def test_a_sonar_looks_ahead_if_its_whole_cone_does(yaw_deg, ahead):
    """The cone is 18 degrees wide to each side."""
    assert free_distance.looks(mount(yaw_deg), AHEAD) == ahead


@pytest.mark.parametrize("room", [free_distance.sonar_room, free_distance.slant_room])
def test_nothing_in_range_leaves_all_room_and_too_near_none(room):
    assert room(OUTLINE, mount(), math.inf, AHEAD) == math.inf
    assert room(OUTLINE, mount(), -math.inf, AHEAD) == 0.0


def test_a_range_of_nothing_is_at_the_sonar_itself():
    assert free_distance.sonar_room(OUTLINE, mount(x_m=0.2), 0.0, AHEAD) == pytest.approx(0.0)


def test_an_echo_of_a_sonar_that_looks_back_counts_where_its_arc_enters_the_path():
    """It is 1 m ahead and 0.2 m to the left, and the path is 5 cm wide to each side."""
    narrow = free_distance.Outline(0.1, 0.05, 0.0)
    room_m = 1.0 - math.sqrt(0.6**2 - 0.15**2) - 0.1
    assert free_distance.sonar_room(narrow, mount(180.0, 1.0, 0.2), 0.6, AHEAD) == pytest.approx(room_m)


@pytest.mark.parametrize("off_deg", range(-70, 71, 20))
@pytest.mark.parametrize("yaw_deg", [-100, 0, 45, 160])
@pytest.mark.parametrize("range_m", [0.3, 0.6, 2.0])
def test_the_free_distance_of_an_echo_is_that_of_the_nearest_point_of_its_arc(off_deg, yaw_deg, range_m):
    sonar, direction = mount(yaw_deg, 0.12, -0.04), towards(yaw_deg + off_deg)
    yaw_rad, half_rad = math.radians(yaw_deg), FIELD_OF_VIEW_RAD / 2
    rooms_m = []
    for number in range(ARC_POINTS + 1):
        angle = yaw_rad + half_rad * (2 * number / ARC_POINTS - 1)
        point = sonar.x_m + range_m * math.cos(angle), sonar.y_m + range_m * math.sin(angle)
        rooms_m.append(OUTLINE.room(point, direction))
    found_m = free_distance.sonar_room(OUTLINE, sonar, range_m, direction)
    assert max(0.0, found_m) == pytest.approx(max(0.0, min(rooms_m)), abs=ARC_ERROR_M)


@pytest.mark.parametrize(
    ("yaw_deg", "angle_deg", "off_deg"),
    [(0, 10, 0), (0, 40, 22), (0, -10, 0), (0, -40, -22), (30, 60, 12), (90, 60, -12), (-30, -60, -12)],
)
def test_a_wall_at_an_angle_is_as_near_as_the_edge_of_the_cone_that_is_nearest_to_the_way(
    yaw_deg, angle_deg, off_deg
):
    x, y = towards(angle_deg)
    half_m = NARROW.half_length_m * x + NARROW.half_width_m * abs(y)
    room_m = free_distance.slant_room(NARROW, mount(yaw_deg), 1.0, (x, y))
    assert room_m == pytest.approx(math.cos(math.radians(off_deg)) - half_m)


@pytest.mark.parametrize("room", [free_distance.sonar_room, free_distance.slant_room])
def test_an_echo_may_come_from_the_edge_of_the_cone(room):
    """There it is nearest along the path, if the robot is wide."""
    expected_m = math.cos(FIELD_OF_VIEW_RAD / 2) - 0.1
    assert room(free_distance.Outline(0.1, 1.0, 0.0), mount(), 1.0, AHEAD) == pytest.approx(expected_m)


# -- what a sensor remembers


def sight(room_m=1.0, slant_m=0.5, places=((0.0, 0.0),)):
    made = free_distance.Sight()
    made.know(lambda way: room_m, lambda way: slant_m, places, 0.0)
    return made


def test_a_message_without_a_reading_is_heard_and_not_known():
    made = sight()
    made.hear(2.0)
    assert (made.heard_s, made.known_s) == (2.0, 0.0)


def test_a_direction_that_no_sensor_covers_has_the_room_of_a_slanting_view():
    seen = sight()
    assert seen.room_m(AHEAD, True, (0.0, 0.0)) == 1.0
    assert seen.room_m(AHEAD, False, (0.0, 0.0)) == 0.5
    seen.know(lambda way: 2.0, lambda way: 0.5, ((0.0, 0.0),), 1.0)  # a new reading replaces what was found
    assert seen.room_m(AHEAD, True, (0.0, 0.0)) == 2.0


@pytest.mark.parametrize(
    ("direction", "room_m"), [(AHEAD, 0.7), (BACK, 1.2), (LEFT, 0.9), (RIGHT, 1.0), (SLANT, 0.74)], ids=str
)
def test_the_way_since_a_reading_is_counted_from_the_place_that_leaves_the_least_room(direction, room_m):
    """The robot is at (0.3, 0.1) now, and was between (0, 0) and (0.1, 0.1) then."""
    seen = sight(places=((0.0, 0.0), (0.1, 0.1)))
    assert seen.room_m(direction, True, (0.3, 0.1)) == pytest.approx(room_m)
