"""The speed limiter: arcs, ramps, and slides of robots that move sideways."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.robot.models import Limits
from mrl_driver.safety.speed_limiter import SpeedLimiter, gentle_ramp, ramp

LIMITS = Limits(0.3, 1.0, 0.2, 1.0)
FRAME_S = 0.02
SPEEDS = st.floats(-2, 2)


class Bench:
    """A limiter with a clock of its own."""

    def __init__(self):
        self.now_s = 100.0
        self.limiter = SpeedLimiter()
        self.limiter.limits = LIMITS

    @property
    def speeds(self):
        return self.limiter.speeds

    def drive(self, *speeds):
        self.limiter.target = self.limiter.limited(speeds)
        return self.limiter.step(self.now_s)

    def tick(self):
        self.limiter.step(self.now_s)

    def run(self, seconds, linear=None, angular=0.0, *lateral):
        """Frames of the stream, with a command before each where there is one."""
        for _ in range(round(seconds / FRAME_S)):
            self.now_s += FRAME_S
            if linear is not None:
                self.drive(linear, angular, *lateral)
            self.tick()


@pytest.fixture
def bench():
    return Bench()


@pytest.mark.parametrize("again", [(0.3,), ()], ids=["repeated", "single command"])
def test_speeding_up_takes_as_long_as_the_limit_says(bench, again):
    bench.drive(0.3, 0.0)
    bench.run(1.0, *again)
    assert bench.speeds[0] == pytest.approx(0.2 * (1.0 + FRAME_S), abs=0.01)
    bench.run(0.6, *again)
    assert bench.speeds[0] == 0.3


@pytest.mark.parametrize(
    "before, linear, expected",
    [
        (lambda limiter: None, 0.05, 0.05),
        (lambda limiter: None, -0.3, -0.2 * FRAME_S),
        (lambda limiter: limiter.drop(), 0.3, 0.2 * FRAME_S),
    ],
    ids=["slowing down is not delayed", "reversing", "after a stop by the driver"],
)
def test_robot_that_reverses_or_was_stopped_starts_from_standstill(bench, before, linear, expected):
    bench.run(1.6, 0.3)
    before(bench.limiter)
    bench.now_s += FRAME_S
    bench.drive(linear, 0.0)
    assert bench.speeds == (pytest.approx(expected), 0.0)


@pytest.mark.parametrize(
    "speeds, expected", [((1e300, 0.0), 0.3), ((1e308, 0.0), 0), ((1.7e308, 0.0, 1.7e308), 0)]
)
def test_a_huge_speed_is_clamped_and_one_whose_scale_overflows_stands_still(bench, speeds, expected):
    bench.run(3.0, *speeds)
    assert bench.speeds[0] == pytest.approx(expected) and not any(bench.speeds[1:])


@pytest.mark.parametrize(
    "before, wanted, after",
    [
        ((0.0, 0.0), (0.3, 0.5), (0.2 * FRAME_S, 0.2 * FRAME_S * 5 / 3)),
        ((0.0, 0.0, 0.2), (0.2, 0.0, 0.0), (0.2 * FRAME_S, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.0, 1.0, 0.1), (0.0, 0.02, 0.002)),
    ],
    ids=[
        "the slower of way and turn decides",
        "a slide at right angles to the last one",
        "a slide that turns",
    ],
)
def test_a_step_of_the_ramp(before, wanted, after):
    assert ramp(before, wanted, LIMITS, FRAME_S) == pytest.approx(after)


@given(st.floats(-1, 1), st.floats(0.001, 1))
def test_speed_approaches_no_number_by_becoming_none(speed, dt_s):
    """Which the driver refuses."""
    assert math.isnan(ramp((speed, 0.0), (math.nan, 0.0), LIMITS, dt_s)[0])


@given(st.tuples(SPEEDS, SPEEDS), st.tuples(SPEEDS, SPEEDS), st.floats(0, 0.5))
def test_step_never_overshoots_and_never_delays_a_stop(before, wanted, dt_s):
    rises = (dt_s * LIMITS.linear_acceleration_m_s2, dt_s * LIMITS.angular_acceleration_rad_s2)
    ramped = ramp(before, wanted, LIMITS, dt_s)
    assert len(ramped) == 2
    for after, speed, target, rise in zip(ramped, before, wanted, rises):
        assert abs(after) <= abs(target) + 1e-12 and after * target >= 0
        assert abs(after) <= max(0.0, math.copysign(speed, speed * target)) + rise + 1e-12 or after == target
        assert abs(target) > abs(speed) or speed * target <= 0 or after == target


@given(SPEEDS, SPEEDS)
def test_robot_at_rest_speeds_up_on_the_commanded_arc(linear, angular):
    bench = Bench()
    bench.drive(linear, angular)
    for _ in range(100):
        forward, turn = bench.speeds
        assert forward * angular == pytest.approx(turn * linear, abs=1e-9)
        bench.now_s += FRAME_S
        bench.drive(linear, angular)


@pytest.mark.parametrize("linear", [0.3, 0.1])
def test_curve_does_not_slow_a_robot_that_drives_straight_nor_delay_its_braking(bench, linear):
    bench.run(1.6, 0.3)
    bench.run(FRAME_S, linear, 0.5)
    assert bench.speeds == (linear, pytest.approx(FRAME_S))


@given(SPEEDS, SPEEDS, SPEEDS)
def test_a_slide_keeps_direction_and_arc_within_the_limits(linear, angular, lateral):
    bench = Bench()
    for _ in range(200):
        bench.now_s += FRAME_S
        bench.drive(linear, angular, lateral)
    forward, turn, left = bench.speeds
    assert math.hypot(forward, left) <= 0.3 + 1e-12 and abs(turn) <= 1.0
    assert forward * lateral == pytest.approx(left * linear, abs=1e-9)
    assert forward * angular == pytest.approx(turn * linear, abs=1e-9)


def test_sideways_has_a_limit_of_its_own(bench):
    bench.limiter.limits = LIMITS._replace(lateral_m_s=0.1)
    for _ in range(200):
        bench.now_s += FRAME_S
        bench.drive(0.2, 0.4, 0.2)
    assert bench.speeds == pytest.approx((0.1, 0.2, 0.1))


def test_a_slide_may_follow_a_command_without_one(bench):
    """As when cmd_vel takes over from a pose that is sought; and the other way round."""
    bench.drive(0.1, 0.0)
    bench.now_s += FRAME_S
    bench.drive(0.1, 0.0, 0.1)
    forward, _, left = bench.speeds
    assert 0 < forward == left
    bench.now_s += FRAME_S
    bench.drive(0.1, 0.0)
    assert len(bench.speeds) == 2


def test_a_slide_speeds_up_as_the_limit_says_and_turns_its_direction_at_once(bench):
    bench.drive(0.0, 0.0, 0.3)
    assert bench.speeds == (0.0, 0.0, pytest.approx(0.2 * FRAME_S))
    for _ in range(50):
        bench.now_s += FRAME_S
        bench.tick() if bench.now_s < 100.3 else bench.drive(0.3, 0.0, 0.3)
    forward, _, left = bench.speeds
    assert forward == left == pytest.approx(0.2 / math.sqrt(2), rel=0.1)
    assert any(bench.speeds)
    bench.drive(0.0, 0.0, -0.3)
    assert abs(bench.speeds[2]) <= 0.2 * FRAME_S + 1e-12  # the other way it begins anew


def test_what_restricts_the_speeds_is_asked_with_every_frame(bench):
    """After a restriction the robot speeds up by the ramp."""
    bench.run(1.6, 0.3)
    bench.limiter.restrict = lambda speeds, now: (min(0.1, speeds[0]), speeds[1])
    bench.run(FRAME_S)
    assert bench.speeds == (0.1, 0.0)
    bench.limiter.restrict = None
    bench.run(FRAME_S)
    assert bench.speeds == (pytest.approx(0.1 + 0.2 * FRAME_S), 0.0)


TALL = LIMITS._replace(braking_m_s2=0.4, curve_m_s2=0.05)  # of a robot that may tip over


@given(*(st.tuples(SPEEDS, SPEEDS, SPEEDS),) * 2)
def test_no_command_moves_a_tall_robot_with_more_than_its_limits(before, wanted):
    """Whichever way it drives and is told to drive; and it gets there."""
    limiter = SpeedLimiter()
    limiter.limits = TALL
    before, wanted = limiter.limited(before), limiter.limited(wanted)
    for _ in range(300):
        after = gentle_ramp(before, wanted, TALL, FRAME_S)
        assert math.dist(after[::2], before[::2]) <= 0.4 * FRAME_S + 1e-9
        assert math.hypot(*after[::2]) * abs(after[1]) <= 0.05 + 1e-9
        before = after
    assert before == wanted


def test_a_tall_robot_speeds_up_and_brakes_on_its_arc_and_brakes_as_fast_while_a_turn_begins(bench):
    bench.limiter.limits = TALL._replace(curve_m_s2=0.0)
    bench.run(1.0, 0.3, 0.6)
    assert bench.speeds == pytest.approx((0.2, 0.4), abs=0.02)
    bench.run(1.0, 0.3, 0.6)
    bench.run(FRAME_S, 0.0, 0.0)
    assert bench.speeds == pytest.approx((0.3 - 0.4 * FRAME_S, 0.6 * (1 - 0.4 * FRAME_S / 0.3)))
    bench.run(FRAME_S, 0.0, -1.0)
    assert bench.speeds[0] == pytest.approx(0.3 - 2 * 0.4 * FRAME_S)


def test_an_acceleration_too_small_for_a_number_leaves_the_robot_where_it_is():
    assert ramp((0.0, 0.0), (0.3, 0.0), Limits(0.3, 1.0, 5e-324, 1.0), FRAME_S) == (0.0, 0.0)


def test_a_tall_robot_is_as_fast_in_a_curve_as_its_limit_allows(bench):
    bench.limiter.limits = LIMITS._replace(curve_m_s2=0.02)
    speed, turn = bench.limiter.limited((0.2, 0.4))
    assert (speed * turn, turn / speed) == pytest.approx((0.02, 2.0))


def test_a_tall_robot_brakes_in_a_slide_as_fast_as_straight_ahead():
    ahead, slide = (gentle_ramp(before, (0.0,) * 3, TALL, FRAME_S) for before in ((0.3, 0, 0), (0, 0, 0.3)))
    assert ahead[0] == slide[2] == pytest.approx(0.3 - 0.4 * FRAME_S)


def test_a_tall_robot_that_turns_on_the_spot_speeds_up_as_the_limit_says():
    assert gentle_ramp((0.0, 0.1), (0.3, 0.1), TALL, FRAME_S)[0] == pytest.approx(0.2 * FRAME_S)


@pytest.mark.parametrize("commanded", [0.3, 0.1], ids=["that drives", "that brakes"])
def test_what_restricts_a_tall_robot_takes_effect_at_once(bench, commanded):
    """Also if the command is slow enough, and the robot is not yet."""
    bench.limiter.limits = TALL
    bench.run(3.0, 0.3)
    bench.limiter.restrict = lambda speeds, now: (min(0.15, speeds[0]), speeds[1])
    bench.run(FRAME_S, commanded)
    assert bench.speeds == (0.15, 0.0)


def test_what_restricts_a_tall_robot_is_taken_away_once(bench):
    bench.limiter.limits = TALL
    bench.limiter.restrict = lambda speeds, now: (speeds[0] / 2, speeds[1])
    bench.run(3.0, 0.3)
    assert bench.speeds == (0.15, 0.0)


TIGHT = Limits(0.3, 2.0, 0.2, 1.0)  # Unlike 1, its limit of turning shows whether it divides or multiplies


def test_turn_that_ends_keeps_to_the_arc_while_the_robot_brakes():
    linear_m_s, angular_rad_s = gentle_ramp((0.1, 0.5), (0.0, 0.0), TALL, FRAME_S)
    assert angular_rad_s == pytest.approx(5 * linear_m_s)


@pytest.mark.parametrize(
    "limits, wanted, speeds",
    [
        (LIMITS, (0.1, 2.0), (0.05, 1.0)),
        (LIMITS, (0.6, 0.5), (0.3, 0.25)),
        (LIMITS, (0.3, 1.0), (0.3, 1.0)),
        (LIMITS, (-0.6, 0.0), (-0.3, 0.0)),
        (LIMITS, (0.1, 0.2, 0.1), (0.1, 0.2, 0.1)),
        (TIGHT, (0.2, 4.0), (0.1, 2.0)),
    ],
)
def test_either_speed_beyond_its_limit_scales_both(bench, limits, wanted, speeds):
    bench.limiter.limits = limits
    assert bench.limiter.limited(wanted) == pytest.approx(speeds)


def test_new_limits_lower_the_command_in_force(bench):
    bench.limiter.change(TIGHT)
    assert (bench.limiter.limits, bench.limiter.target) == (TIGHT, None)
    bench.run(2.0, 0.3)
    bench.limiter.change(LIMITS._replace(linear_m_s=0.1))
    bench.tick()
    assert bench.speeds == (0.1, 0.0)
    bench.limiter.change(LIMITS)
    bench.run(FRAME_S)
    assert bench.speeds == (0.1, 0.0), "only a new command is faster"


def test_after_a_pause_a_step_accelerates_for_a_tenth_of_a_second(bench):
    bench.run(0.2, 0.3)
    before = bench.speeds[0]
    bench.now_s += 0.5
    bench.tick()
    assert bench.speeds[0] == pytest.approx(before + 0.2 * 0.1)


def test_a_step_at_a_time_before_the_last_one_takes_no_time(bench):
    """A thread that read the clock earlier may step later."""
    bench.run(1.0, 0.3)
    bench.limiter.target = (0.1, 0.0)
    bench.limiter.step(bench.now_s - 1e-6)
    assert bench.speeds == (0.1, 0.0)


@pytest.mark.parametrize("speed_m_s", [0.6, -0.6, 1e300])
def test_what_restricts_the_speeds_does_not_raise_them_above_the_limits(bench, speed_m_s):
    bench.limiter.restrict = lambda speeds, now: (speed_m_s, 0.0)
    bench.run(3.0, 0.1)
    assert bench.speeds == (math.copysign(0.3, speed_m_s), 0.0)
