"""Zones: never faster than asked, never into the protective zone, never stuck; and a robot that drives at a wall."""

import math
from collections import deque

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.robot import models
from mrl_driver.robot.models import Limits, SonarMount
from mrl_driver.safety.free_distance import MOST_RAYS, Scan
from mrl_driver.safety.protective_zones import LEAST_M_S, STALE_S, Zones, ZoneSettings, require_settings
from sim_arduino.serve import factory
from sim_arduino.world import world_file

MODEL = models.load("traxbot")
FRONT_M = MODEL.body.length_m / 2
ZONES = ZoneSettings()
TICK_S, SONAR_S = 0.02, 0.3
STEP_ERROR_M = 1e-5
"""Of a motion in steps of TICK_S."""
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


# -- what a reading allows


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


def test_a_zone_reaches_further_the_faster_the_robot_is():
    zones = told(zones_of(), 0.8)
    assert zones.limit(0.1, 0.1) == 0.1 and zones.warning_clear
    assert zones.limit(0.3, 0.1) < 0.3 and not zones.warning_clear


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


# -- laser


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


# -- sideways


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


def test_way_made_to_the_side_counts():
    zones = sideways(s90=(90, 0.6))
    assert zones.limited((0.0, 0.2), 0.0)[1] > 0
    zones.moved(0.0, 0.1, left_m=0.3)
    assert zones.limited((0.0, 0.2), 0.1) == (0.0, 0.0)


def test_a_side_that_a_sonar_sees_only_slantwise_is_slow():
    zones = told(zones_of(), math.inf)
    assert zones.limited((0.0, 0.3), 0.0) == (0.0, ZONES.slow_m_s)


# -- laws


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


# -- settings


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


# -- on the emulated robot

STEP_S = 0.05
READY_S = 2.0
"""Before that the sonars have no readings."""


class Course:
    """A robot in zones, driven by a planner for some time: where it was, what it asked for, what was allowed."""

    def __init__(self, tmp_path, walls, planner, seconds, robot="traxbot"):
        file = tmp_path / "world.yaml"
        file.write_text(f"start: [0, 0, 0]\nwalls: {walls}\n")
        self._emulated = factory.make(factory.Options(robot=robot), world_file.load(str(file)))
        model = models.load(robot)
        kind = ZONES._replace(braking_m_s2=model.limits.linear_acceleration_m_s2)
        self._zones = Zones(kind, model.body, model.sonars)
        self.xs, self.ys, self.shares = [], [], []
        try:
            with SteppedDriver(self._emulated.engine) as self._robot:
                self._robot.on_telemetry(self._watch)
                while self._robot.now_s < seconds and not self._step(planner):
                    pass
        finally:
            self._emulated.close()

    def _watch(self, telemetry):
        for name in telemetry.fresh:
            self._zones.on_range(name, telemetry.ranges[name], self._robot.now_s)

    def _step(self, planner):
        robot = self._robot
        robot.wait(STEP_S)
        self._zones.moved(robot.twist[0] * STEP_S, robot.now_s, sum(robot.twist[2:]) * STEP_S)
        wanted = planner(robot)
        if wanted is None:
            return True
        allowed, left = self._zones.limited((wanted[0], sum(wanted[2:])), robot.now_s)
        robot.drive(allowed, wanted[1], left)
        self.xs.append(self._emulated.plant.true_pose.x_m)
        self.ys.append(self._emulated.plant.true_pose.y_m)
        self.shares.append(allowed / wanted[0] if wanted[0] and robot.now_s > READY_S else 1.0)
        return False


class Seeker:
    """A planner that is not told of the zones."""

    def __init__(self, goal):
        self._seeker = GoalSeeker(
            goal, Limits(0.3, 1.0, math.inf, math.inf), 0.0, models.load("traxbot").sonars
        )

    def __call__(self, robot):
        speeds = self._seeker.command(tuple(robot.pose)[:3], robot.ranges, robot.now_s)
        assert not self._seeker.blocked
        return None if self._seeker.reached else speeds


def test_a_robot_that_drives_at_a_wall_stops_before_it(tmp_path):
    xs = Course(tmp_path, "[[1.5, -2, 1.5, 2]]", lambda _: (0.3, 0.0), 15.0).xs
    room_m = 1.5 - FRONT_M - max(xs)
    assert ZONES.protective_m <= room_m < ZONES.protective_m + 0.06
    assert max(xs) - xs[-20] < 0.01


def test_a_robot_passes_a_door_that_is_just_wide_enough_slowly(tmp_path):
    """0.44 m wide, for a body of 0.2 m and what is to stay free beside it."""
    walls = "[[1.0, 0.22, 1.0, 2], [1.0, -0.22, 1.0, -2]]"
    course = Course(tmp_path, walls, lambda robot: (0.3, -robot.pose.yaw_rad), 20.0)
    assert course.xs[-1] > 1.5 and min(course.shares) < 0.8


def test_a_planner_that_asks_for_too_much_is_slowed_and_not_stuck(tmp_path):
    """Around a board in its way."""
    course = Course(tmp_path, "[[0.9, -0.1, 0.9, 0.1]]", Seeker((2.0, 0.0, 0.0)), 40.0)
    assert course.xs[-1] == pytest.approx(2.0, abs=0.05)
    assert min(course.shares) < 0.5 and max(map(abs, course.ys)) < 1.0


def test_three_wheels_stop_before_a_wall_beside_them(tmp_path):
    """Its sonars look 45 deg aside; what they see of the wall is nearer than the wall is."""
    ys = Course(tmp_path, "[[-2, 1, 2, 1]]", lambda _: (0.0, 0.0, 0.3), 20.0, "omni").ys
    room_m = 1.0 - models.load("omni").body.width_m / 2 - max(ys)
    assert ZONES.protective_m <= room_m < 0.5
    assert max(ys) - ys[-20] < 0.01 and max(ys) > 0.2
