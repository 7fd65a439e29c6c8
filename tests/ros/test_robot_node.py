"""The node on an emulated board: topics, frames, commands."""

import math
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Range
from tf2_msgs.msg import TFMessage

from ros1_bridge.covariance import UNUSED_VARIANCE
from ros1_bridge.parameters import check
from ros1_bridge.processes import wait_until
from ros1_bridge.robot_node import RobotNode

from .rig import START_S, Topic

MOVE, STOP = 11, 13
FRAME_HZ = 50
SONAR_CYCLE_S = 0.3
TIMEOUT_S = 0.5
TIMEOUT_LATE_S = 0.05
BUSY_TRIES = 10
"""A machine that is busy with other tests may be late itself, but not each time."""


def forward(speed_m_s, **unused):
    return Twist(Vector3(speed_m_s, unused.get("y", 0.0), 0.0), Vector3())


def of_frame(topic: Topic, child: str):
    """Transforms to a frame on /tf or /tf_static, which all tests share."""
    return [t for message in topic.messages for t in message.transforms if t.child_frame_id == child]


@pytest.fixture(scope="module")
def robot(module_rig):
    """A running node; its rig, the tap on its wire, its topics."""
    rig = module_rig
    rig.wire = rig.tap(rig.board().port)
    rig.odom = rig.topic("odom", Odometry)
    rig.tf, rig.mounts = rig.topic("/tf", TFMessage), rig.topic("/tf_static", TFMessage)
    rig.sonars = {name: rig.topic(f"sonar/{name}", Range) for name in ("front", "left", "right")}
    rig.battery = rig.topic("battery", BatteryState)
    rig.diagnostics = rig.topic("/diagnostics", DiagnosticArray)
    rig.process = rig.node(rig.wire.port)
    rig.odom.wait()
    rig.cmd_vel = rig.publisher("cmd_vel", Twist)
    return rig


def test_odometry_comes_at_the_rate_of_the_stream(robot):
    """By the stamps, which are those of the frames, not of their arrival."""
    begin = len(robot.odom.wait())
    stamps = [message.header.stamp.to_sec() for message in robot.odom.wait(begin + FRAME_HZ // 2)[begin:]]
    assert (len(stamps) - 1) / (stamps[-1] - stamps[0]) == pytest.approx(FRAME_HZ, rel=0.2)


def test_frames_are_those_of_the_parameters(robot):
    message = robot.odom.wait()[-1]
    assert message.header.frame_id == f"{robot.name}/odom"
    assert message.child_frame_id == f"{robot.name}/base_link"


def test_covariances_suit_a_filter(robot):
    message = robot.odom.wait()[-1]
    for covariance in (message.pose.covariance, message.twist.covariance):
        assert all(0 < covariance[7 * i] <= UNUSED_VARIANCE for i in range(6))


def test_stamps_never_repeat(robot):
    stamps = [message.header.stamp for message in robot.odom.wait(50)]
    assert all(a < b for a, b in zip(stamps, stamps[1:]))


def test_transform_equals_odometry(robot):
    robot.odom.wait(20)
    poses = {m.header.stamp: m.pose.pose.position.x for m in robot.odom.messages}
    transforms = [t for t in of_frame(robot.tf, f"{robot.name}/base_link") if t.header.stamp in poses]
    assert transforms
    assert all(t.transform.translation.x == poses[t.header.stamp] for t in transforms)
    assert {t.header.frame_id for t in transforms} == {f"{robot.name}/odom"}


def test_mount_of_each_sonar_is_a_static_transform(robot):
    robot.mounts.wait()
    left = of_frame(robot.mounts, f"{robot.name}/sonar_left")[-1]
    assert left.header.frame_id == f"{robot.name}/base_link"
    assert (left.transform.translation.x, left.transform.translation.y) == (0.08, 0.06)


def test_sonars_are_published_once_for_each_reading(robot):
    """The world stands still, so each sonar has one reading for each cycle of the chain."""
    begin = {name: len(topic.arrived) for name, topic in robot.sonars.items()}
    robot.odom.wait(len(robot.odom.arrived) + round(5 * SONAR_CYCLE_S * FRAME_HZ))
    for name, topic in robot.sonars.items():
        assert 4 <= len(topic.arrived) - begin[name] <= 8
        assert topic.messages[-1].header.frame_id == f"{robot.name}/sonar_{name}"


def test_battery_is_full(robot):
    message = robot.battery.wait()[-1]
    assert message.present
    assert 9.0 < message.voltage < 15.0
    assert 0.0 < message.percentage <= 1.0


def test_diagnostics_tell_of_the_link(robot):
    robot.diagnostics.wait()
    status = next(s for s in robot.diagnostics.messages[-1].status if s.name.endswith(": Link"))
    values = {pair.key: pair.value for pair in status.values}
    assert values["Serial Port"] == robot.wire.port
    assert values["Device ID"] == "1"


def test_command_is_on_the_wire_at_once(robot):
    """Mostly: the machine may be busy."""
    lates_s = []
    for _ in range(5):
        since = time.monotonic()
        robot.cmd_vel.publish(forward(0.1))
        lates_s.append(robot.wire.wait_for(MOVE, since) - since)
    assert sorted(lates_s)[1] < 0.1


def test_robot_follows_the_command(robot):
    begin = robot.odom.messages[-1].pose.pose.position.x

    def driven():
        robot.cmd_vel.publish(forward(0.2))
        time.sleep(0.05)
        return robot.odom.messages[-1].pose.pose.position.x > begin + 0.05

    assert wait_until(driven, START_S)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_command_that_is_no_number_stops_the_robot_with_one_warning_a_second(robot, value):
    def warnings():
        return sum(
            "expected a finite number; the robot was stopped" in line for line in robot.process.output()
        )

    before = warnings()
    robot.cmd_vel.publish(forward(0.1))
    since = time.monotonic()
    robot.wire.wait_for(MOVE, since - 0.1)
    for _ in range(5):
        robot.cmd_vel.publish(forward(value))
        time.sleep(0.02)
    assert robot.wire.wait_for(STOP, since) - since < TIMEOUT_S / 2
    assert wait_until(lambda: warnings() >= 1, START_S)
    assert warnings() - before <= 1


def test_sideways_command_is_ignored_with_one_warning(robot):
    since = time.monotonic()
    for _ in range(5):
        robot.cmd_vel.publish(forward(0.1, y=0.5))
        time.sleep(0.05)
    assert robot.wire.wait_for(MOVE, since) < math.inf

    def warnings():
        return sum("linear.y" in line for line in robot.process.output())

    assert wait_until(lambda: warnings() > 0, START_S)
    assert warnings() == 1


def test_driver_has_the_timeout_too():
    """It stops the robot when the node itself is stuck."""
    node = RobotNode(check({"port": "/dev/null", "cmd_vel_timeout": 0.3}, "node"))
    assert node._driver._options.command_timeout_s == 0.3


def test_robot_stops_when_commands_end(rig):
    """At another time than that of the default."""
    timeout_s = 0.8
    wire = rig.tap(rig.board().port)
    rig.node(wire.port, f"_cmd_vel_timeout:={timeout_s}")
    cmd_vel = rig.publisher("cmd_vel", Twist)
    took_s = []
    while not took_s or (min(took_s) >= timeout_s + TIMEOUT_LATE_S and len(took_s) < BUSY_TRIES):
        since = time.monotonic()
        cmd_vel.publish(forward(0.1))
        moved = wire.wait_for(MOVE, since, START_S)
        took_s.append(wire.wait_for(STOP, moved, START_S) - since)
    assert timeout_s <= min(took_s) < timeout_s + TIMEOUT_LATE_S


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
        (("/tmp",), 3, "is a folder"),
    ],
    ids=["no port", "text for a number", "unknown robot", "port not there", "folder"],
)
def test_bad_parameter_ends_the_node_with_one_line(rig, options, exit_code, words):
    node = rig.node(*options)
    assert node.wait(START_S)
    assert node.exit_code == exit_code
    assert len(node.output()) == 1
    assert words in node.output()[0]
