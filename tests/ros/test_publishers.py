"""What a frame becomes on the topics, those of an IMU too."""

import math

import pytest
from genpy import Time
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot import models
from mrl_driver.robot.heading import FILTER_DELAY_S
from mrl_driver.robot.imu import FROZEN, IN_USE, Imu
from mrl_driver.robot.odometry import FourWheels, OmniTwist, Twist, Wheels
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.session.events import ImuReading
from ros1_bridge.node.robot_parameters import check
from ros1_bridge.topics import messages
from ros1_bridge.topics.message_covariance import UNUSED_VARIANCE
from ros1_bridge.topics.publishers import Publishers
from tests.models import four_wheels

from .fake_topics import Topics

MODEL = models.load("traxbot")
WHEEL_RADIUS_M = 0.039
STAMP = Time(5, 0)


def published(*heard, fresh=(), yaw_rad=0.0, twist=Twist(0.0, 0.0), counts=Wheels(0, 0)):  # noqa: B008
    """Topics after one frame."""
    topics = Topics(*heard)
    out = Publishers(topics, OSError, check({"port": "p"}, "node"), MODEL, clock=lambda: 100.0)
    out.sonars(STAMP)
    ranges = {"front": 1.5, "left": 2.5, "right": 3.5}
    out.telemetry(Telemetry(50.0, 50.0, Pose(1.0, 2.0, yaw_rad), twist, ranges, fresh, counts, 1))
    return topics


class Clocks:
    """Wall clock and monotonic clock of a thread that pauses for `pause_s` between two readings."""

    def __init__(self):
        self.now_s, self.wall_ahead_s, self.pause_s = 50.0, 1000.0, 0.0

    def wall(self):
        wall_s = self.now_s + self.wall_ahead_s
        self.now_s, self.pause_s = self.now_s + self.pause_s, 0.0
        return wall_s

    def monotonic(self):
        return self.now_s


def stamps(*changes, **given):
    """Stamps of frames 0.02 s apart [s]; before each frame but the first, the clocks are set as `changes` say."""
    topics, clocks = Topics("odom"), Clocks()
    parameters = check({"port": "p"}, "node")
    out = Publishers(topics, OSError, parameters, MODEL, clocks.wall, clocks.monotonic, **given)
    for number, change in enumerate(({}, *changes)):
        vars(clocks).update(change)
        stamp_s = 50.0 + 0.02 * number
        out.telemetry(
            Telemetry(stamp_s, stamp_s, Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0), {}, (), Wheels(0, 0), number)
        )
    return [message.header.stamp.to_sec() for message in topics["odom"].sent]


@pytest.mark.parametrize("gap_s, sent", [(0.04, 2), (0.3, 3), (1.1, 2)])
def test_speeds_of_a_gap_are_told_a_period_after_its_begin(gap_s, sent):
    """Who integrates them then knows the way: 0.06 m in 0.3 s."""
    topics = Topics("odom")
    out = Publishers(topics, OSError, check({"port": "p"}, "node"), MODEL, lambda: 1.0, lambda: 1.0)
    for stamp_s, x_m in ((50.0, 0.0), (50.0 + gap_s, 0.2 * gap_s)):
        twist = Twist(0.2 if x_m else 0.0, 0.0)
        out.telemetry(Telemetry(stamp_s, stamp_s, Pose(x_m, 0.0, 0.0), twist, {}, (), Wheels(0, 0), 1))
    told = topics["odom"].sent
    assert len(told) == sent
    if sent == 3:
        begin, end = told[1:]
        lasting_s = (end.header.stamp - begin.header.stamp).to_sec()
        way_m = end.pose.pose.position.x - begin.pose.pose.position.x
        assert lasting_s == pytest.approx(gap_s - 0.02)
        assert begin.twist.twist.linear.x * lasting_s == pytest.approx(way_m)


def test_stamps_increase_though_the_clock_goes_back_a_little():
    first, second, third = stamps({"wall_ahead_s": 999.5}, {})
    assert first < second < third < first + 1e-4


def test_the_difference_of_the_clocks_is_noted_when_it_changes():
    """A recording then gives the same stamps.  A step below the tolerance, or a pause, is no change."""
    noted = []
    made = stamps(
        {"wall_ahead_s": 1000.00005}, {"pause_s": 2.0}, {"wall_ahead_s": 1001.0}, note_clock=noted.append
    )
    assert noted == [1000.0, 1001.0]
    assert made == pytest.approx([1050.0, 1050.02, 1050.04, 1051.06], abs=1e-6)


@settings(max_examples=50)
@given(st.lists(st.floats(0, 0.9), min_size=1), st.sampled_from([1000.0, -50.0]))
def test_stamps_increase_whatever_the_jitter(earlier, wall_ahead_s):
    """Below a second; also in simulated time that stands at its start."""
    topics, clocks = Topics("odom"), Clocks()
    clocks.wall_ahead_s = wall_ahead_s
    out = Publishers(topics, OSError, check({"port": "p"}, "node"), MODEL, clocks.wall, clocks.monotonic)
    for each in earlier:
        out.telemetry(
            Telemetry(50 - each, 50 - each, Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0), {}, (), Wheels(0, 0), 1)
        )
    made = [message.header.stamp for message in topics["odom"].sent]
    assert all(before < after for before, after in zip(made, made[1:]))


def test_wheels_turn_as_fast_as_the_robot_moves():
    """Straight ahead each by the speed over its radius."""
    (joints,) = published("joint_states", twist=Twist(0.2, 0.0))["joint_states"].sent
    assert joints.velocity == pytest.approx([0.2 / WHEEL_RADIUS_M] * 2, rel=2e-3)


def test_a_wheel_that_is_larger_turns_more_slowly():
    """Its speed is that with which its position grows: 10 000 counts of the right one are 1 % more way."""
    topics, model = Topics("joint_states"), MODEL._replace(drive=MODEL.drive._replace(wheel_offset=0.02))
    out = Publishers(topics, OSError, check({"port": "p"}, "node"), model, lambda: 1.0, lambda: 1.0)
    counts, turn_rad = Wheels(10000, 10000), 10000 * 0.02 * MODEL.drive.metres_per_count / 0.18
    twist = Twist(10000 * MODEL.drive.metres_per_count, turn_rad * (1 - MODEL.drive.turn_slip))
    out.telemetry(Telemetry(50.0, 50.0, Pose(0.0, 0.0, 0.0), twist, {}, (), counts, 1))
    (joints,) = topics["joint_states"].sent
    assert joints.velocity == pytest.approx(joints.position)


@pytest.mark.parametrize(
    ("forward", "left", "signs"),
    [(0.2, 0.0, (1, 1, 1, 1)), (0.0, 0.2, (1, -1, 1, -1))],
    ids=["ahead", "aside"],
)
def test_each_of_four_wheels_is_a_joint(forward, left, signs):
    topics, model = Topics("joint_states"), four_wheels("mecanum")
    out = Publishers(topics, OSError, check({"port": "p"}, "node"), model)
    twist, counts = OmniTwist(forward, 0.0, left), FourWheels(1496, 0, -748, 0)
    out.telemetry(Telemetry(50.0, 50.0, Pose(0.0, 0.0, 0.0), twist, {}, (), counts, 1))
    (joints,) = topics["joint_states"].sent
    names = ("right", "left", "rear_left", "rear_right")
    assert list(joints.name) == [f"{name}_wheel_joint" for name in names]
    assert joints.position == pytest.approx([2 * math.pi, 0.0, -math.pi, 0.0])
    assert joints.velocity == pytest.approx([sign * 0.2 / 0.0325 for sign in signs])


@pytest.mark.parametrize("wheels_counted", (True, False))
def test_servos_are_joints_with_their_angles(wheels_counted):
    topics, duo = Topics("joint_states"), models.load("duo")
    board = {**duo.board, "no_encoders": int(not wheels_counted)}
    model = duo._replace(board=board, servos={"pan": models.ServoMount(1, -1.0, 1.0, 1000, 2000)})
    out = Publishers(topics, OSError, check({"port": "p"}, "node"), model)
    out.servos({}, STAMP)
    out.servos({"pan": 0.5, "tilt": -0.2}, STAMP)
    (joints,) = topics["joint_states"].sent
    assert (joints.name, joints.position) == (["pan_joint", "tilt_joint"], (0.5, -0.2))
    assert joints.header.stamp == STAMP


def test_counts_of_all_wheels_have_the_stamp_of_their_reading():
    topics = published("odom", "encoders", counts=Wheels(2**40, -7))
    (encoders,), (odometry,) = topics["encoders"].sent, topics["odom"].sent
    assert (encoders.name, encoders.position) == (["right_wheel_joint", "left_wheel_joint"], (2**40, -7))
    assert encoders.header.stamp == odometry.header.stamp


def test_footprint_is_on_the_floor_below_the_axle():
    topics = Topics()
    Publishers(topics, OSError, check({"port": "p", "base_frame": "a/base_link"}, "node"), MODEL).footprint(
        STAMP
    )
    (transform,) = topics["/tf_static"].sent[0].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("a/base_link", "a/base_footprint")
    assert transform.transform.translation.z == pytest.approx(-WHEEL_RADIUS_M, rel=2e-3)


@pytest.mark.parametrize("yaw_rad", [math.pi / 2, -1.0])
def test_odometry_and_its_transform_are_the_pose(yaw_rad):
    topics = published("odom", "/tf", yaw_rad=yaw_rad)
    (odometry,), ((transform,),) = topics["odom"].sent, [each.transforms for each in topics["/tf"].sent]
    assert odometry.header.stamp == transform.header.stamp
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
    place, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
    assert (place.x, place.y, 2 * math.atan2(turn.z, turn.w)) == pytest.approx((1.0, 2.0, yaw_rad))
    moved = transform.transform
    assert (moved.translation.x, moved.translation.y, moved.rotation) == (place.x, place.y, turn)


def test_new_range_is_published_though_nobody_hears_the_joints():
    topics = published("sonar/front", fresh=("front",))
    assert [message.range for message in topics["sonar/front"].sent] == [1.5]


@pytest.mark.parametrize("volts, present", [(0.0, False), (0.99, False), (1.0, True), (12.0, True)])
def test_battery_is_present_when_motor_power_is_on(volts, present):
    assert messages.battery_state("base_link", STAMP, volts, MODEL.battery).present is present


WITH_IMU = models.load("traxbot")._replace(imu=models.ImuMount(0.05, -0.02, 0.03, yaw_deg=90.0))
RAW, DATA = "imu/data_raw", "imu/data"
RATES, ACCELERATIONS = (0.01, -0.02, 0.5), (0.1, 0.2, 9.8)
BIAS, YAW, YAW_VARIANCE = 0.03, 1.2, 0.004


def reading(stamp_s=50.0, state=IN_USE, bias_sd_rad_s=0.001):
    raw = ImuReading(0.0, stamp_s, stamp_s, RATES, ACCELERATIONS)
    return Imu(stamp_s, RATES, ACCELERATIONS, YAW, YAW_VARIANCE, BIAS, bias_sd_rad_s, True, state, raw)


def published_of_imu(*heard, readings=(reading(),), framed=True, **given):  # noqa: B008
    """Topics after readings, on a graph whose clock is 1000 s ahead."""
    parameters = check({"port": "p", "base_frame": "robot1/base_link", **given}, "node")
    topics = Topics(*heard)
    out = Publishers(topics, OSError, parameters, WITH_IMU, clock=lambda: 1050.0, monotonic=lambda: 50.0)
    out.sonars(Time(5, 0))
    imu = out.imu(Time(5, 0))
    if framed:
        out.telemetry(Telemetry(50.0, 50.0, ORIGIN, Twist(0.0, 0.0), {}, (), Wheels(0, 0), 1))
    for each in readings:
        imu.on_imu(each)
    return topics


def only(topic, *readings):
    (message,) = published_of_imu(topic, readings=readings or [reading()])[topic].sent
    return message


def numbers(vector):
    return vector.x, vector.y, vector.z


@pytest.mark.parametrize("topic", [RAW, DATA])
def test_reading_has_the_frame_of_the_chip_and_the_time_of_the_motion(topic):
    """The chip's filter delays it."""
    header = only(topic).header
    assert header.frame_id == "robot1/imu_link"
    assert header.stamp.to_sec() == pytest.approx(1050.0 - FILTER_DELAY_S, abs=1e-6)


def test_orientation_is_the_heading_of_the_robot_at_the_time_of_the_stamp():
    turn, variances = only(DATA).orientation, only(DATA).orientation_covariance[::4]
    earlier_rad = FILTER_DELAY_S * (RATES[2] - BIAS)
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(YAW - earlier_rad)
    assert variances == (UNUSED_VARIANCE, UNUSED_VARIANCE, YAW_VARIANCE)


def test_bias_is_removed_from_the_yaw_rate_alone_which_is_as_sure_as_that():
    assert numbers(only(DATA).angular_velocity) == pytest.approx((*RATES[:2], RATES[2] - BIAS))
    sure, unsure = (only(DATA, reading(bias_sd_rad_s=sd)).angular_velocity_covariance[8] for sd in (0.0, 0.1))
    assert unsure == pytest.approx(sure + 0.01)


def test_gyro_that_is_not_in_use_gives_no_data():
    """A filter would believe it; what the chip says is still there to look at, once a frame shows the clocks."""
    assert published_of_imu(RAW, framed=False)[RAW].sent == []
    topics = published_of_imu(RAW, DATA, readings=[reading(state=FROZEN)])
    assert (len(topics[RAW].sent), len(topics[DATA].sent)) == (1, 0)


def test_mount_has_the_position_of_the_chip_and_the_axes_of_the_robot():
    """Readings are rotated already."""
    every, some = (
        published_of_imu(publish_imu_mount=imu)["/tf_static"].sent[-1].transforms for imu in (True, False)
    )
    frames, mount = [each.child_frame_id for each in every], every[-1]
    assert frames == ["robot1/sonar_front", "robot1/sonar_left", "robot1/sonar_right", "robot1/imu_link"]
    assert [each.child_frame_id for each in some] == frames[:3]
    assert mount.header.frame_id == "robot1/base_link"
    assert numbers(mount.transform.translation) == (0.05, -0.02, 0.03)
    assert (mount.transform.rotation.z, mount.transform.rotation.w) == (0.0, 1.0)
