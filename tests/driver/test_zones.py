"""Zones: never faster than asked, never into the protective zone, never stuck; and a robot that drives at a wall."""

import math
from collections import deque

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot import models, wirings
from mrl_driver.robot.models import Body, SonarMount, kit
from mrl_driver.robot.sonar import FIELD_OF_VIEW_RAD
from mrl_driver.safety.free_distance import BESIDE_RAD, MOST_RAYS, Scan
from mrl_driver.safety.protective_zones import LEAST_M_S, STALE_S, Zones, ZoneSettings, require_settings
from sim_arduino.serve import factory
from sim_arduino.world import world_file

MODEL = models.load("traxbot")
FRONT_M = MODEL.body.length_m / 2
ZONES = ZoneSettings()
TICK_S, SONAR_S = 0.02, 0.3
STEP_ERROR_M = 1e-5  # Of a motion in steps of TICK_S
ODD_RANGES = st.one_of(st.floats(0.15, 6.45), st.sampled_from([math.inf, -math.inf, math.nan]))


def zones_of(kind=ZONES, sonars=None, laser=False):
    return Zones(kind, MODEL.body, MODEL.sonars if sonars is None else sonars, laser)


def told(zones, front, left=math.inf, right=math.inf, now=0.0):
    for name, range_m in (("front", front), ("left", left), ("right", right)):
        zones.on_range(name, range_m, now)
    return zones


def saw(zones, room_m, now=0.0):
    """A laser with one ray says how much way is free before the body."""
    zones.on_scan(Scan([room_m + FRONT_M], 0.0, 0.01, 0.02, ORIGIN), now)
    return zones


def with_laser(kind=ZONES):
    return zones_of(kind, {}, laser=True)


@pytest.mark.parametrize(
    ("velocity", "near", "far"),
    [
        ((0.0, 0.0), (FRONT_M, -0.152), (FRONT_M + ZONES.warning_m, 0.152)),
        ((-0.2, 0.0), (-FRONT_M, 0.152), (-FRONT_M - ZONES.warning_m - 0.2, -0.152)),
        ((0.0, 0.2), (0.1625, 0.102), (-0.1625, 0.102 + ZONES.warning_m + 0.2)),
    ],
)
def test_a_zone_begins_at_the_body_and_grows_by_the_stopping_distance_in_the_direction_of_motion(
    velocity, near, far
):
    """By hand, for a body of 0.225 m by 0.204 m: 0.2 m/s for 0.5 s, and 0.1 m of braking at 0.2 m/s2."""
    assert (MODEL.body.length_m, MODEL.body.width_m) == (0.225, 0.204)
    warning = with_laser().areas(velocity)[0]
    assert warning[3] == pytest.approx(near) and warning[1] == pytest.approx(far)


@pytest.mark.parametrize("front", [0.25, 0.5, 1.0, 2.0, math.inf, math.nan, -math.inf])
def test_speed_that_is_allowed_ahead_is_that_of_a_command_that_is_too_fast(front):
    """The question changes nothing; without a valid reading the robot is slow."""
    zones = told(zones_of(), front)
    allowed = zones.allowed_ahead_m_s(0.1)
    assert not zones.warning_clear and zones.limit(-0.1, 0.1) == -0.1
    assert zones.limit(99.0, 0.1) == min(allowed, 99.0)
    assert not math.isnan(front) or allowed == ZONES.slow_m_s
    assert front != math.inf or (
        zones.limit(0.3, 0.1) == 0.3 and zones.warning_clear and zones.protective_clear
    )


@pytest.mark.parametrize("kind", ["GP2Y0A21", "GP2Y0A02", "HC-SR04"])
def test_a_sensor_that_sees_nothing_allows_the_speed_that_stops_within_its_reach(kind):
    sonars = {"front": SonarMount(FRONT_M, 0.0, 0.0, "range_1", kind)}
    zones, reach_m = told(zones_of(sonars=sonars), math.inf), sonars["front"].kind.farthest_m
    assert zones.limit(9.0, 0.1) == pytest.approx(ZONES.speed_m_s(reach_m - ZONES.warning_m), abs=0.02)
    assert ZONES.growth_m(zones.limit(9.0, 0.1)) < reach_m


@pytest.mark.parametrize("odd", [math.nan, math.inf])
def test_a_speed_that_is_none_does_not_become_one(odd):
    """It is for the driver to refuse, which stops the robot."""
    assert str(told(zones_of(), 2.0).limited((odd, 0.0), 0.1)) == str((odd, 0.0))


@pytest.mark.parametrize("room_m", [0.4, 0.7, 0.9, 1.05, 1.2, 2.0])
def test_the_outer_zone_only_warns_unless_it_has_a_speed(room_m):
    slowed = max(ZONES.slow_m_s, ZONES.speed_m_s(room_m - ZONES.warning_m))
    slowed = min(slowed, ZONES.speed_m_s(room_m - ZONES.protective_m))
    assert saw(with_laser(), room_m).limit(9.0, 0.1) == pytest.approx(slowed)
    outer = max(0.15, ZONES.speed_m_s(room_m - 2 * ZONES.warning_m))
    zones = with_laser(ZONES._replace(outer_slow_m_s=0.15))
    assert saw(zones, room_m).limit(9.0, 0.1) == pytest.approx(min(slowed, outer))


def test_zones_that_are_not_known_to_be_free_are_not_clear():
    """Before the first request, without a valid reading, and with silent sonars."""
    zones = zones_of()
    assert not zones.protective_clear and not zones.warning_clear and not zones.outer_clear
    told(zones, math.nan).limit(0.1, 0.1)
    assert not zones.outer_clear
    told(zones, math.inf).limit(0.1, STALE_S + 0.2)
    assert not zones.outer_clear


@pytest.mark.parametrize(("zone", "length_m"), [("warning_clear", 0.5), ("outer_clear", 1.0)])
def test_a_zone_that_warns_is_left_by_the_hysteresis_later(zone, length_m):
    zones, clear = with_laser(), []
    for more_m in (0.01, -0.01, 0.04, 0.06):
        saw(zones, length_m + ZONES.growth_m(0.1) + more_m).limit(0.1, 0.0)
        clear.append(getattr(zones, zone))
    assert clear == [True, False, False, True]


def test_at_the_very_edge_of_the_protective_zone_the_robot_still_moves():
    edge_m = SETTINGS.protective_m + SETTINGS.growth_m(0.02)
    zones = point_saw(point_zones(), edge_m)
    assert zones.limit(ASKED_M_S, 0.0) == pytest.approx(0.02) and zones.protective_clear


def test_the_protective_zone_stops_and_lets_go_by_the_hysteresis_later():
    zones = with_laser()
    edge_m = ZONES.protective_m + ZONES.growth_m(LEAST_M_S)
    moves = [saw(zones, edge_m + more).limit(0.1, 0.0) > 0 for more in (0.01, -0.01, 0.01, 0.04, 0.06, 0.01)]
    assert moves == [True, False, False, False, True, True]


def test_before_a_wall_the_robot_may_drive_away_and_turn():
    zones = told(zones_of(), -math.inf, -math.inf, -math.inf)
    assert zones.limit(0.2, 0.0) == 0 and not zones.protective_clear
    assert zones.limit(-0.2, 0.0) == -ZONES.slow_m_s and zones.protective_clear
    assert zones.limited((0.0, 0.0), 0.0) == (0.0, 0.0)
    assert zones.limited((0.0, 0.1), 0.0)[1] == 0


def test_a_sonar_behind_frees_the_way_back():
    zones = zones_of(sonars={"back": SonarMount(-0.1, 0.0, 180)})
    zones.on_range("back", math.inf, 0.0)
    assert zones.limit(-0.3, 0.0) == -0.3
    zones.on_range("back", 0.2, 0.0)
    assert zones.limit(-0.3, 0.0) == 0


def test_a_silent_sonar_stops_the_robot():
    zones = told(zones_of(), math.inf)
    assert zones.limit(0.3, STALE_S + 0.1) == 0
    assert zones_of().limit(0.3, 0.0) == 0
    assert zones.limit(-0.3, STALE_S + 0.1) == -ZONES.slow_m_s


@pytest.mark.parametrize("left_m, free", [(0.3, True), (0.16, False)])
def test_what_passes_beside_is_not_in_the_way_unless_it_touches_it(left_m, free):
    assert (told(zones_of(), math.inf, left_m, 0.3).limit(0.3, 0.0) == 0.3) == free


LASER = Pose(0.085, 0.0, 0.0)


def scan(range_m, span_deg=240, mount=LASER, near_m=0.02):
    rays = span_deg + 1
    return Scan([range_m] * rays, -math.radians(span_deg) / 2, math.radians(1), near_m, mount)


SLOW = ZONES.slow_m_s


@pytest.mark.parametrize(
    "range_m, span_deg, ahead_m_s, back_m_s",
    [
        (2.0, 240, 0.3, -SLOW),
        (2.0, 360, 0.3, -0.3),
        (0.22, 240, 0.0, -SLOW),
        (math.nan, 240, SLOW, -SLOW),
        (math.nan, 360, SLOW, -SLOW),
        (0.0, 240, SLOW, -SLOW),
        (-math.inf, 240, 0.0, -SLOW),
    ],
)
def test_a_laser_limits_the_ways_that_it_sees(range_m, span_deg, ahead_m_s, back_m_s):
    """No further than its fan; without a valid range it slows, and a range that is too near stops."""
    zones = with_laser()
    assert zones.on_scan(scan(range_m, span_deg), 0.0) == ""
    assert (zones.limit(0.3, 0.0), zones.limit(-0.3, 0.0)) == (ahead_m_s, back_m_s)


def saw_except_ahead(zones, ahead_m, now, rays=40, **given):
    """A scan all around with walls at 2 m, and in this many rays ahead another range."""
    ranges = [ahead_m if abs(number - 180) <= rays / 2 else 2.0 for number in range(361)]
    zones.on_scan(Scan(ranges, -math.pi, math.radians(1), 0.15, LASER, 12.0, **given), now)
    return zones.limit(0.3, now)


@pytest.mark.parametrize("lost_m", [math.inf, math.nan, 0.1, 13.0])
def test_rays_ahead_without_a_reading_are_not_free_and_keep_what_they_saw_for_a_second(lost_m):
    """As those of an RPLIDAR when something is closer than its 0.15 m."""
    zones = with_laser()
    assert saw_except_ahead(zones, 0.16, 0.0) == 0.0
    assert [saw_except_ahead(zones, lost_m, now) for now in (0.5, 1.0, 1.1)] == [0.0, 0.0, SLOW]
    assert not zones.warning_clear and zones.protective_clear


def test_what_lost_rays_saw_comes_closer_as_the_robot_moves():
    zones = with_laser()
    saw_except_ahead(zones, 1.0, 0.0)
    zones.moved(0.75, 0.1)
    saw_except_ahead(zones, math.nan, 0.7)
    assert zones.limit(0.3, 0.7) < SLOW


def test_what_rays_saw_before_is_known_though_the_scan_begins_at_another_ray():
    """As that of a laser whose turns have not always as many rays."""
    zones = with_laser()
    saw_except_ahead(zones, 0.16, 0.0, rays=3)
    ranges = [math.nan if abs(number - 150) <= 1 else 2.0 for number in range(301)]
    zones.on_scan(Scan(ranges, math.radians(-150), math.radians(1), 0.15, LASER), 0.1)
    assert zones.limit(0.3, 0.1) == 0.0


@pytest.mark.parametrize(
    ("rays", "given", "allowed_m_s"), [(40, {"inf_is_free": True}, 0.3), (1, {}, 0.3), (2, {}, SLOW)]
)
def test_rays_of_infinity_are_free_if_the_laser_means_it_or_if_they_are_few(rays, given, allowed_m_s):
    assert saw_except_ahead(with_laser(), math.inf, 0.0, rays, **given) == allowed_m_s


def test_rays_without_a_reading_beside_the_way_slow_nothing():
    zones = with_laser()
    ranges = [math.nan if abs(number - 180) > 90 else 2.0 for number in range(361)]
    zones.on_scan(Scan(ranges, -math.pi, math.radians(1), 0.15, LASER), 0.0)
    assert (zones.limit(0.3, 0.0), zones.limit(-0.3, 0.0)) == (0.3, -SLOW)


def test_a_laser_that_nobody_has_announced_counts_from_its_first_scan_on():
    zones = zones_of(sonars={})
    assert zones.limit(0.3, 0.0) == SLOW
    assert saw(zones, 0.1).limit(0.3, 0.0) == 0


@pytest.mark.parametrize("odd", [{"near_m": 0.0}, {"ranges": [2.0] * MOST_RAYS}])
def test_a_scan_at_the_limits_of_a_meaning_is_used(odd):
    assert with_laser().on_scan(scan(2.0)._replace(**odd), 0.0) == ""


ODD = [
    ({"first_rad": math.nan}, "its rays begin at nan rad"),
    ({"step_rad": math.nan}, "steps of nan"),
    ({"step_rad": math.inf}, "steps of inf"),
    ({"step_rad": 1e308}, "steps of 1e+308"),
    ({"near_m": math.nan}, "its shortest range is nan"),
    ({"near_m": math.inf}, "its shortest range is inf"),
    ({"near_m": -1.0, "ranges": [-0.5] * 241}, "its shortest range is -1"),
    ({"mount": LASER._replace(x_m=math.nan)}, "its mount is"),
    ({"mount": LASER._replace(y_m=math.inf)}, "its mount is"),
    ({"mount": LASER._replace(yaw_rad=math.nan)}, "its mount is"),
    ({"ranges": []}, "it has 0 rays"),
    ({"ranges": [2.0] * (MOST_RAYS + 1), "step_rad": 2 * math.pi / MOST_RAYS}, "it has 8193 rays"),
]


@pytest.mark.parametrize("odd, words", ODD, ids=[words for _, words in ODD])
def test_a_laser_that_sends_scans_without_a_meaning_stops_the_robot_as_a_silent_one(odd, words):
    zones = with_laser()
    assert words in zones.on_scan(scan(2.0)._replace(**odd), 0.0)
    assert zones.limit(0.3, 0.0) == 0


def test_a_scan_without_a_meaning_leaves_the_one_before_until_that_is_stale():
    zones = with_laser()
    zones.on_scan(scan(2.0), 0.0)
    zones.on_scan(scan(0.22)._replace(step_rad=math.nan), STALE_S)
    assert zones.limit(0.3, STALE_S) == 0.3
    assert zones.limit(0.3, STALE_S + TICK_S) == 0


def sideways(**sonars):
    """Zones that know of the readings of sonars at these yaws."""
    mounts = {name: SonarMount(0.0, 0.0, yaw) for name, (yaw, _) in sonars.items()}
    zones = zones_of(sonars=mounts)
    for name, (_, range_m) in sonars.items():
        zones.on_range(name, range_m, 0.0)
    return zones


def test_a_zone_lies_where_the_robot_goes():
    """Something near on the left: in the way to the left, and slantwise, and in no other."""
    around = {f"s{yaw}": (yaw, 3.0) for yaw in (0, 45, 135, 180, 225, 270, 315)}
    zones = sideways(s90=(90, 0.3), **around)
    assert zones.limited((0.0, 0.2), 0.0) == (0.0, 0.0) and not zones.protective_clear
    slant = zones.limited((0.14, 0.14), 0.0)
    assert 0 < slant[0] < 0.14 and slant[0] == pytest.approx(slant[1])
    assert [zones.limited(away, 0.0) for away in ((0.2, 0.0), (0.0, -0.2), (-0.2, 0.0))] == [
        (0.2, 0.0), (0.0, -0.2), (-0.2, 0.0)
    ]  # fmt: skip


@given(
    st.lists(st.tuples(st.floats(-2, 2), ODD_RANGES, ODD_RANGES, ODD_RANGES, st.floats(0, 1.5)), max_size=20)
)
def test_never_faster_than_asked_and_never_turned_around(steps):
    zones, now = zones_of(), 0.0
    for asked, front, left, right, wait_s in steps:
        told(zones, front, left, right, now)
        now += wait_s
        allowed = zones.limit(asked, now)
        assert abs(allowed) <= abs(asked) and allowed * asked >= 0


@given(
    st.floats(0.3, 3.0),
    st.lists(st.tuples(st.floats(0, 1.5), st.integers(1, 40)), min_size=1, max_size=8),
    st.sampled_from([(0, 0), (3, 3), (0, 6), (6, 0)]),
    st.floats(0.05, 2.0),
)
@settings(max_examples=40)
def test_never_into_the_protective_zone(start_m, plan, delays, braking):
    """A robot that slows down no better than the model, by readings and commands late by half of the reaction."""
    kind = ZONES._replace(braking_m_s2=braking, reaction_s=0.3)
    zones, room_m, speed, now = with_laser(kind), start_m, 0.0, 0.0
    sensed, commands = deque([room_m] * (delays[0] + 1)), deque([0.0] * (delays[1] + 1))
    for asked, ticks in plan:
        for _ in range(ticks * 2):
            if round(now / TICK_S) % round(SONAR_S / TICK_S) == 0:
                saw(zones, sensed[0], now)
            commands.append(zones.limit(asked, now))
            commands.popleft()
            speed = max(commands[0], speed - braking * TICK_S)
            room_m -= speed * TICK_S
            sensed.append(room_m)
            sensed.popleft()
            now += TICK_S
            zones.moved(speed * TICK_S, now)
            assert room_m >= kind.protective_m - STEP_ERROR_M


@given(st.lists(st.tuples(ODD_RANGES, ODD_RANGES, ODD_RANGES), max_size=10), st.floats(0.01, 1))
@settings(max_examples=40)
def test_no_deadlock(readings, asked):
    """Whatever was seen, the robot may always go back, and goes on as soon as the way is free."""
    zones = zones_of()
    for reading in readings:
        told(zones, *reading)
        zones.limit(asked, 0.0)
        assert zones.limit(-asked, 0.0) < 0
    assert told(zones, math.inf).limit(asked, 0.0) == asked


@pytest.mark.parametrize(
    "wrong, words",
    [
        ({"outer_m": 0.5}, "outer_m is 0.5, expected more than warning_m 0.5, or 0"),
        ({"outer_slow_m_s": 0.05}, "outer_slow_m_s is 0.05, expected at least slow_m_s 0.1, or 0"),
    ],
)
def test_zones_that_contradict_each_other_are_refused(wrong, words):
    with pytest.raises(ConfigError, match=words) as caught:
        require_settings(ZONES._replace(**wrong))
    assert "\n" not in str(caught.value)


STEP_S = 0.05
READY_S = 2.0  # Before that the sonars have no readings


def course(tmp_path, walls, planner, seconds, robot="traxbot"):
    """True places of a robot in zones that a planner drives, and shares of its speed that were allowed."""
    file, model = tmp_path / "world.yaml", models.load(robot)
    file.write_text(f"start: [0, 0, 0]\nwalls: {walls}\n")
    emulated = factory.make(factory.Options(robot=robot), world_file.load(str(file)))
    zones = Zones(
        ZONES._replace(braking_m_s2=model.limits.linear_acceleration_m_s2), model.body, model.sonars
    )
    places, shares = [], []

    def watch(telemetry):
        for name in telemetry.fresh:
            zones.on_range(name, telemetry.ranges[name], driver.now_s)

    with SteppedDriver(emulated.engine, model) as driver:
        driver.on_telemetry(watch)
        while driver.now_s < seconds:
            driver.wait(STEP_S)
            zones.moved(driver.twist[0] * STEP_S, driver.now_s, sum(driver.twist[2:]) * STEP_S)
            linear, angular, *lateral = planner(driver)
            allowed, left = zones.limited((linear, sum(lateral)), driver.now_s)
            driver.drive(allowed, angular, left)
            places.append(emulated.plant.true_pose[:2])
            shares.append(allowed / linear if linear and driver.now_s > READY_S else 1.0)
    emulated.close()
    return (*zip(*places), shares)


def test_a_robot_that_drives_at_a_wall_stops_before_it(tmp_path):
    xs, _, _ = course(tmp_path, "[[1.5, -2, 1.5, 2]]", lambda _: (0.3, 0.0), 10.0)
    room_m = 1.5 - FRONT_M - max(xs)
    assert ZONES.protective_m <= room_m < ZONES.protective_m + 0.06
    assert max(xs) - xs[-20] < 0.01


@pytest.mark.parametrize("kind", ["GP2Y0A21", "GP2Y0A02"])
def test_a_sharp_alone_stops_a_robot_before_a_wall(tmp_path, kind):
    """Where mrl new assumes it, behind the edge of the body."""
    pins = {**wirings.load("mrl_duo").pins, "pin_sonar_front": -1, "pin_range_1_echo": 14}
    path, sonars = tmp_path / "rover.yaml", {"front": ("range_1", kind)}
    path.write_text(kit.text_of(kit.Kit("rover", 11, 65.0, 150.0, 1496.0, "tb6612", pins, sonars=sonars)))
    xs, _, _ = course(tmp_path, "[[1.5, -2, 1.5, 2]]", lambda _: (0.4, 0.0), 13.0, str(path))
    room_m = 1.5 - models.load(str(path)).body.length_m / 2 - max(xs)
    assert ZONES.protective_m <= room_m < ZONES.protective_m + 0.06


def test_a_robot_passes_a_door_that_is_just_wide_enough_slowly(tmp_path):
    """0.44 m wide, for a body of 0.2 m and what is to stay free beside it."""
    walls = "[[1.0, 0.22, 1.0, 2], [1.0, -0.22, 1.0, -2]]"
    xs, _, shares = course(tmp_path, walls, lambda robot: (0.3, -robot.pose.yaw_rad), 20.0)
    assert xs[-1] > 1.5 and min(shares) < 0.8


def test_three_wheels_stop_before_a_wall_beside_them(tmp_path):
    """Its sonars look 45 deg aside; what they see of the wall is nearer than the wall is."""
    _, ys, _ = course(tmp_path, "[[-2, 1, 2, 1]]", lambda _: (0.0, 0.0, 0.3), 10.0, "omni")
    room_m = 1.0 - models.load("omni").body.width_m / 2 - max(ys)
    assert ZONES.protective_m <= room_m < 0.5
    assert max(ys) - ys[-20] < 0.01 and max(ys) > 0.2


SETTINGS = ZoneSettings(clearance_m=0.0)
POINT = Body(0.0, 0.0, 0.1, 1.0, False)  # So small that a range is the free distance, to the last bit
TURN_DEG = 360
ASKED_M_S = 0.25
JUST_MORE = 1e-9


def point_zones(settings=SETTINGS, laser=True, **yaws_deg):
    return Zones(settings, POINT, {name: SonarMount(0.0, 0.0, yaw) for name, yaw in yaws_deg.items()}, laser)


def point_saw(zones, room_m, now=0.0):
    """A laser with one ray ahead says how far the way is free."""
    zones.on_scan(Scan([room_m], 0.0, 0.01, 0.02, ORIGIN), now)
    return zones


def saw_around(zones, room_m):
    """A laser sees a round wall."""
    zones.on_scan(Scan([room_m] * TURN_DEG, 0.0, math.radians(1), 0.02, ORIGIN), 0.0)
    return zones


def towards(angle_deg, speed_m_s=ASKED_M_S):
    angle = math.radians(angle_deg)
    return speed_m_s * math.cos(angle), speed_m_s * math.sin(angle)


def room_ahead(zones, now):
    """The free distance [m], from the speed that is allowed; it must exceed the warning zone by some metres."""
    return SETTINGS.warning_m + SETTINGS.growth_m(zones.allowed_ahead_m_s(now))


@pytest.mark.parametrize("reaction_s", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("speed_m_s", [0.0, 0.02, 0.5, 3.0])
def test_the_speed_for_a_free_distance_is_that_whose_zone_is_as_long(reaction_s, speed_m_s):
    settings = ZoneSettings(reaction_s=reaction_s)
    assert settings.speed_m_s(settings.growth_m(speed_m_s)) == pytest.approx(speed_m_s)


@pytest.mark.parametrize(("room_m", "moves"), [(0.2111, True), (0.2109, False)])
def test_the_robot_stops_where_less_than_20_mm_s_are_allowed(room_m, moves):
    """It needs 10 mm for the reaction and 1 mm to brake, before the 0.2 m of the zone."""
    assert (point_saw(point_zones(), room_m).limit(ASKED_M_S, 0.0) > 0) == moves


@pytest.mark.parametrize(("zone", "length_m"), [("warning_clear", 0.5), ("outer_clear", 1.0)])
def test_an_obstacle_at_the_very_edge_of_a_zone_is_not_in_it(zone, length_m):
    zones = point_zones()
    edge_m = length_m + SETTINGS.growth_m(ASKED_M_S)
    clear = []
    for room_m in (edge_m, edge_m - JUST_MORE):
        point_saw(zones, room_m).limit(ASKED_M_S, 0.0)
        clear.append(getattr(zones, zone))
    assert clear == [True, False]


def test_the_outer_zone_is_twice_the_warning_zone_unless_it_has_a_length():
    assert ZoneSettings(warning_m=0.3).outer_edge_m == 0.6
    assert ZoneSettings(warning_m=0.3, outer_m=0.7).outer_edge_m == 0.7


def test_a_direction_that_is_not_covered_is_slow_with_a_speed_of_the_outer_zone_too():
    zones = point_saw(point_zones(SETTINGS._replace(outer_slow_m_s=0.2)), 10.0)
    assert zones.limit(-ASKED_M_S, 0.0) == -SETTINGS.slow_m_s


HYSTERESIS = SETTINGS._replace(clearance_m=0.02, hysteresis_m=0.2)
HELD_M, LET_GO_M = 0.1, 0.35  # In the protective zone; past its edge, but not by the hysteresis


def held_towards(angle_deg):
    """The zones of a robot that was stopped when it drove that way; the way is a little longer now."""
    zones = saw_around(point_zones(HYSTERESIS), HELD_M)
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


@pytest.mark.parametrize(("age_s", "allowed_m_s"), [(1.0, ASKED_M_S), (1.001, 0.0)])
def test_a_sensor_is_silent_after_more_than_a_second(age_s, allowed_m_s):
    assert point_saw(point_zones(), 5.0).limit(ASKED_M_S, age_s) == allowed_m_s


@pytest.mark.parametrize(("age_s", "allowed_m_s"), [(1.0, 0.0), (1.001, SETTINGS.slow_m_s)])
def test_a_reading_counts_for_a_second_although_invalid_ones_follow(age_s, allowed_m_s):
    zones = point_saw(point_zones(), 0.1)
    point_saw(zones, math.nan, 0.5)
    point_saw(zones, math.nan, age_s)
    assert zones.limit(ASKED_M_S, age_s) == allowed_m_s


def test_distances_moved_add_up():
    zones = point_saw(point_zones(), 5.0)
    for now in (0.1, 0.2, 0.3):
        zones.moved(0.25, now)
    assert room_ahead(zones, 0.3) == pytest.approx(4.25)
    zones = sideways(s90=(90, 0.6))
    assert zones.limited((0.0, 0.2), 0.0)[1] > 0
    zones.moved(0.0, 0.1, left_m=0.3)
    assert zones.limited((0.0, 0.2), 0.1) == (0.0, 0.0)


def test_motion_ahead_leaves_the_room_to_the_left_as_it_was():
    zones = point_zones(laser=False, left=90)
    zones.on_range("left", 2.0, 0.0)
    before = zones.limited((0.0, 9.0), 0.0)
    zones.moved(0.25, 0.1)
    assert zones.limited((0.0, 9.0), 0.1) == pytest.approx(before)


@pytest.mark.parametrize(("now_s", "room_m"), [(0.5, 4.9), (0.501, 5.0)])
def test_a_reading_may_be_as_old_as_the_reaction(now_s, room_m):
    """The robot was 0.1 m farther back 0.5 s ago."""
    zones = point_zones()
    zones.moved(0.1, 0.0)
    zones.moved(0.1, now_s)
    assert room_ahead(point_saw(zones, 5.0, now_s), now_s) == pytest.approx(room_m)


def test_a_range_of_a_sonar_that_is_not_used_changes_nothing():
    zones = point_saw(point_zones(front=0), 5.0)
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
    assert math.hypot(*point_zones().limited(way, 0.0)) == pytest.approx(allowed_m_s)


@pytest.mark.parametrize(("off_deg", "allowed_m_s"), [(0.0, ASKED_M_S), (0.001, SETTINGS.slow_m_s)])
def test_a_sonar_covers_directions_up_to_23_degrees_from_its_axis(off_deg, allowed_m_s):
    zones = point_zones(laser=False, front=math.degrees(FIELD_OF_VIEW_RAD / 2 + BESIDE_RAD) + off_deg)
    zones.on_range("front", math.inf, 0.0)
    assert zones.limit(ASKED_M_S, 0.0) == allowed_m_s


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
        point_zones(WIDE._replace(**{name: value}))


def test_the_warning_zone_must_be_longer_than_the_protective_zone_with_its_hysteresis():
    settings = SETTINGS._replace(protective_m=0.25, hysteresis_m=0.25)
    require_settings(settings._replace(warning_m=0.5 + JUST_MORE))
    with pytest.raises(ConfigError, match="warning_m is 0.5, expected more than 0.5"):
        require_settings(settings._replace(warning_m=0.5))
