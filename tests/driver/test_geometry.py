"""Plane geometry: one convention for angles, poses that compose, exact arcs."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.geometry import ORIGIN, Pose, advance, quaternion_of, wrap_angle, wrap_angles, yaw_of

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
