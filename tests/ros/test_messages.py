"""What stands in the messages; packed ones are byte for byte what genpy makes."""

import io
import math

import pytest
from genpy import Time
from geometry_msgs.msg import TransformStamped, Twist, Vector3
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Imu, JointState, Range
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from mrl_driver.geometry import Pose
from mrl_driver.robot.models import SonarMount, load
from ros1_bridge.topics import messages
from ros1_bridge.topics.message_covariance import pose_matrix, twist_matrix
from ros1_bridge.topics.serialized_messages import (
    PackedImu,
    PackedJoints,
    PackedOdometry,
    PackedRange,
    PackedTransform,
)

STAMP = Time(5, 7)
BATTERY = load("traxbot").battery


def yaw_of(rotation):
    return 2 * math.atan2(rotation.z, rotation.w)


def test_transform_equals_the_pose():
    transform = messages.transform_of("odom", "base_link", Pose(1.0, -2.0, 3.1), stamp=STAMP)
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
    assert (transform.transform.translation.x, transform.transform.translation.y) == (1.0, -2.0)
    assert yaw_of(transform.transform.rotation) == pytest.approx(3.1)


def test_mount_turns_x_along_the_beam():
    (transform,) = messages.mounts_of("base_link", {"left": SonarMount(0.08, 0.06, 45.0)}, STAMP)
    assert transform.child_frame_id == "sonar_left"
    assert (transform.transform.translation.x, transform.transform.translation.y) == (0.08, 0.06)
    assert yaw_of(transform.transform.rotation) == pytest.approx(math.radians(45))


@pytest.mark.parametrize(
    "volts, percentage", [(13.8, 1.0), (15.0, 1.0), (8.5, 0.0), (8.0, 0.0), (11.15, 0.5)]
)
def test_charge_is_between_empty_and_full(volts, percentage):
    message = messages.battery_state("base_link", STAMP, volts, BATTERY)
    assert message.voltage == volts
    assert message.percentage == pytest.approx(percentage)


def test_what_the_board_does_not_measure_is_nan():
    message = messages.battery_state("base_link", STAMP, math.nan, BATTERY)
    assert math.isnan(message.voltage) and math.isnan(message.percentage)
    assert message.power_supply_health == BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN
    assert all(math.isnan(value) for value in (message.current, message.charge, message.capacity))
    assert message.power_supply_technology == BatteryState.POWER_SUPPLY_TECHNOLOGY_NIMH


@pytest.mark.parametrize("part", ["linear", "angular"])
@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_field_of_a_command_that_is_not_finite_is_named(part, axis, value):
    message = Twist()
    setattr(getattr(message, part), axis, value)
    assert messages.field_not_finite(message) == f"cmd_vel {part}.{axis} is {value}, expected a finite number"


def test_numbers_whose_sum_is_infinite_are_finite():
    assert messages.field_not_finite(Twist(Vector3(1e308, 1e308, 0), Vector3())) == ""


@pytest.mark.parametrize(
    "linear, angular, sideways, axes",
    [
        ((1, 2, 0), (0, -3, 4), False, ("linear.y", "angular.y")),
        ((1, 2, 3), (0, 0, 4), True, ("linear.z",)),
        ((0, -0.0, 0), (0, 0, 0), False, ()),
    ],
)
def test_axes_that_the_robot_lacks_are_named(linear, angular, sideways, axes):
    assert messages.unused_axes(Twist(Vector3(*linear), Vector3(*angular)), sideways=sideways) == axes


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


@settings(max_examples=50)
@given(WORDS, STAMPS, st.lists(st.tuples(FRAMES, NUMBERS, NUMBERS), max_size=4))
def test_packed_joints_are_those_of_genpy(sequence, stamp, joints):
    names, positions, velocities = ([joint[i] for joint in joints] for i in range(3))
    message = JointState(name=names, position=positions, velocity=velocities)
    message.header.seq, message.header.stamp = sequence, Time(*stamp)
    assert PackedJoints(names).pack(sequence, *stamp, positions, velocities) == wire(message)


SHARP = {"input": "range_2", "type": "GP2Y0A21"}


@pytest.mark.parametrize(
    "given, radiation, degrees, near_m, range_m, clear_m, shown, most",
    [
        ({}, Range.ULTRASOUND, 36, 0.15, math.inf, 0.0, math.inf, 6.45),
        ({}, Range.ULTRASOUND, 36, 0.15, -math.inf, 0.7, -math.inf, 0.7),
        ({}, Range.ULTRASOUND, 36, 0.15, math.nan, 0.7, math.nan, 0.7),
        ({}, Range.ULTRASOUND, 36, 0.15, 0.5, 0.7, 0.5, 0.7),
        ({}, Range.ULTRASOUND, 36, 0.15, 1.5, 0.7, 0.7, 0.7),
        ({}, Range.ULTRASOUND, 36, 0.15, math.inf, 0.7, 0.7, 0.7),
        ({"input": "range_2"}, Range.ULTRASOUND, 15, 0.02, math.inf, 5.0, 4.0, 4.0),
        (SHARP, Range.INFRARED, 5, 0.1, 0.5, 0.0, 0.5, 0.8),
    ],
)
def test_packed_range_is_that_of_genpy_and_follows_rep_117_unless_it_is_cut(
    given, radiation, degrees, near_m, range_m, clear_m, shown, most
):
    message = Range(Header(3, STAMP, "sonar_nose"), radiation, math.radians(degrees), near_m, most, shown)
    packed = PackedRange("sonar_nose", SonarMount(0.1, 0.0, 0.0, **given).kind)
    assert packed.pack(3, STAMP.secs, STAMP.nsecs, range_m, clear_m) == wire(message)


@pytest.mark.parametrize(
    "range_m, max_range, seen",
    [
        (0.5, 0.5, math.inf),
        (0.6, 0.5, math.inf),
        (0.4, 0.5, 0.4),
        (-math.inf, 0.5, -math.inf),
        (0.5, 0.0, 0.5),
        (0.5, math.nan, 0.5),
    ],
)
def test_a_range_of_max_range_says_that_nothing_is_closer(range_m, max_range, seen):
    """If a driver sets one."""
    assert messages.range_of(Range(range=range_m, max_range=max_range)) == seen
