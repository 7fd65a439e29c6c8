"""The zones to their limits: the edges of zones, sectors and readings, and what settings may be."""

import math

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN
from mrl_driver.robot.models import Body, SonarMount
from mrl_driver.safety.free_distance import COVERED_RAD, Scan
from mrl_driver.safety.protective_zones import Zones, ZoneSettings, require_settings

SETTINGS = ZoneSettings(clearance_m=0.0)
POINT = Body(0.0, 0.0, 0.1, 1.0, False)
"""So small that a range is the free distance, to the last bit."""
TURN_DEG = 360
ASKED_M_S = 0.25
JUST_MORE = 1e-9


def zones_of(settings=SETTINGS, laser=True, **yaws_deg):
    return Zones(settings, POINT, {name: SonarMount(0.0, 0.0, yaw) for name, yaw in yaws_deg.items()}, laser)


def saw(zones, room_m, now=0.0):
    """A laser with one ray ahead says how far the way is free."""
    zones.on_scan(Scan([room_m], 0.0, 0.01, 0.02, ORIGIN), now)
    return zones


def saw_around(zones, room_m, now=0.0):
    """A laser sees a round wall."""
    zones.on_scan(Scan([room_m] * TURN_DEG, 0.0, math.radians(1), 0.02, ORIGIN), now)
    return zones


def towards(angle_deg, speed_m_s=ASKED_M_S):
    angle = math.radians(angle_deg)
    return speed_m_s * math.cos(angle), speed_m_s * math.sin(angle)


def room_ahead(zones, now):
    """The free distance [m], from the speed that is allowed; it must exceed the warning zone by some metres."""
    return SETTINGS.warning_m + SETTINGS.growth_m(zones.allowed_ahead_m_s(now))


# -- edges of zones


def test_a_zone_grows_by_the_way_in_the_reaction_and_the_way_of_braking():
    """At 0.4 m/s 0.2 m in half a second, and 0.4 m at 0.2 m/s2; backwards as forwards."""
    assert ZoneSettings().growth_m(0.4) == pytest.approx(0.6)
    assert ZoneSettings().growth_m(-0.4) == pytest.approx(0.6)


@pytest.mark.parametrize("reaction_s", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("speed_m_s", [0.0, 0.02, 0.5, 3.0])
def test_the_speed_for_a_free_distance_is_that_whose_zone_is_as_long(reaction_s, speed_m_s):
    settings = ZoneSettings(reaction_s=reaction_s)
    assert settings.speed_m_s(settings.growth_m(speed_m_s)) == pytest.approx(speed_m_s)


@pytest.mark.parametrize(("room_m", "moves"), [(0.2111, True), (0.2109, False)])
def test_the_robot_stops_where_less_than_20_mm_s_are_allowed(room_m, moves):
    """It needs 10 mm for the reaction and 1 mm to brake, before the 0.2 m of the zone."""
    assert (saw(zones_of(), room_m).limit(ASKED_M_S, 0.0) > 0) == moves


def test_at_the_very_edge_of_the_protective_zone_the_robot_still_moves():
    edge_m = SETTINGS.protective_m + SETTINGS.growth_m(0.02)
    zones = saw(zones_of(), edge_m)
    assert zones.limit(ASKED_M_S, 0.0) == pytest.approx(0.02)
    assert zones.protective_clear


@pytest.mark.parametrize(("zone", "length_m"), [("warning_clear", 0.5), ("outer_clear", 1.0)])
def test_an_obstacle_at_the_very_edge_of_a_zone_is_not_in_it(zone, length_m):
    zones = zones_of()
    edge_m = length_m + SETTINGS.growth_m(ASKED_M_S)
    clear = []
    for room_m in (edge_m, edge_m - JUST_MORE):
        saw(zones, room_m).limit(ASKED_M_S, 0.0)
        clear.append(getattr(zones, zone))
    assert clear == [True, False]


def test_the_outer_zone_is_twice_the_warning_zone_unless_it_has_a_length():
    assert ZoneSettings(warning_m=0.3).outer_edge_m == 0.6
    assert ZoneSettings(warning_m=0.3, outer_m=0.7).outer_edge_m == 0.7


def test_a_direction_that_is_not_covered_is_slow_with_a_speed_of_the_outer_zone_too():
    zones = saw(zones_of(SETTINGS._replace(outer_slow_m_s=0.2)), 10.0)
    assert zones.limit(-ASKED_M_S, 0.0) == -SETTINGS.slow_m_s


# -- hysteresis


HYSTERESIS = SETTINGS._replace(clearance_m=0.02, hysteresis_m=0.2)
HELD_M, LET_GO_M = 0.1, 0.35
"""In the protective zone; past its edge, but not by the hysteresis."""


def held_towards(angle_deg):
    """The zones of a robot that was stopped when it drove that way; the way is a little longer now."""
    zones = saw_around(zones_of(HYSTERESIS), HELD_M)
    assert zones.limited(towards(angle_deg), 0.0) == (0.0, 0.0)
    return saw_around(zones, LET_GO_M)


@pytest.mark.parametrize(
    ("stopped_deg", "angle_deg", "holds"),
    [
        *((0, angle_deg, True) for angle_deg in (22, -22)),
        *((0, angle_deg, False) for angle_deg in (23, -23, 90, 180)),
        *((179, angle_deg, True) for angle_deg in (179, -179, 158, -158)),
    ],
)
def test_a_stop_holds_for_directions_in_the_same_eighth_of_a_turn(stopped_deg, angle_deg, holds):
    """Left and right of the way back are one of them."""
    assert (held_towards(stopped_deg).limited(towards(angle_deg), 0.0) == (0.0, 0.0)) == holds


def test_no_speed_is_allowed_ahead_while_the_stop_holds():
    assert held_towards(0).allowed_ahead_m_s(0.0) == 0.0
    assert held_towards(45).allowed_ahead_m_s(0.0) > 0.0


# -- age of readings


@pytest.mark.parametrize(("age_s", "allowed_m_s"), [(1.0, ASKED_M_S), (1.001, 0.0)])
def test_a_sensor_is_silent_after_more_than_a_second(age_s, allowed_m_s):
    assert saw(zones_of(), 5.0).limit(ASKED_M_S, age_s) == allowed_m_s


@pytest.mark.parametrize(("age_s", "allowed_m_s"), [(1.0, 0.0), (1.001, SETTINGS.slow_m_s)])
def test_a_reading_counts_for_a_second_although_invalid_ones_follow(age_s, allowed_m_s):
    zones = saw(zones_of(), 0.1)
    saw(zones, math.nan, 0.5)
    assert zones.limit(ASKED_M_S, age_s) == allowed_m_s


# -- motion since a reading


def test_distances_moved_add_up():
    zones = saw(zones_of(), 5.0)
    for now in (0.1, 0.2, 0.3):
        zones.moved(0.25, now)
    assert room_ahead(zones, 0.3) == pytest.approx(4.25)


def test_motion_ahead_leaves_the_room_to_the_left_as_it_was():
    zones = zones_of(laser=False, left=90)
    zones.on_range("left", 2.0, 0.0)
    before = zones.limited((0.0, 9.0), 0.0)
    zones.moved(0.25, 0.1)
    assert zones.limited((0.0, 9.0), 0.1) == pytest.approx(before)


@pytest.mark.parametrize(("now_s", "room_m"), [(0.5, 4.9), (0.501, 5.0)])
def test_a_reading_may_be_as_old_as_the_reaction(now_s, room_m):
    """The robot was 0.1 m farther back 0.5 s ago."""
    zones = zones_of()
    zones.moved(0.1, 0.0)
    zones.moved(0.1, now_s)
    assert room_ahead(saw(zones, 5.0, now_s), now_s) == pytest.approx(room_m)


# -- which sensors decide


def test_a_range_of_a_sonar_that_is_not_used_changes_nothing():
    zones = saw(zones_of(front=0), 5.0)
    zones.on_range("front", 5.0, 0.0)
    zones.on_range("left", 0.1, 0.0)
    assert zones.limit(ASKED_M_S, 0.0) == ASKED_M_S


@pytest.mark.parametrize(
    ("angle_deg", "allowed_m_s"),
    [(0, 0.0), (89, 0.0), (90, SETTINGS.slow_m_s), (-90, SETTINGS.slow_m_s), (180, SETTINGS.slow_m_s)],
)
def test_a_laser_that_has_sent_nothing_stops_every_motion_ahead(angle_deg, allowed_m_s):
    x_m_s, y_m_s = towards(angle_deg)
    way = (round(x_m_s, 9), y_m_s)
    assert math.hypot(*zones_of().limited(way, 0.0)) == pytest.approx(allowed_m_s)


@pytest.mark.parametrize(("off_deg", "allowed_m_s"), [(0.0, ASKED_M_S), (0.001, SETTINGS.slow_m_s)])
def test_a_sonar_covers_directions_up_to_23_degrees_from_its_axis(off_deg, allowed_m_s):
    zones = zones_of(laser=False, front=math.degrees(COVERED_RAD) + off_deg)
    zones.on_range("front", math.inf, 0.0)
    assert zones.limit(ASKED_M_S, 0.0) == allowed_m_s


# -- settings


LEAST_AND_MOST = {
    "warning_m": (None, 10.0, "from 0 to 10"),
    "protective_m": (0.0, None, "from 0 to 10"),
    "slow_m_s": (0.01, 10.0, "from 0.01 to 10"),
    "braking_m_s2": (0.01, 100.0, "from 0.01 to 100"),
    "reaction_s": (0.0, 10.0, "from 0 to 10"),
    "hysteresis_m": (0.0, 1.0, "from 0 to 1"),
    "clearance_m": (0.0, 1.0, "from 0 to 1"),
    "outer_m": (0.0, 20.0, "from 0 to 20"),
    "outer_slow_m_s": (0.0, 10.0, "from 0 to 10"),
}
"""The least and the most that each setting may be; None where another setting narrows it."""
WIDE = ZoneSettings(warning_m=5.0, outer_m=15.0)
LIMITS = [(name, limit) for name, row in LEAST_AND_MOST.items() for limit in row[:2] if limit is not None]
OUTSIDE = [
    (name, value)
    for name, (least, most, _) in LEAST_AND_MOST.items()
    for value in ((least or 0.0) - 0.001, (most or 10.0) + 0.001, math.nan)
]


@pytest.mark.parametrize(("name", "limit"), LIMITS)
def test_a_setting_may_be_at_its_limit(name, limit):
    require_settings(WIDE._replace(**{name: limit}))


@pytest.mark.parametrize(("name", "value"), OUTSIDE)
def test_a_setting_outside_its_limits_is_refused_with_them(name, value):
    with pytest.raises(ConfigError, match=f"{name} is .*, expected a number {LEAST_AND_MOST[name][2]}$"):
        zones_of(WIDE._replace(**{name: value}))


def test_the_warning_zone_must_be_longer_than_the_protective_zone_with_its_hysteresis():
    settings = SETTINGS._replace(protective_m=0.25, hysteresis_m=0.25)
    require_settings(settings._replace(warning_m=0.5 + JUST_MORE))
    with pytest.raises(ConfigError, match="warning_m is 0.5, expected more than 0.5"):
        require_settings(settings._replace(warning_m=0.5))
