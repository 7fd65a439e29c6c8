"""Packed messages are byte for byte what genpy makes."""

import io

from genpy import Time
from geometry_msgs.msg import TransformStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from tf2_msgs.msg import TFMessage

from ros1_bridge.topics.message_covariance import pose_matrix, twist_matrix
from ros1_bridge.topics.serialized_messages import PackedImu, PackedOdometry, PackedTransform

WORDS = st.integers(0, 2**32 - 1)
NUMBERS = st.floats()
SPEEDS = st.floats(-10, 10)
VECTORS = st.tuples(*[NUMBERS] * 3)
FRAMES = st.text(max_size=30)
STAMPS = st.tuples(WORDS, st.integers(0, 10**9 - 1))


def wire(message):
    """The message as rospy sends it."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return len(buffer.getvalue()).to_bytes(4, "little") + buffer.getvalue()


@settings(max_examples=50)
@given(
    FRAMES,
    FRAMES,
    WORDS,
    STAMPS,
    st.tuples(*[NUMBERS] * 4),
    st.tuples(*[NUMBERS] * 6),
    st.tuples(SPEEDS, SPEEDS) | st.tuples(SPEEDS, SPEEDS, SPEEDS),
    VECTORS,
)
def test_packed_odometry_is_that_of_genpy(odom, base, sequence, stamp, planar, spread, speeds, sure):
    """Some robots have a speed to the side."""
    message = Odometry(child_frame_id=base)
    message.header.seq, message.header.stamp, message.header.frame_id = sequence, Time(*stamp), odom
    pose, twist = message.pose.pose, message.twist.twist
    pose.position.x, pose.position.y, pose.orientation.z, pose.orientation.w = planar
    twist.linear.x, twist.angular.z, twist.linear.y = (*speeds, 0.0)[:3]
    message.pose.covariance, message.twist.covariance = pose_matrix(spread), twist_matrix(sure)
    packed = PackedOdometry(odom, base).pack(sequence, *stamp, *planar, spread, speeds, sure)
    assert packed == wire(message)


@settings(max_examples=50)
@given(FRAMES, FRAMES, STAMPS, st.tuples(*[NUMBERS] * 4))
def test_packed_transform_is_that_of_genpy(odom, base, stamp, planar):
    transform = TransformStamped(child_frame_id=base)
    transform.header.stamp, transform.header.frame_id = Time(*stamp), odom
    at, turn = transform.transform.translation, transform.transform.rotation
    at.x, at.y, turn.z, turn.w = planar
    assert PackedTransform(odom, base).pack(*stamp, *planar) == wire(TFMessage([transform]))


@settings(max_examples=50)
@given(FRAMES, WORDS, STAMPS, VECTORS, VECTORS, VECTORS, VECTORS, st.tuples(NUMBERS, NUMBERS), NUMBERS)
def test_packed_imu_is_that_of_genpy(
    frame, sequence, stamp, orientation_variances, rates, rate_variances, accelerations, half, variance
):
    message = Imu()
    message.header.seq, message.header.stamp, message.header.frame_id = sequence, Time(*stamp), frame
    message.orientation.z, message.orientation.w = half
    for axis, rate, acceleration in zip("xyz", rates, accelerations):
        setattr(message.angular_velocity, axis, rate)
        setattr(message.linear_acceleration, axis, acceleration)
    message.orientation_covariance[::4] = orientation_variances
    message.angular_velocity_covariance[::4] = rate_variances
    message.linear_acceleration_covariance[::4] = [variance] * 3
    packed = PackedImu(frame, variance)
    assert packed.pack(
        sequence, *stamp, *half, orientation_variances, rates, rate_variances, accelerations
    ) == wire(message)
