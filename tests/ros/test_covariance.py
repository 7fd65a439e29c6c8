"""Growth of the pose's covariance."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.geometry import ORIGIN, Pose, advance
from mrl_driver.robot.covariance import Uncertainty
from mrl_driver.robot.models import Noise, load
from ros1_bridge.topics import message_covariance
from ros1_bridge.topics.message_covariance import UNUSED_VARIANCE, pose_matrix

RANDOM = Noise(1e-4, 0.0)  # Errors of each step are random: 1 cm over 1 m
MODEL = load("stingbot")._replace(noise=RANDOM)
BASE_M = MODEL.drive.wheel_separation_m


def step(made, pose, right_m, left_m):
    """The pose after a step of the wheels, which `made` follows."""
    turn = (right_m - left_m) / BASE_M
    after = advance(pose, (right_m + left_m) / 2, turn)
    made.update(pose, after, (right_m, left_m), turn)
    return after


def test_reset_is_as_sure_as_the_start_or_as_is_told():
    made, given = Uncertainty(load("stingbot")), (4e-2, 0.0, 0.0, 9e-2, 0.0, 1e-2)
    start = made.spread
    for told in ((), (given,)):
        step(made, ORIGIN, 0.5, 0.4)
        made.reset(*told)
        assert made.spread == (given if told else start)


def test_a_way_that_was_lost_widens_position_and_yaw():
    """Evenly spread over 0.3 m and 0.6 rad to either side."""
    made = Uncertainty(MODEL)
    xx, xy, xt, yy, yt, tt = made.spread
    made.widen(0.3, 0.6)
    assert made.spread == pytest.approx((xx + 0.03, xy, xt, yy + 0.03, yt, tt + 0.12))


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
    matrix = pose_matrix((1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    assert [matrix[at] for at in (0, 1, 5, 7, 11, 35)] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert [matrix[7 * i] for i in (2, 3, 4)] == [UNUSED_VARIANCE] * 3
    matrix = message_covariance.twist_matrix((1.0, 2.0, 3.0))
    assert [matrix[7 * i] for i in range(6)] == [1.0, 3.0, *[UNUSED_VARIANCE] * 3, 2.0]
