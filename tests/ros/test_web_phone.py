"""A phone's sensors as sensor_msgs/Imu."""

import math

import numpy as np
import pytest

from mrl_driver.apps.web.robot import PhoneReading
from ros1_bridge.web import phone_imu


def about(axis, degrees):
    """The rotation matrix about an axis."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    plane = [i for i in range(3) if i != axis]
    turn = np.eye(3)
    turn[np.ix_(plane, plane)] = [[cos, -sin], [sin, cos]] if axis != 1 else [[cos, sin], [-sin, cos]]
    return turn


def matrix(x, y, z, w):
    """The rotation matrix of a quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.parametrize(
    "alpha, beta, gamma", [(0, 0, 0), (90, 0, 0), (0, 40, 0), (0, 0, -70), (200, -130, 35)]
)
def test_orientation_is_the_w3cs_turn_about_z_then_x_then_y(alpha, beta, gamma):
    expected = about(2, alpha) @ about(0, beta) @ about(1, gamma)
    assert np.allclose(matrix(*phone_imu.orientation(alpha, beta, gamma)), expected)


def reading(
    angles=(10.0, 20.0, 30.0), absolute=True, acceleration=(0.1, 0.2, 9.8), rotation=(90.0, 0.0, -180.0)
):
    return PhoneReading(1.0, *angles, absolute, acceleration, rotation)


def test_rates_are_about_the_phones_axes_and_in_radians():
    message = phone_imu.message(reading(), "now")
    rate, given = message.angular_velocity, message.linear_acceleration
    assert (message.header.frame_id, message.header.stamp) == ("phone", "now")
    assert (given.x, given.y, given.z) == (0.1, 0.2, 9.8)
    assert (rate.x, rate.y, rate.z) == pytest.approx((math.pi / 2, 0.0, -math.pi))


@pytest.mark.parametrize(
    "part, values",
    [
        ("orientation", {"angles": (math.nan, 20.0, 30.0)}),
        ("angular_velocity", {"rotation": None}),
        ("linear_acceleration", {"acceleration": None}),
    ],
)
def test_what_is_absent_has_a_covariance_that_begins_with_minus_one(part, values):
    first = {
        name: getattr(phone_imu.message(reading(**values), None), f"{name}_covariance")[0]
        for name in ("orientation", "angular_velocity", "linear_acceleration")
    }
    assert {name for name, value in first.items() if value == -1} == {part}
    assert all(value > 0 for name, value in first.items() if name != part)


def test_a_heading_without_compass_has_the_variance_of_an_unknown_one():
    known, unknown = (
        phone_imu.message(reading(absolute=way), None).orientation_covariance for way in (True, False)
    )
    assert known[8] == pytest.approx(math.radians(17.4) ** 2) and unknown[8] == 1e6
    assert known[:8] == unknown[:8]
