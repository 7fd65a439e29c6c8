"""Turns by gyro and wheels: bias, stands, lost readings, and no jump whatever happens."""

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.robot.heading import (
    FILTER_DELAY_S,
    HOLD_S,
    SILENT_S,
    STAND_S,
    STEADY_RAD_S,
    ZERO_RATE_RAD_S,
    HeadingFilter,
)
from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import Odometry
from mrl_driver.robot.omni_odometry import OmniOdometry

PERIOD_S = 0.02
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


def test_ten_quarter_turns_with_slip_are_right(robot):
    """A standing robot does not turn; readings twice and out of order change nothing."""
    before = robot.fused_rad
    robot.go(0.0, 60.0)
    assert robot.fused_rad == before
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


def test_motion_too_fast_for_the_readings_makes_the_yaw_less_sure(robot):
    unseen = []
    for shaken in (0.0, 0.2):
        robot.filter.unseen_rad2 = 0.0
        for step in range(20):
            robot.go(0.5 + shaken * (-1) ** step, PERIOD_S)
        unseen.append(robot.filter.unseen_rad2)
    assert unseen[1] > 20 * unseen[0]


def test_a_turn_as_steady_as_a_bias_is_a_turn_for_five_seconds(robot):
    """Beyond that, no hand turns so evenly: the chip's bias has shifted."""
    robot.go(2 * STEADY_RAD_S, 4.0, wheels=False)
    assert robot.fused_rad == pytest.approx(8 * STEADY_RAD_S, rel=0.1)
    assert robot.filter.bias_rad_s == pytest.approx(BIAS_RAD_S, abs=STEADY_RAD_S / 10)
    robot.go(2 * STEADY_RAD_S, 4.0, wheels=False)
    assert robot.filter.bias_rad_s == pytest.approx(BIAS_RAD_S + 2 * STEADY_RAD_S, abs=STEADY_RAD_S / 10)


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
    before = robot.filter.bias_rad_s, robot.filter.bias_sd_rad_s
    robot.filter.reset()
    assert robot.filter.bias_rad_s == before[0] and robot.filter.bias_sd_rad_s > before[1]
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


# ---- in the odometry


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


@pytest.mark.parametrize("kind, name, still", [(Odometry, "traxbot", ()), (OmniOdometry, "omni", (0,))])
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
