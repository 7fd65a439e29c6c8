"""Environment sensors and radio: frames to messages and back, and the sensors of an emulated board."""

import math

import pytest
from diagnostic_msgs.msg import DiagnosticArray, KeyValue
from geometry_msgs.msg import Twist
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import Imu
from std_msgs.msg import Float32, Float32MultiArray, UInt16

from mrl_driver.table import BY_NAME
from ros1_bridge import environment
from ros1_bridge.processes import wait_until


def yaw_of(message):
    return 2 * math.atan2(message.orientation.z, message.orientation.w)


@pytest.mark.parametrize("bearing_deg, yaw_deg", [(0, 90), (90, 0), (180, -90), (45, 45)])
def test_bearing_from_north_becomes_yaw_from_east(bearing_deg, yaw_deg):
    message = environment.new_compass("base_link")
    environment.fill_compass(message, None, bearing_deg)
    assert math.degrees(yaw_of(message)) == pytest.approx(yaw_deg)


def test_compass_says_that_it_has_no_rates():
    message = environment.new_compass("base_link")
    assert message.angular_velocity_covariance[0] == message.linear_acceleration_covariance[0] == -1


@given(
    st.integers(0, 2**64 - 1),
    st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=16),
)
def test_text_survives_the_words_of_the_wire(address, text):
    code, *fields = environment.send_request(KeyValue(f"{address:x}", text))
    assert code == BY_NAME["send_xbee"].code
    assert environment.read_text(tuple(fields)) == (address, text)


@pytest.mark.parametrize("key", ["", "robot", "-1", "1" * 17])
def test_address_that_is_none_is_refused_by_name(key):
    with pytest.raises(ValueError, match="xbee/send key is"):
        environment.send_request(KeyValue(key, "hello"))


@pytest.mark.parametrize("value", ["", "x" * 17, "\u00e9"])
def test_text_that_the_wire_cannot_carry_is_refused(value):
    with pytest.raises(ValueError, match="expected 1 to 16 ASCII"):
        environment.send_request(KeyValue("1", value))


@pytest.fixture(scope="module")
def robot(module_rig):
    rig = module_rig
    port = rig.board("--environment", "--robot", "traxbot").port
    kinds = {
        "alcohol": UInt16,
        "dust": Float32,
        "light": UInt16,
        "thermopile": Float32MultiArray,
        "compass": Imu,
    }
    rig.sensors = {name: rig.topic(name, kind) for name, kind in kinds.items()}
    rig.process = rig.node(port)
    rig.publisher("cmd_vel", Twist)
    return rig


@pytest.mark.parametrize("name", ["alcohol", "dust", "light", "thermopile", "compass"])
def test_sensor_of_the_environment_build_is_published(robot, name):
    robot.sensors[name].wait(2)


def test_thermopile_has_eight_pixels(robot):
    assert len(robot.sensors["thermopile"].wait()[-1].data) == 8


def test_streams_beside_the_odometry_lose_no_frame(robot):
    """Sequence numbers run over all stamped frames, those of the sensors too."""
    topic = robot.topic("/diagnostics", DiagnosticArray)

    def link():
        every = [s for m in topic.messages for s in m.status if s.name == f"{robot.name}/robot_node: Link"]
        return {pair.key: pair.value for pair in every[-1].values} if every else {}

    robot.sensors["compass"].wait(20)
    assert wait_until(lambda: bool(link()), 20.0)
    assert link()["Lost Frames"] == "0"
