"""Growth of the pose's covariance."""

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.geometry import ORIGIN, advance
from mrl_driver.robot.covariance import Uncertainty
from mrl_driver.robot.models import ON_WHEELS, load
from ros1_bridge.topics import message_covariance
from ros1_bridge.topics.message_covariance import UNUSED_VARIANCE, pose_matrix

MODEL = load("stingbot")
COUNTS_A_METRE = 1 / MODEL.drive.metres_per_count
BASE_M = MODEL.drive.wheel_separation_m
XX, YY, TT, YT = 0, 7, 35, 11


def half(yaw_rad):
    return math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)


def driven(right_m, left_m, steps=200):
    """The covariance after both wheels went so far at constant speeds."""
    made = Uncertainty(MODEL)
    for i in range(1, steps + 1):
        share = i / steps
        counts = (right_m * share * COUNTS_A_METRE, left_m * share * COUNTS_A_METRE)
        made.update(counts, *half((right_m - left_m) * share / BASE_M))
    return pose_matrix(made.unknowns)


def test_standing_robot_is_as_sure_as_at_the_start():
    made = Uncertainty(MODEL)
    start = made.unknowns
    for _ in range(10):
        made.update((0, 0), 0.0, 1.0)
    assert made.unknowns == start


def test_unused_axes_are_not_measured():
    matrix = driven(1.0, 1.0)
    assert [matrix[7 * i] for i in (2, 3, 4)] == [UNUSED_VARIANCE] * 3


def test_yaw_variance_after_a_straight_metre_is_that_of_both_wheels():
    expected = 2 * ON_WHEELS.wheel_m2_per_m / BASE_M**2
    assert driven(1.0, 1.0)[TT] == pytest.approx(expected, rel=0.01)


def test_straight_way_makes_the_side_less_sure_than_the_way():
    matrix = driven(2.0, 2.0)
    assert matrix[YY] > 10 * matrix[XX]
    assert matrix[YT] > 0


def test_covariance_agrees_with_random_wheels():
    """Monte Carlo: 2000 robots whose wheels err independently; 12 % is some four standard errors."""
    rng, steps, ends = random.Random(5), 40, []
    way_m = 1.0 / steps
    spread = math.sqrt(ON_WHEELS.wheel_m2_per_m * way_m)
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


def test_tracks_are_less_sure_than_wheels():
    made = Uncertainty(load("traxbot"))
    metres = MODEL.drive.metres_per_count / load("traxbot").drive.metres_per_count
    made.update((COUNTS_A_METRE * metres,) * 2, 0.0, 1.0)
    assert made.unknowns[0] > driven(1.0, 1.0, 1)[XX]


def test_a_way_that_was_lost_widens_position_and_yaw():
    """Evenly spread over 0.3 m and 0.6 rad to either side."""
    spread = Uncertainty(MODEL)
    xx, xy, xt, yy, yt, tt = spread.unknowns
    spread.widen(0.3, 0.6)
    assert spread.unknowns == pytest.approx((xx + 0.03, xy, xt, yy + 0.03, yt, tt + 0.12))


def test_reset_is_as_sure_as_the_start():
    made = Uncertainty(MODEL)
    start = made.unknowns
    made.update((5000, 4000), *half(0.3))
    made.reset()
    assert made.unknowns == start


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(-300, 300), st.integers(-300, 300)), max_size=30))
def test_covariance_stays_symmetric_and_positive(moves):
    made, right, left = Uncertainty(MODEL), 0, 0
    for move_right, move_left in moves:
        right, left = right + move_right, left + move_left
        made.update((right, left), *half((right - left) * MODEL.drive.metres_per_count / BASE_M))
    m = pose_matrix(made.unknowns)
    assert all(m[6 * i + j] == m[6 * j + i] for i in range(6) for j in range(6))
    assert m[0] > 0 and m[0] * m[7] - m[1] * m[6] > 0
    xx, xy, xt, yy, yt, tt = made.unknowns
    determinant = xx * (yy * tt - yt * yt) - xy * (xy * tt - yt * xt) + xt * (xy * yt - yy * xt)
    assert determinant > 0


def test_twist_is_less_sure_at_speed():
    matrix = message_covariance.twist_matrix(0.3, 0.0)
    assert matrix[0] > message_covariance.STILL_M2_S2
    assert matrix[35] == message_covariance.STILL_RAD2_S2
