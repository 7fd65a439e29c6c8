"""Growth of the pose's covariance."""

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.geometry import ORIGIN, Pose, advance
from mrl_driver.robot.covariance import Uncertainty
from mrl_driver.robot.models import ON_TRACKS, ON_WHEELS, Noise, load
from mrl_driver.robot.robot_state import odometry_of
from ros1_bridge.topics import message_covariance
from ros1_bridge.topics.message_covariance import UNUSED_VARIANCE, pose_matrix

RANDOM = Noise(1e-4, 0.0)
"""Errors of each step are random: 1 cm over 1 m."""
MODEL = load("stingbot")._replace(noise=RANDOM)
BASE_M = MODEL.drive.wheel_separation_m
XX, YY, TT, YT = 0, 7, 35, 11


def step(made, pose, right_m, left_m):
    """The pose after a step of the wheels, which `made` follows."""
    turn = (right_m - left_m) / BASE_M
    after = advance(pose, (right_m + left_m) / 2, turn)
    made.update(pose, after, (right_m, left_m), turn)
    return after


def driven(right_m, left_m, steps=200):
    """The covariance after both wheels went so far at constant speeds."""
    made, pose = Uncertainty(MODEL), ORIGIN
    for _ in range(steps):
        pose = step(made, pose, right_m / steps, left_m / steps)
    return pose_matrix(made.spread)


def test_standing_robot_is_as_sure_as_at_the_start():
    odometry = odometry_of(MODEL, exact_time=True)
    start = odometry.uncertainty.spread
    for i in range(10):
        odometry.update(5, 5, 0.02 * i)
    assert odometry.uncertainty.spread == start


def test_unused_axes_are_not_measured():
    matrix = driven(1.0, 1.0)
    assert [matrix[7 * i] for i in (2, 3, 4)] == [UNUSED_VARIANCE] * 3


def test_yaw_variance_after_a_straight_metre_is_that_of_both_wheels():
    expected = 2 * RANDOM.wheel_m2_per_m / BASE_M**2
    assert driven(1.0, 1.0)[TT] == pytest.approx(expected, rel=0.01)


def test_straight_way_makes_the_side_less_sure_than_the_way():
    matrix = driven(2.0, 2.0)
    assert matrix[YY] > 10 * matrix[XX]
    assert matrix[YT] > 0


def test_covariance_agrees_with_random_wheels():
    """Monte Carlo: 2000 robots whose wheels err independently; 12 % is some four standard errors."""
    rng, steps, ends = random.Random(5), 40, []
    way_m = 1.0 / steps
    spread = math.sqrt(RANDOM.wheel_m2_per_m * way_m)
    for _ in range(2000):
        pose = ORIGIN
        for _ in range(steps):
            right, left = way_m * 1.2 + rng.gauss(0, spread * 1.2**0.5), way_m + rng.gauss(0, spread)
            pose = advance(pose, (right + left) / 2, (right - left) / BASE_M)
        ends.append(pose)
    matrix = driven(1.2, 1.0, steps)
    for axis, index in ((0, XX), (1, YY), (2, TT)):
        mean = sum(end[axis] for end in ends) / len(ends)
        variance = sum((end[axis] - mean) ** 2 for end in ends) / len(ends)
        assert matrix[index] == pytest.approx(variance, rel=0.12)


@pytest.mark.parametrize("axis", range(5))
def test_tracks_are_at_most_as_sure_as_wheels(axis):
    assert ON_TRACKS[axis] >= ON_WHEELS[axis]


def test_a_way_that_was_lost_widens_position_and_yaw():
    """Evenly spread over 0.3 m and 0.6 rad to either side."""
    made = Uncertainty(MODEL)
    xx, xy, xt, yy, yt, tt = made.spread
    made.widen(0.3, 0.6)
    assert made.spread == pytest.approx((xx + 0.03, xy, xt, yy + 0.03, yt, tt + 0.12))


def test_reset_is_as_sure_as_the_start():
    made = Uncertainty(load("stingbot"))
    start = made.spread
    step(made, ORIGIN, 0.5, 0.4)
    made.reset()
    assert made.spread == start


def test_reset_to_a_pose_with_a_covariance_goes_on_from_it():
    made, given = Uncertainty(load("stingbot")), (4e-2, 0.0, 0.0, 9e-2, 0.0, 1e-2)
    step(made, ORIGIN, 0.5, 0.4)
    made.reset(given)
    assert made.spread == given


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03)), max_size=30))
def test_covariance_stays_symmetric_and_positive(moves):
    made, pose = Uncertainty(load("stingbot")), ORIGIN
    for right_m, left_m in moves:
        pose = step(made, pose, right_m, left_m)
    m = pose_matrix(made.spread)
    assert all(m[6 * i + j] == m[6 * j + i] for i in range(6) for j in range(6))
    assert m[0] > 0 and m[0] * m[7] - m[1] * m[6] > 0
    xx, xy, xt, yy, yt, tt = made.spread
    determinant = xx * (yy * tt - yt * yt) - xy * (xy * tt - yt * xt) + xt * (xy * yt - yy * xt)
    assert determinant > 0


def test_twist_is_less_sure_at_speed():
    made = Uncertainty(load("stingbot"))
    for _ in range(50):
        made.stand(0.02)
    still = made.variances
    for _ in range(50):
        made.update(ORIGIN, Pose(0.006, 0.0, 0.02), (0.008, 0.004), 0.02, 0.02)
    assert made.variances[0] > still[0] > 0 and made.variances[1] > still[1] > 0


def test_twist_matrix_has_the_variances_of_the_axes_that_are_measured():
    matrix = message_covariance.twist_matrix((1.0, 2.0, 3.0))
    assert [matrix[7 * i] for i in range(6)] == [1.0, 3.0, *[UNUSED_VARIANCE] * 3, 2.0]
