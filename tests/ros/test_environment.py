"""Environment sensors: frames to messages."""

import math

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import SENSORS
from ros1_bridge.topics import sensor_topics

COMPASS = sensor_topics.load()["compass"]


def compass():
    return sensor_topics.new_message(COMPASS, "base_link")


def yaw_of(message):
    return 2 * math.atan2(message.orientation.z, message.orientation.w)


@pytest.mark.parametrize("bearing_deg, yaw_deg", [(0, 90), (90, 0), (180, -90), (45, 45)])
def test_bearing_from_north_becomes_yaw_from_east(bearing_deg, yaw_deg):
    message = compass()
    sensor_topics.fill(message, COMPASS, (bearing_deg,), None)
    assert math.degrees(yaw_of(message)) == pytest.approx(yaw_deg)


def test_compass_says_that_it_has_no_rates():
    message = compass()
    assert message.angular_velocity_covariance[0] == message.linear_acceleration_covariance[0] == -1


@pytest.mark.parametrize(
    "text, message",
    [
        ("lux: {type: std_msgs/Float32}", "lux.sensor is 'lux', expected alcohol, dust"),
        ("light: {type: std_msgs/Byte}", "light.type is 'std_msgs/Byte', expected std_msgs/UInt16"),
        ("light: {typ: std_msgs/UInt16}", "light.typ is unknown, expected sensor, type"),
        ("light: {}", "light.type is empty, expected"),
        ("light: {type: std_msgs/UInt16, factor: 0}", "light.factor is 0, expected a number but 0"),
        ("light: {type: std_msgs/UInt16, variance: -1}", "light.variance is -1, expected 0 or more"),
        ("light: 3", "light is 3, expected the keys sensor"),
        ("[1]", r"file is \[1\], expected topics"),
        ("a: [", "no YAML"),
    ],
)
def test_wrong_sensor_topics_are_refused_by_name(tmp_path, text, message):
    (tmp_path / "sensors.yaml").write_text(text)
    with pytest.raises(ConfigError, match=message):
        sensor_topics.load(str(tmp_path / "sensors.yaml"))


def test_each_sensor_of_the_table_is_a_topic():
    assert {entry.sensor for entry in sensor_topics.load().values()} == {row.name for row in SENSORS}


def test_frame_takes_the_robots_prefix_and_values_their_factor():
    entry = sensor_topics.SensorTopic(
        "light", "sensor_msgs/Illuminance", factor=0.5, variance=4.0, frame="nose"
    )
    message = sensor_topics.new_message(entry, "one/base_link")
    sensor_topics.fill(message, entry, (10.0,), 7)
    got = (message.header.frame_id, message.header.stamp, message.illuminance, message.variance)
    assert got == ("one/nose", 7, 5.0, 4.0)
