"""Odometry to the count, its heading with a gyro, and the plane geometry below both."""

import math
import random
import statistics

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.geometry import ORIGIN, Pose, advance, quaternion_of, wrap_angle, wrap_angles, yaw_of
from mrl_driver.robot.covariance import AT_START, TWIST_INTERVAL_S
from mrl_driver.robot.heading import (
    BIAS_WALK,
    FILTER_DELAY_S,
    HOLD_S,
    SILENT_S,
    STAND_S,
    STEADY_RAD_S,
    ZERO_RATE_RAD_S,
    HeadingFilter,
    KnownBias,
)
from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import SLACK_S, Baseline, Odometry, Twist, fastest_wheel_m_s
from mrl_driver.robot.wheel_odometry import WheelOdometry

DRIVE = load("traxbot").drive
COUNT_M = DRIVE.metres_per_count
UNEQUAL = DRIVE._replace(wheel_offset=0.2)
FASTEST_M_S = fastest_wheel_m_s(0.65, 5.0, DRIVE.wheel_separation_m)
PERIOD_S = 0.02
WRAP_S = 32.768  # In this time a wheel of 1000 counts/s covers half the range of its counter
int16 = st.integers(-32768, 32767)


def as_int16(count):
    return ((int(count) + 0x8000) & 0xFFFF) - 0x8000


def after(*readings, exact=True, drive=DRIVE, coast_s=None):
    """Odometry after readings (right, left, time), or (both, time)."""
    odometry = Odometry(drive, FASTEST_M_S, exact)
    if coast_s is not None:
        odometry.baseline.coast_s = coast_s
    for *counts, time_s in readings:
        odometry.update(counts[0], counts[-1], time_s)
    return odometry


def steadily(*counts):
    return [(count, i * PERIOD_S) for i, count in enumerate(counts)]


@given(int16, st.integers(-2000, 2000))
def test_movement_is_the_difference_of_counters_that_may_wrap(start, moved):
    baseline = Baseline(COUNT_M, FASTEST_M_S, 0.002)
    assert baseline.update(start, start, 0.0) is None
    assert baseline.update(as_int16(start + moved), as_int16(start - moved), 1.0) == (moved, -moved, 1.0)


def test_first_reading_primes_and_the_second_integrates():
    odometry = Odometry(DRIVE, FASTEST_M_S)
    assert odometry.update(1000, 1000, 0.0) is False and odometry.pose == ORIGIN
    odometry.update(1100, 1100, 0.1)
    assert odometry.pose == pytest.approx((100 * COUNT_M, 0, 0))


@pytest.mark.parametrize("period_s", [0.1, 0.001])
def test_twist_comes_from_the_time_given(period_s):
    """With board time each reading has its speed, however near."""
    odometry = after((0, 0, 0.0), (10, 5, period_s))
    assert odometry.twist.linear_m_s == pytest.approx(7.5 * COUNT_M / period_s)
    assert odometry.twist.angular_rad_s == pytest.approx(5 * COUNT_M / DRIVE.wheel_separation_m / period_s)


@pytest.mark.parametrize("exact", [True, False])
def test_no_time_between_readings_makes_no_spike(exact):
    """A burst after a pause arrives all at once."""
    assert after((0, 0.0), (2, 0.0), exact=exact).twist == (0.0, 0.0)


def test_the_counter_wrap_moves_nothing_extra():
    odometry = after((32767, -32768, 0.0), (-32768, -32767, PERIOD_S))
    assert odometry.pose == pytest.approx((COUNT_M, 0.0, 0.0))


def test_an_impossible_reading_is_refused_and_the_next_good_one_bridges_it():
    odometry = after(*steadily(0, 20, 9000, 60))
    assert odometry.baseline.refused == 1
    assert odometry.pose.x_m == pytest.approx(60 * COUNT_M)


@pytest.mark.parametrize("count", [1000, 2000])
@pytest.mark.parametrize("exact", [True, False])
def test_counters_that_start_from_zero_again_move_nothing(count, exact):
    """A board that goes on streaming after its restart, with little on its counters."""
    before, again = (count + 60 * i for i in range(10)), (60 * i for i in range(10))
    moved_m = after(*steadily(*before, *again), exact=exact).pose.x_m
    assert 0 <= moved_m - 9 * 60 * COUNT_M <= 10 * 60 * COUNT_M


def test_readings_that_disagree_make_no_baseline():
    baseline = Baseline(COUNT_M, FASTEST_M_S, 0.0)
    baseline.update(0, 0, 0.0)
    for i, count in enumerate([9000, -9000, 15000, -15000, 20000]):
        assert baseline.update(count, count, (i + 1) * 1e-3) is None
    assert baseline.update(1, 1, 6e-3) == (1, 1, 6e-3)


@given(st.lists(st.tuples(int16, int16, st.floats(0, 1)), max_size=40))
def test_no_reading_moves_the_robot_faster_than_its_wheels(readings):
    """Whatever the wire says, no accepted step exceeds what the wheels can do in its time."""
    baseline = Baseline(COUNT_M, FASTEST_M_S, 0.0)
    time_s = 0.0
    for right, left, dt_s in readings:
        time_s += dt_s
        step = baseline.update(right, left, time_s)
        if step is not None:
            right, left, dt_s = step
            assert max(abs(right), abs(left)) * COUNT_M <= FASTEST_M_S * dt_s + 4 * COUNT_M


def test_unequal_wheels_and_slip_turn_as_calibrated():
    """Right wheel 1 % larger, a tenth of each turn lost: 5000 counts each, and 5000 counts of the right one more."""
    drive = DRIVE._replace(wheel_offset=0.01, turn_slip=0.1)
    odometry = after((0, 0.0), (5000, 1.0), drive=drive)
    kept_rad_per_m = 0.9 / DRIVE.wheel_separation_m
    assert odometry.pose.yaw_rad == pytest.approx(5000 * COUNT_M * 0.01 * kept_rad_per_m)
    assert math.hypot(*odometry.pose[:2]) == pytest.approx(5000 * COUNT_M, rel=1e-3)
    before = odometry.pose.yaw_rad
    odometry.update(10000, 5000, 2.0)
    turned = 5000 * COUNT_M * 1.005 * kept_rad_per_m
    assert wrap_angle(odometry.pose.yaw_rad - before) == pytest.approx(wrap_angle(turned))


@pytest.mark.parametrize(
    "exact, readings, counts",
    [
        (True, [(196, 0.0), (198, 0.003), (600, 0.006), (202, 0.009), (204, 0.012)], 8),
        (False, [(196, 0.0), (198, 0.003), (600, 0.006), (202, 0.009), (204, 0.012)], 8),
        (False, [(196, 0.0), (198, 0.003), (900, 0.053), (202, 0.056), (204, 0.059)], 8),
        (False, [(5000, 0.0), (5600, 0.001), (5602, 0.002), (5604, 0.003), (5606, 0.004)], 606),
        (False, [(5000, 0.0), *((25000 + 2 * i, 0.001 + 0.003 * i) for i in range(4))], 2),
        (False, [(5000, 0.0), *((15000 + 2 * i, 60.0 + 0.003 * i) for i in range(4))], 2),
    ],
    ids=[
        "one wrong count near zero looks like a restart",
        "the same without board time",
        "one wrong count after a pause",
        "frames lost from a burst are bridged once they are confirmed",
        "a confirmed jump that no wheel can make",
        "a confirmed jump that may have wrapped",
    ],
)
def test_a_jump_moves_the_robot_only_if_the_wheels_can_have_made_it(exact, readings, counts):
    assert after(*readings, exact=exact).pose.x_m == pytest.approx(counts * COUNT_M)


@pytest.mark.parametrize("coast_s, used", [(1.25, True), (0.5, False)])
def test_a_gap_after_which_the_wheels_must_have_stood_is_bridged_as_far_as_they_can_coast(coast_s, used):
    odometry = after((30000, 0.0), (as_int16(50000), 60.0), coast_s=coast_s)
    assert odometry.pose.x_m == pytest.approx(20000 * COUNT_M * used)


def test_each_new_baseline_is_counted():
    odometry = after(*steadily(0, 10, 9000, 9001, 9002, 9003))
    odometry.reset()
    odometry.update(5, 5, 1.0)
    assert odometry.baseline.primed == 3


def baseline(exact, *readings):
    """Of wheels that make 1000 counts/s at most, after readings of both wheels (right, left, time)."""
    made = Baseline(1.0, 1000.0, SLACK_S[exact])
    for reading in readings:
        made.update(*reading)
    return made


START = (0, 0, 0.0)


@pytest.mark.parametrize(
    "exact, dt_s, most",
    [(True, 0.1, 105), (True, 0.0, 5), (False, 0.1, 103), (False, 0.0, 23)],
    ids=["board time", "board time, none", "arrival", "burst"],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_a_wheel_moves_as_far_as_its_speed_and_the_errors_of_reading_allow(exact, dt_s, most, sign):
    assert baseline(exact, START).update(0, sign * most, dt_s) == (0, sign * most, dt_s)
    assert baseline(exact, START).update(0, sign * (most + 1), dt_s) is None


def test_after_a_gap_in_which_a_counter_may_have_wrapped_even_no_movement_is_unknown():
    assert baseline(True, START).update(0, 0, WRAP_S - 0.001) is not None
    assert baseline(True, START).update(0, 0, WRAP_S) is None


@pytest.mark.parametrize(
    "before, now, step, baselines",
    [
        ((5000, 5000, 0.0), (5100, 5000, 0.0), (100, 0, 0.0), 1),
        ((5000, 5000, 0.0), (5101, 5000, 0.0), None, 2),
        ((80, 80, 0.0), (23, 23, 0.0), None, 2),
        ((80, 80, 0.0), (24, 24, 0.0), (-56, -56, 0.0), 1),
        ((60, 5000, 0.0), (10, 5050, 0.0), (-50, 50, 0.0), 1),
        ((-60, -60, 0.0), (10, 10, 0.0), None, 2),
        ((5000, 5000, 0.0), (5150, 5000, 0.05), (150, 0, 0.05), 1),
        ((60, 60, 0.0), (32760, 32760, WRAP_S - SLACK_S[False]), None, 2),
    ],
    ids=[
        "as far as in the slack",
        "farther",
        "near zero: a restart",
        "not near zero",
        "a restart zeroes both counters",
        "near zero from below",
        "as far as in slack and time",
        "it may have wrapped",
    ],
)
def test_a_jump_that_three_readings_confirm_is_integrated_or_a_new_baseline(before, now, step, baselines):
    made = baseline(False, before, now, now)
    assert (made.update(*now), made.primed) == (step, baselines)


@pytest.mark.parametrize(
    "before, now, dt_s, restarted",
    [
        ((300, -280), (23, -23), 1.0, True),
        ((-27, -5), (23, 20), 1.0, True),
        ((300, -280), (24, -23), 1.0, False),
        ((26, 26), (23, 20), 1.0, False),
        ((10, 10), (20, 20), 1.0, False),
        ((80, 80), (20, 20), 0.062, False),
        ((80, 80), (20, 20), 0.063, True),
    ],
    ids=[
        "near zero",
        "from the other side",
        "not near zero",
        "no nearer than a reading may err",
        "farther than before",
        "without a gap",
        "after the shortest gap",
    ],
)
def test_counters_that_are_near_zero_after_a_gap_may_have_begun_again(before, now, dt_s, restarted):
    """As those of a motor board whose power was off: the wheels could have turned back in that time."""
    made = baseline(True, (*before, 0.0))
    for i in range(3):
        made.update(*now, dt_s + i * 1e-3)
    assert made.primed == 1 + restarted and (made.refused == 3) is restarted


@pytest.mark.parametrize("dt_s, restarted", [(0.16, False), (0.161, True)])
def test_without_board_time_a_gap_is_longer_than_a_burst(dt_s, restarted):
    made = baseline(False, (80, 80, 0.0))
    assert (made.update(0, 0, dt_s) is None) is restarted


@pytest.mark.parametrize("count, used", [(123, True), (124, False)])
def test_a_way_back_is_as_near_to_the_reading_before_as_a_step(count, used):
    made = baseline(False, (100, 100, 0.0), (80, 80, 0.0))
    assert (made.update(count, count, 0.0) is not None) is used


def test_a_reading_of_before_a_new_baseline_is_no_way_back():
    made = baseline(False, (5000, 5000, 0.0), (5002, 5002, 0.0), *[START] * 3)
    assert made.primed == 2 and made.update(5004, 5004, 0.0) is None


class Heard:
    """A heading filter and an uncertainty that keep what they are told."""

    in_use = True

    def __init__(self):
        self.rolled, self.resets, self.moved, self.stood = [], [], [], []

    def turn(self, time_s, turn, rolled):
        self.rolled.append(rolled)
        return turn

    def reset(self, *spread):
        self.resets.append(spread)

    def update(self, before, pose, wheels_m, turn, dt_s, gyro):
        self.moved.append((before, wheels_m, dt_s, gyro))

    def stand(self, dt_s, gyro):
        self.stood.append((dt_s, gyro))


def told(part, *counts, drive=DRIVE):
    """Odometry after readings 20 ms apart, and what this part of it heard."""
    odometry, heard = Odometry(drive, 2.0), Heard()
    setattr(odometry, part, heard)
    for i, (right, left) in enumerate(counts):
        odometry.update(right, left, i * PERIOD_S)
    return odometry, heard


@pytest.mark.parametrize("side", [(1, 0), (0, 1)], ids=["right", "left"])
def test_a_wheel_has_rolled_if_it_has_left_its_place_by_more_than_one_count(side):
    places = (0, 1, -1, 0, 2, 3, 1, 2, 0)
    _, heard = told("heading", *[(n * side[0], n * side[1]) for n in places])
    assert heard.rolled == [False, False, False, True, False, False, False, True]


@pytest.mark.parametrize("counts", [(30, 0), (0, 20), (30, 20)])
def test_the_uncertainty_is_told_the_way_of_each_wheel(counts):
    odometry, heard = told("uncertainty", (9, 4), (9 + counts[0], 4 + counts[1]), drive=UNEQUAL)
    before, wheels_m, dt_s, gyro = heard.moved[0]
    assert odometry.travel == counts
    assert wheels_m == pytest.approx(
        (counts[0] * UNEQUAL.right_m_per_count, counts[1] * UNEQUAL.left_m_per_count)
    )
    assert (before, dt_s, gyro, heard.stood) == (ORIGIN, PERIOD_S, None, [])


def test_the_uncertainty_is_told_that_the_wheels_stand():
    _, heard = told("uncertainty", (5, 5), (5, 5))
    assert (heard.moved, heard.stood) == ([], [(PERIOD_S, None)])


def test_a_turn_on_standing_wheels_makes_the_pose_less_sure():
    """As of a robot that is carried."""
    odometry, heard = told("uncertainty", (5, 5))
    odometry.heading = Heard()
    odometry.heading.turn = lambda time_s, turn, rolled: 0.1
    odometry.update(5, 5, PERIOD_S)
    assert (heard.moved, heard.stood) == ([(ORIGIN, (0, 0), PERIOD_S, odometry.heading)], [])


def test_a_new_pose_has_the_covariance_given():
    odometry, heard = told("uncertainty", (0, 0), (30, 30))
    odometry.set_pose(Pose(1.0, 2.0, 0.5))
    assert (odometry.pose, heard.resets) == (Pose(1.0, 2.0, 0.5), [(AT_START,)])
    odometry.uncertainty = None
    odometry.set_pose(ORIGIN)
    assert odometry.pose == ORIGIN


def test_after_a_restart_pose_stays_speeds_are_zero_and_the_gyro_begins_anew():
    odometry, heard = told("heading", (0, 0), (30, 20))
    pose = odometry.pose
    assert odometry.twist != (0.0, 0.0)
    odometry.reset()
    assert (odometry.twist, heard.resets) == ((0.0, 0.0), [()])
    odometry.update(0, 0, 0.2)
    assert odometry.pose == pose


@pytest.mark.parametrize("reset, share", [(False, 1.0), (True, 0.5)])
def test_speeds_of_readings_that_are_too_close_are_those_of_their_sum(reset, share):
    """The last two arrive at once, half an interval before a third one; those of before a restart do not count."""
    odometry = after((0, 0, 0.0), (6, 2, TWIST_INTERVAL_S / 2), drive=UNEQUAL, exact=False)
    if reset:
        odometry.reset()
        odometry.update(6, 2, TWIST_INTERVAL_S / 2)
    odometry.update(12, 4, 2 * TWIST_INTERVAL_S)
    dt_s = (1.5 if reset else 2.0) * TWIST_INTERVAL_S
    right_m, left_m = 12 * share * UNEQUAL.right_m_per_count, 4 * share * UNEQUAL.left_m_per_count
    assert odometry.twist.linear_m_s == pytest.approx((right_m + left_m) / 2 / dt_s)
    angular_rad_s = (right_m - left_m) / UNEQUAL.turning_separation_m / dt_s
    assert odometry.twist.angular_rad_s == pytest.approx(angular_rad_s)


def test_wheels_prevent_a_speed_to_the_left_and_have_a_ceiling():
    """Both ceilings together, and half as much."""
    assert Twist(0.2, 1.0).lateral_m_s == 0.0
    assert fastest_wheel_m_s(0.5, 2.0, 0.2) == pytest.approx(1.5 * (0.5 + 0.2))


BIAS_RAD_S = 0.05
NOISE_RAD_S = 0.0007  # Noise of one reading: 0.005 deg/s/sqrt(Hz) at 50 Hz
SLIP = 0.1


class Robot:
    """Turns as told; its wheels claim more than it turns, and its gyro has bias and noise."""

    def __init__(self, seed=0, slip=SLIP, bias_rad_s=BIAS_RAD_S):
        self.filter, self.time_s, self.slip, self.bias_rad_s = HeadingFilter(), 0.0, slip, bias_rad_s
        self.true_rad = self.fused_rad = self.wheels_rad = 0.0
        self.turns = []
        self._rng = random.Random(seed)

    def go(self, rate_rad_s, seconds, gyro=True, wheels=True):
        """Turns at this rate; `gyro`: readings arrive; `wheels`: it is the wheels that turn it."""
        for _ in range(round(seconds / PERIOD_S)):
            self.time_s += PERIOD_S
            turn = rate_rad_s * PERIOD_S
            self.true_rad += turn
            by_wheels = turn / (1 - self.slip) if wheels else 0.0
            self.wheels_rad += by_wheels
            self.turns.append(self.filter.turn(self.time_s, by_wheels, by_wheels != 0.0))
            self.fused_rad += self.turns[-1]
            if gyro:
                self.read(rate_rad_s)

    def read(self, rate_rad_s):
        noise = self._rng.gauss(0.0, NOISE_RAD_S)
        self.filter.on_imu(self.time_s + FILTER_DELAY_S, rate_rad_s + self.bias_rad_s + noise)

    @property
    def off_rad(self):
        return self.fused_rad - self.true_rad


@pytest.fixture
def robot():
    """A robot that has stood long enough to know its bias."""
    robot = Robot()
    robot.go(0.0, 2.0)
    return robot


def test_a_robot_that_moves_from_the_start_uses_its_wheels_until_it_has_stood():
    robot = Robot()
    robot.go(0.5, 2.0)
    assert robot.fused_rad == pytest.approx(robot.wheels_rad)
    assert not robot.filter.in_use and not robot.filter.bias_known
    robot.go(0.0, STAND_S + 2 * PERIOD_S)
    learned_sd = robot.filter.bias_sd_rad_s
    assert robot.filter.bias_known
    assert robot.filter.bias_rad_s == pytest.approx(BIAS_RAD_S, abs=4 * learned_sd)
    robot.go(0.0, 5.0)
    surer = robot.filter.bias_sd_rad_s
    robot.go(0.3, 60.0)
    assert surer < learned_sd and robot.filter.bias_sd_rad_s > surer


def test_each_stand_measures_the_bias_as_a_scalar_kalman_filter_does():
    made, bias_rad_s, variance, time_s, learned_s, kept = (
        HeadingFilter(),
        0.0,
        ZERO_RATE_RAD_S**2,
        0.0,
        0.0,
        1.0,
    )
    assert (made.bias_sd_rad_s, made.unseen_rad2, made.in_use) == (ZERO_RATE_RAD_S, 0.0, False)
    noise_rad2_s = 0.0
    for mean_rad_s, swing_rad_s, share in ((0.05, 0.002, 1.0), (0.052, 0.004, 0.1)):
        known, rates = made.bias_rad_s, []
        while made.bias_rad_s == known:
            time_s += PERIOD_S
            rates.append(mean_rad_s + swing_rad_s * (-1) ** len(rates))
            made.turn(time_s, 0.0, False)
            made.on_imu(time_s + FILTER_DELAY_S, rates[-1])
        prior = variance + BIAS_WALK**2 * (time_s - learned_s)
        of_mean = statistics.variance(rates) / len(rates)
        gain = prior / (prior + of_mean)
        bias_rad_s += gain * (statistics.mean(rates) - bias_rad_s)
        variance, learned_s, kept = (1 - gain) * prior, time_s, (1 - gain) * kept
        assert (*made.known_bias[:2], made.kept) == pytest.approx((bias_rad_s, variance, kept), rel=1e-6)
        noise_rad2_s += share * (statistics.variance(rates) * PERIOD_S - noise_rad2_s)
        assert made.noise_rad2_s == pytest.approx(noise_rad2_s, rel=1e-6)


def test_ten_quarter_turns_with_slip_are_right(robot):
    """A standing robot does not turn; readings twice and out of order change nothing."""
    before = robot.fused_rad
    robot.go(0.0, 60.0)
    assert robot.fused_rad == before and robot.filter.unseen_rad2 < 1e-8
    for _ in range(10):
        robot.go(math.pi / 2, 1.0)
        robot.read(math.pi / 2)
        robot.filter.on_imu(robot.time_s - 0.05, 5.0)
        robot.go(0.0, 1.0)
    assert robot.wheels_rad - robot.true_rad > 1.5
    assert robot.filter.in_use
    assert abs(robot.off_rad) < math.radians(0.1)


def test_a_robot_that_is_carried_turns_and_learns_nothing(robot):
    """Standing wheels, and a quick turn by hand there and back."""
    bias_rad_s = robot.filter.bias_rad_s
    robot.go(0.8, 1.0, wheels=False)
    assert robot.fused_rad == pytest.approx(0.8, abs=0.03)
    assert robot.filter.bias_rad_s == bias_rad_s


@pytest.mark.parametrize("shaken_rad_s", [0.0, 0.2])
def test_motion_too_fast_for_the_readings_makes_the_yaw_less_sure(robot, shaken_rad_s):
    for step in range(22):
        if step == 2:
            robot.filter.unseen_rad2 = 0.0
        robot.go(0.5 + shaken_rad_s * (-1) ** step, PERIOD_S)
    bend_rad = 4 * shaken_rad_s * PERIOD_S
    assert robot.filter.unseen_rad2 == pytest.approx(20 * 0.09 * bend_rad**2, rel=0.05, abs=1e-8)


def test_a_turn_as_steady_as_a_bias_is_a_turn_for_five_seconds(robot):
    """Beyond that, no hand turns so evenly: the chip's bias has shifted."""
    robot.go(2 * STEADY_RAD_S, 4.0, wheels=False)
    assert robot.fused_rad == pytest.approx(8 * STEADY_RAD_S, rel=0.1)
    assert robot.filter.bias_rad_s == pytest.approx(BIAS_RAD_S, abs=STEADY_RAD_S / 10)
    robot.go(2 * STEADY_RAD_S, 4.0, wheels=False)
    assert robot.filter.bias_rad_s == pytest.approx(BIAS_RAD_S + 2 * STEADY_RAD_S, abs=STEADY_RAD_S / 10)


@pytest.mark.parametrize("restarts", [False, True])
def test_a_shifted_bias_is_not_learned_before_ten_stands_have_shown_it(robot, restarts):
    before = robot.filter.bias_rad_s
    if restarts:
        robot.filter.reset()
    robot.go(2 * STEADY_RAD_S, 10.5 * (STAND_S + PERIOD_S), wheels=False)
    assert robot.filter.bias_rad_s == before


@pytest.mark.parametrize("share, learned", [(0.97, True), (1.03, False)])
def test_a_rate_of_more_than_four_standard_deviations_from_the_bias_is_a_turn(share, learned):
    made, prior, noise = HeadingFilter(), 0.003**2, 0.004
    made.resume(KnownBias(0.0, prior, 0.0))
    rate_rad_s = share * 4 * math.sqrt(prior + noise**2 * PERIOD_S / STAND_S)
    for step in range(27):
        made.turn(step * PERIOD_S, 0.0, False)
        made.on_imu(step * PERIOD_S + FILTER_DELAY_S, rate_rad_s + noise * (-1) ** step)
    assert (made.bias_rad_s > 0.0) is learned


def test_a_bias_of_before_is_used_without_a_stand(robot):
    again, known = Robot(), robot.filter.known_bias
    again.filter.resume(known)
    assert again.filter.known_bias == known
    again.go(0.5, 1.0)
    assert again.filter.in_use and again.off_rad == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("bias_rad_s, shaken_rad_s", [(1.1 * ZERO_RATE_RAD_S, 0.0), (BIAS_RAD_S, 0.02)])
def test_a_rate_that_no_bias_has_or_of_a_shaken_robot_is_never_learned(bias_rad_s, shaken_rad_s):
    robot = Robot(bias_rad_s=bias_rad_s)
    for _ in range(20):
        robot.go(shaken_rad_s, 0.1, wheels=False)
        robot.go(-shaken_rad_s, 0.1, wheels=False)
    assert not robot.filter.bias_known


@pytest.mark.parametrize("lost_s", [0.06, SILENT_S + PERIOD_S, 3.0])
def test_readings_that_do_not_come_are_replaced_by_the_wheels(robot, lost_s):
    """A gap costs the slip of its time, and no turn is counted twice or lost."""
    robot.go(1.0, 1.0)
    robot.go(1.0, lost_s, gyro=False)
    robot.go(1.0, 1.0)
    robot.go(0.0, 1.0)
    assert -0.01 < robot.off_rad < (lost_s + 2 * PERIOD_S) * SLIP / (1 - SLIP) + 0.01


def test_lost_readings_end_the_use_of_the_gyro_at_once_and_a_silence_after_a_while(robot):
    robot.go(0.5, SILENT_S + 2 * PERIOD_S, gyro=False)
    assert not robot.filter.in_use
    robot.go(0.5, 3 * PERIOD_S)
    assert robot.filter.in_use
    robot.filter.lose()
    assert not robot.filter.in_use
    robot.go(0.5, 1.0, gyro=False)
    assert robot.turns[-1] == pytest.approx(0.5 * PERIOD_S / (1 - SLIP))


def test_bias_outlives_a_restart_of_the_board_with_more_doubt(robot):
    before = robot.filter.bias_rad_s, robot.filter.bias_variance
    robot.filter.reset()
    assert robot.filter.bias_rad_s == before[0]
    assert robot.filter.bias_variance == pytest.approx(before[1] + BIAS_WALK**2 * 60.0)
    robot.time_s, robot.fused_rad, robot.true_rad = 0.0, 0.0, 0.0
    robot.go(1.0, 2.0)
    robot.go(0.0, 1.0)
    assert abs(robot.off_rad) < 0.01 + PERIOD_S * 3 * SLIP


def test_board_time_that_begins_again_without_notice_turns_nothing(robot):
    robot.go(1.0, 1.0)
    sure, before = robot.filter.bias_sd_rad_s, robot.off_rad
    robot.time_s = 0.0
    robot.go(1.0, 0.1)
    assert robot.filter.bias_sd_rad_s > sure
    robot.go(1.0, 1.9)
    robot.go(0.0, 1.0)
    assert robot.filter.in_use
    assert abs(robot.off_rad - before) < 0.03


def test_nothing_is_learned_while_the_wheels_are_not_heard():
    """Time before and after does not add up: the wheels may have moved between."""
    robot = Robot()
    robot.go(0.0, STAND_S - SILENT_S - 2 * PERIOD_S)
    for _ in range(100):
        robot.time_s += PERIOD_S
        robot.read(0.0)
    robot.go(0.0, 4 * PERIOD_S)
    assert not robot.filter.bias_known


def test_a_robot_that_stops_with_its_readings_turns_on_for_at_most_the_hold(robot):
    robot.go(1.0, 1.0)
    before = robot.off_rad
    robot.go(0.0, SILENT_S - PERIOD_S, gyro=False)
    assert robot.off_rad - before < HOLD_S + 0.01


def test_gap_in_the_counts_is_filled_by_the_gyro(robot):
    """Counts that are lost for half a second: the turn of that time is the gyro's."""
    for _ in range(25):
        robot.time_s += PERIOD_S
        robot.read(1.0)
    robot.true_rad += 0.5
    robot.fused_rad += robot.filter.turn(robot.time_s, 0.5 / (1 - SLIP), True)
    robot.go(0.0, 0.5)
    assert abs(robot.off_rad) < 0.03


EVENTS = st.lists(st.tuples(st.sampled_from(["go", "silent", "lose", "jump"]), st.floats(-1, 1)), max_size=30)


@settings(max_examples=50)
@given(EVENTS)
def test_no_turn_is_larger_than_what_wheels_or_gyro_can_have_turned(events):
    """Whatever comes and goes, an increment is that of one period, with at most the correction of the hold."""
    robot = Robot()
    robot.go(0.0, 1.0)
    for event, rate in events:
        if event == "lose":
            robot.filter.lose()
        elif event == "jump":
            robot.time_s += 5.0
        else:
            robot.go(rate, 0.1, gyro=event == "go")
    assert max(map(abs, robot.turns)) <= HOLD_S + 2 * PERIOD_S


def with_gyro(kind=Odometry, name="traxbot"):
    odometry = kind(load(name).drive, 2.0)
    odometry.heading = HeadingFilter()
    return odometry


def stand(odometry, seconds, counts=lambda step: (0, 0), rate_rad_s=BIAS_RAD_S):
    """The odometry after readings of the counters and of a gyro from time 0 on."""
    for step in range(round(seconds / PERIOD_S)):
        odometry.update(*counts(step)[:2], step * PERIOD_S, *counts(step)[2:])
        odometry.heading.on_imu(step * PERIOD_S + FILTER_DELAY_S, rate_rad_s)
    return odometry


@pytest.mark.parametrize("kind, name, still", [(Odometry, "traxbot", ()), (WheelOdometry, "omni", (0,))])
def test_pose_has_the_way_of_the_wheels_and_the_turn_of_the_gyro(kind, name, still):
    """Wheels that claim to go straight, or one of three to stand, on a robot that turns to the left."""
    odometry = stand(with_gyro(kind, name), 1.0, lambda step: (0, 0, *still))
    for step in range(50):
        time_s = 1.0 + step * PERIOD_S
        odometry.update(50 * step, 50 * step if not still else -50 * step, time_s, *still)
        odometry.heading.on_imu(time_s + FILTER_DELAY_S, BIAS_RAD_S + 0.5)
    assert odometry.pose.yaw_rad == pytest.approx(0.5, abs=0.03)
    assert odometry.twist.angular_rad_s == pytest.approx(0.5, rel=0.01)
    assert still or odometry.pose.y_m == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize(
    "counts, stands",
    [
        (lambda step: (step // 4, 0), False),
        (lambda step: (0, step // 4), False),
        (lambda step: (step // 4, -(step // 4)), False),
        (lambda step: (step % 2, 0), True),
    ],
    ids=["right", "left", "both", "counter between two values"],
)
def test_slow_wheel_is_not_a_standing_one(counts, stands):
    odometry = stand(with_gyro(), 2.0, counts)
    assert odometry.heading.bias_known == stands
    assert not stands or odometry.pose.yaw_rad == pytest.approx(0.0, abs=1e-3)


angles = st.floats(-1e4, 1e4)
places = st.floats(-5, 5)
poses = st.builds(Pose, places, places, angles.map(wrap_angle))


@given(angles)
def test_wrapped_angle_is_the_same_direction_in_range(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0, abs=1e-9)


@given(st.lists(angles))
def test_an_array_is_wrapped_as_each_of_its_angles(some):
    turned = wrap_angles(np.array(some)) - [wrap_angle(angle) for angle in some]
    assert np.cos(turned) == pytest.approx(1.0, abs=1e-9)


def test_wrapping_keeps_plus_pi():
    assert wrap_angle(-math.pi) == math.pi
    assert list(wrap_angles(np.array([-math.pi, math.pi, 0.0]))) == [math.pi, math.pi, 0.0]


def test_a_pose_composes_with_one_in_its_own_frame():
    found = Pose(2.0, 3.0, math.pi / 2).compose(1.0, 0.0, 0.5)
    assert found == pytest.approx((2.0, 4.0, math.pi / 2 + 0.5))


@given(poses, poses)
def test_relative_to_is_the_inverse_of_compose(origin, pose):
    found = origin.compose(*pose.relative_to(origin))
    assert found[:2] == pytest.approx(pose[:2], abs=1e-9)
    assert wrap_angle(found.yaw_rad - pose.yaw_rad) == pytest.approx(0.0, abs=1e-9)


@given(st.floats(-2, 2), st.floats(-6, 6), st.integers(1, 50), st.floats(-2, 2))
def test_an_arc_is_the_sum_of_its_pieces(forward, turn, pieces, left):
    """Exact arcs compose: the size of the steps does not matter."""
    pose = ORIGIN
    for _ in range(pieces):
        pose = advance(pose, forward / pieces, turn / pieces, left / pieces)
    whole = advance(ORIGIN, forward, turn, left)
    assert math.dist(pose[:2], whole[:2]) < 1e-9
    assert abs(wrap_angle(pose.yaw_rad - whole.yaw_rad)) < 1e-9


def test_a_quarter_circle():
    quarter = math.pi / 2
    assert advance(ORIGIN, quarter, quarter) == pytest.approx(Pose(1.0, 1.0, quarter))
    assert advance(ORIGIN, 0.0, quarter, quarter) == pytest.approx(Pose(-1.0, 1.0, quarter))


@given(angles)
def test_a_quaternion_of_either_sign_gives_back_its_yaw(angle):
    yaw = wrap_angle(angle)
    z, w = quaternion_of(yaw)
    for sign in (1, -1):
        assert math.cos(yaw_of(0.0, 0.0, sign * z, sign * w) - yaw) == pytest.approx(1.0)
    assert yaw_of(0.0, 0.0, -1.0, 0.0) == yaw_of(-0.0, 0.0, -1.0, 0.0) == math.pi
