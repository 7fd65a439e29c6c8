"""Environment sensors: frames to messages, and the sensors of an emulated board."""

import math

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import SENSORS
from ros1_bridge.topics import sensor_topics
from ros1_bridge.topics.sensor_topics import KINDS
from tests.waiting import wait_until

from .tables import Offered, first_two, table

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


@pytest.fixture(scope="module")
def robot(module_rig):
    rig = module_rig
    port = rig.board("--environment", "--robot", "traxbot").port
    rig.sensors = {
        name: rig.topic(name, KINDS[each.type].message) for name, each in sensor_topics.load().items()
    }
    rig.process = rig.node(port)
    rig.publisher("cmd_vel", Twist)
    return rig


def test_sensors_of_the_environment_build_are_published(robot):
    for topic in robot.sensors.values():
        topic.wait(2)
    assert len(robot.sensors["thermopile"].wait()[-1].data) == 8
    topics = Offered(robot).topics(0)
    assert first_two(table("in place of the sonars", "topic")).items() <= topics.items()
    assert not any(name.startswith("sonar/") for name in topics)


def test_odometry_goes_on_beside_the_sensors_and_no_frame_is_lost(robot):
    """50 Hz beside the compass's 10.  Sequence numbers run over all stamped frames, those of the sensors too."""
    diagnostics, odometry = robot.topic("/diagnostics", DiagnosticArray), robot.topic("odom", Odometry)
    odometry.wait()
    before = len(odometry.messages)
    robot.sensors["compass"].wait_for_more(20)
    assert len(odometry.messages) - before > 3 * 20
    assert wait_until(lambda: robot.diagnosed(diagnostics, "Link"))["Lost Frames"] == "0"


def test_board_of_2013_has_the_same_sensors_but_no_compass(rig):
    """Its node is told of them by `build`."""
    port = rig.board("--robot", "traxbot", "--profile", "2013-august", "--environment").port
    kinds = {
        name: KINDS[each.type].message for name, each in sensor_topics.load().items() if name != "compass"
    }
    topics = {name: rig.topic(name, kind) for name, kind in kinds.items()}
    rig.node(port, "_build:=environment")
    values = {name: topic.wait()[-1].data for name, topic in topics.items()}
    assert len(values.pop("thermopile")) == 8
    assert values == {"alcohol": 123, "dust": 300.0, "light": 500}
    offered = Offered(rig).topics(0)
    assert "light" in offered and not [name for name in offered if "sonar/" in name or name == "compass"]
