"""The node on an emulated board: topics, frames, commands."""

import math
import time
from statistics import median

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Range
from tf2_msgs.msg import TFMessage

from mrl_driver.protocol.stop_reason import StopReason
from ros1_bridge.node.robot_parameters import check
from ros1_bridge.robot.command_topics import WARN_EVERY_S
from ros1_bridge.robot.robot_node import driver_options
from tests.waiting import require_median, wait_until

from .rig import START_S, values_of

MOVE, STOP = 11, 13
SONAR_CYCLE_S = 0.3
TIMEOUT_S, TIMEOUT_LATE_S = 0.3, 0.05
TRUSTED_S = 1.0  # A source that has been silent for this long may move the robot
AT_ONCE_S = 0.05
LOST_M2 = 0.001  # Variance of a lost way of some 5 cm; a robot that stands keeps 1e-6


def forward(speed_m_s, **unused):
    return Twist(Vector3(speed_m_s, unused.get("y", 0.0), 0.0), Vector3())


def moves(robot, message):
    """Publish a command until it is on the wire (a node that was held up refuses one); when it was there."""
    since = time.monotonic()

    def is_sent():
        robot.cmd_vel.publish(message)
        robot.odom.wait_for_more(2)
        return robot.wire.first(MOVE, since) < math.inf

    wait_until(is_sent)
    return robot.wire.first(MOVE, since)


@pytest.fixture(scope="module")
def robot(module_rig):
    """A running node; its rig, the tap on its wire, its topics."""
    rig = module_rig
    rig.wire = rig.tap(rig.board().port)
    rig.odom = rig.topic("odom", Odometry)
    rig.tf = rig.topic("/tf", TFMessage)
    rig.sonars = {name: rig.topic(f"sonar/{name}", Range) for name in ("front", "left", "right")}
    rig.battery = rig.topic("battery", BatteryState)
    rig.status = rig.topic("status", DiagnosticStatus)
    rig.process = rig.node(rig.wire.port)
    rig.odom.wait()
    rig.cmd_vel = rig.publisher("cmd_vel", Twist)
    return rig


def test_a_stop_that_the_next_command_ends_at_once_is_published(robot):
    """An operator's page relies on it: the robot must not drive on as if nothing had happened."""
    begin = len(robot.status.messages)

    def is_told():
        """Again if a busy machine has stopped the robot for another reason."""
        robot.wire.wait_for(STOP, moves(robot, forward(0.1)))
        robot.cmd_vel.publish(forward(0.1))
        robot.status.wait_for_more(2)
        return any("command timeout" in each.message for each in robot.status.messages[begin:])

    wait_until(is_told)


def test_transform_equals_odometry(robot):
    robot.odom.wait(20)
    poses = {m.header.stamp: m.pose.pose.position.x for m in robot.odom.messages}
    child, every = f"{robot.name}/base_link", [t for message in robot.tf.messages for t in message.transforms]
    transforms = [t for t in every if t.child_frame_id == child and t.header.stamp in poses]
    assert transforms and robot.odom.messages[-1].child_frame_id == child
    assert all(t.transform.translation.x == poses[t.header.stamp] for t in transforms)
    assert {t.header.frame_id for t in transforms} == {f"{robot.name}/odom"}


def test_sonars_are_published_once_for_each_reading(robot):
    """Each sonar has one reading for each cycle of the chain, and the stream repeats it in many frames.

    The stamps tell: messages may come late, and a subscriber that is held up loses some.  A busy machine makes cycles
    longer.
    """
    begin = {name: len(topic.messages) for name, topic in robot.sonars.items()}
    for name, topic in robot.sonars.items():
        messages = topic.wait(begin[name] + 6)[begin[name] :]
        stamps = [message.header.stamp.to_sec() for message in messages]
        gaps_s = [after - before for before, after in zip(stamps, stamps[1:])]
        assert median(gaps_s) > SONAR_CYCLE_S / 2, gaps_s
        assert min(gaps_s) < 1.5 * SONAR_CYCLE_S, gaps_s
        assert messages[-1].header.frame_id == f"{robot.name}/sonar_{name}"


def test_battery_is_full(robot):
    message = robot.battery.wait()[-1]
    assert message.present
    assert 9.0 < message.voltage < 15.0
    assert 0.0 < message.percentage <= 1.0


@pytest.mark.realtime
def test_command_is_on_the_wire_at_once(robot):
    """The median of 9."""
    lates_s = []
    for _ in range(9):
        since = time.monotonic()
        robot.cmd_vel.publish(forward(0.1))
        lates_s.append(robot.wire.wait_for(MOVE, since) - since)
    require_median(lates_s, AT_ONCE_S, "a command's way to the wire")


def warned(robot, words, message):
    """Publishes `message` again and again until the node has warned; its warnings, and the time it took [s]."""

    def warnings():
        return sum(words in line for line in robot.process.output())

    before, since = warnings(), time.monotonic()

    def has_warned():
        for _ in range(5):
            robot.cmd_vel.publish(message)
        robot.odom.wait_for_more(2)
        return warnings() > before

    wait_until(has_warned)
    return warnings() - before, time.monotonic() - since


@pytest.mark.parametrize(
    "wrong", [{"speed_m_s": math.nan}, {"speed_m_s": math.inf}, {"speed_m_s": 0.1, "y": math.nan}]
)
def test_command_that_is_no_number_stops_the_robot_with_one_warning_a_second(robot, wrong):
    """Also in a field that the robot does not use."""
    moved = moves(robot, forward(0.1))
    count, took_s = warned(robot, "expected a finite number; the robot was stopped", forward(**wrong))
    robot.wire.wait_for(STOP, moved)
    wait_until(lambda: stopped_by(robot) == StopReason.NOT_A_NUMBER)
    assert count <= 1 + took_s / WARN_EVERY_S


def stopped_by(robot):
    return values_of(robot.status.wait()[-1])["stopped by"]


def at_rest(messages):
    values = values_of(messages[-1]) if messages else {}
    return values.get("moving") == "false" and values["stopped by"] != "none"


def test_sideways_command_is_ignored_with_one_warning_a_second(robot):
    since = time.monotonic()
    count, took_s = warned(robot, "linear.y", forward(0.1, y=0.5))
    robot.wire.wait_for(MOVE, since)
    assert count <= 1 + took_s / WARN_EVERY_S


@pytest.mark.parametrize(
    "given, option, value",
    [
        ({"cmd_vel_timeout": 0.3}, "command_timeout_s", 0.3),
        ({}, "imu_period_ms", 20),
        ({"imu_rate": 100}, "imu_period_ms", 10),
        ({"imu": False}, "imu_period_ms", 0),
        ({"build": "environment"}, "build", "environment"),
    ],
)
def test_driver_has_the_timeout_too(given, option, value):
    """It stops the robot when the node itself is stuck; so for other parameters of the driver."""
    assert getattr(driver_options(check({"port": "/dev/null", **given}, "node")), option) == value


@pytest.mark.realtime
def test_robot_stops_when_commands_end(rig):
    """At another time than that of the default; the median of 5, and never early.

    A stop for another reason (a pause of the computer is one) says so, and is not counted.
    """
    wire = rig.tap(rig.board().port)
    rig.node(wire.port, f"_cmd_vel_timeout:={TIMEOUT_S}")
    status, cmd_vel, took_s = rig.topic("status", DiagnosticStatus), rig.publisher("cmd_vel", Twist), []
    status.wait()

    def drive_and_stop():
        since, said = time.monotonic(), len(status.messages)
        cmd_vel.publish(forward(0.1))
        wait_until(lambda: wire.first(MOVE, since) < math.inf or time.monotonic() > since + TRUSTED_S)
        if wire.first(MOVE, since) == math.inf:
            return False  # a node that has just started refuses a source until it has been silent
        took = wire.wait_for(STOP, wire.wait_for(MOVE, since)) - since
        wait_until(lambda: at_rest(status.messages[said:]), what="a stop with its reason")
        if {values_of(each)["stopped by"] for each in status.messages[said:]} == {"none", "command_timeout"}:
            took_s.append(took)
        return len(took_s) == 5

    wait_until(drive_and_stop)
    assert TIMEOUT_S <= min(took_s), took_s
    require_median(took_s, TIMEOUT_S + TIMEOUT_LATE_S, "the stop of a robot without commands")


@pytest.mark.parametrize(
    "options, exit_code, words",
    [
        ((None,), 2, "/port is missing, expected"),
        (
            ("/dev/null", "_cmd_vel_timeout:=fast"),
            2,
            "/cmd_vel_timeout is 'fast', expected a number from 0.05",
        ),
        (("/dev/null", "_robot:=tank"), 2, "'tank' is unknown, expected"),
        (("/dev/not_there",), 3, "does not exist"),
    ],
    ids=["no port", "text for a number", "unknown robot", "port not there"],
)
def test_bad_parameter_ends_the_node_with_one_line(rig, options, exit_code, words):
    node = rig.node(*options)
    assert node.wait(START_S)
    assert node.exit_code == exit_code
    assert len(node.output()) == 1
    assert words in node.output()[0]


def test_node_waits_for_a_port_that_is_there_and_cannot_be_opened_yet(rig, tmp_path):
    name, board, odometry = tmp_path / "port", rig.board(), rig.topic("odom", Odometry)
    name.write_text("")
    node = rig.node(str(name), "_port_timeout:=300")
    wait_until(lambda: any("plain file, expected a serial port" in line for line in node.output()))
    (tmp_path / "link").symlink_to(board.port)
    (tmp_path / "link").replace(name)
    odometry.wait()


def test_way_that_the_board_forgot_makes_the_pose_less_sure(rig):
    """A restart takes the counters; the wheels may have gone on for a while."""
    port = rig.board("--robot", "traxbot", "--fault", "reset:at=4,every=8").port
    odometry = rig.topic("odom", Odometry)
    rig.node(port)
    wait_until(lambda: odometry.messages and odometry.messages[-1].pose.covariance[0] > LOST_M2)
