"""The topics of an IMU: what is published of a reading, and when."""

import math

import pytest
from genpy import Time

from mrl_driver.geometry import ORIGIN
from mrl_driver.robot import models
from mrl_driver.robot.heading import FILTER_DELAY_S
from mrl_driver.robot.imu import FROZEN, IN_USE, Imu
from mrl_driver.robot.odometry import Twist, Wheels
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.session.events import ImuReading
from ros1_bridge.node.robot_parameters import check
from ros1_bridge.topics.message_covariance import UNUSED_VARIANCE
from ros1_bridge.topics.publishers import Publishers

from .fake_topics import Topics

MODEL = models.load("traxbot")._replace(imu=models.ImuMount(0.05, -0.02, 0.03, yaw_deg=90.0))
RAW, DATA = "imu/data_raw", "imu/data"
RATES, ACCELERATIONS = (0.01, -0.02, 0.5), (0.1, 0.2, 9.8)
BIAS, YAW, YAW_VARIANCE = 0.03, 1.2, 0.004


def reading(stamp_s=50.0, state=IN_USE, bias_sd_rad_s=0.001):
    raw = ImuReading(0.0, stamp_s, stamp_s, RATES, ACCELERATIONS)
    return Imu(stamp_s, RATES, ACCELERATIONS, YAW, YAW_VARIANCE, BIAS, bias_sd_rad_s, True, state, raw)


def published(*heard, readings=(reading(),), framed=True, **given):  # noqa: B008
    """Topics after readings, on a graph whose clock is 1000 s ahead."""
    parameters = check({"port": "p", "base_frame": "robot1/base_link", **given}, "node")
    topics = Topics(*heard)
    out = Publishers(topics, OSError, parameters, MODEL, clock=lambda: 1050.0, monotonic=lambda: 50.0)
    out.sonars(Time(5, 0))
    imu = out.imu(Time(5, 0))
    if framed:
        out.telemetry(Telemetry(50.0, 50.0, ORIGIN, Twist(0.0, 0.0), {}, (), Wheels(0, 0), 1))
    for each in readings:
        imu.on_imu(each)
    return topics


def only(topic, *readings):
    (message,) = published(topic, readings=readings or [reading()])[topic].sent
    return message


def numbers(vector):
    return vector.x, vector.y, vector.z


@pytest.mark.parametrize("topic", [RAW, DATA])
def test_reading_has_the_frame_of_the_chip_and_the_time_of_the_motion(topic):
    """The chip's filter delays it."""
    header = only(topic).header
    assert header.frame_id == "robot1/imu_link"
    assert header.stamp.to_sec() == pytest.approx(1050.0 - FILTER_DELAY_S, abs=1e-6)


def test_raw_reading_is_as_measured():
    message = only(RAW)
    assert message.orientation_covariance[0] == -1, "it has no orientation"
    assert (numbers(message.angular_velocity), numbers(message.linear_acceleration)) == (RATES, ACCELERATIONS)


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
    assert published(RAW, framed=False)[RAW].sent == []
    topics = published(RAW, DATA, readings=[reading(state=FROZEN)])
    assert (len(topics[RAW].sent), len(topics[DATA].sent)) == (1, 0)


def test_mount_has_the_position_of_the_chip_and_the_axes_of_the_robot():
    """Readings are rotated already."""
    every, some = (
        published(publish_imu_mount=imu)["/tf_static"].sent[-1].transforms for imu in (True, False)
    )
    frames, mount = [each.child_frame_id for each in every], every[-1]
    assert frames == ["robot1/sonar_front", "robot1/sonar_left", "robot1/sonar_right", "robot1/imu_link"]
    assert [each.child_frame_id for each in some] == frames[:3]
    assert mount.header.frame_id == "robot1/base_link"
    assert numbers(mount.transform.translation) == (0.05, -0.02, 0.03)
    assert (mount.transform.rotation.z, mount.transform.rotation.w) == (0.0, 1.0)
