"""What robot_node does, on an emulated board in simulated time; ROS keeps what it is told, and no process starts."""

import dataclasses
import math
import os
import signal
import sys
import threading
from types import SimpleNamespace
from unittest import mock

import pytest
import rosgraph
import rospy
from actionlib_msgs.msg import GoalID
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from dynamic_reconfigure.msg import ParamDescription
from dynamic_reconfigure.server import Server
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    PoseWithCovarianceStamped,
    Quaternion,
    Twist,
    TwistStamped,
    Vector3,
)
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float64, Header

from mrl_driver import geometry
from mrl_driver.driver import suspension
from mrl_driver.driver.options import QUEUED_S, Options
from mrl_driver.driver.parameters import Parameters
from mrl_driver.errors import BoardTimeout, LinkLost
from mrl_driver.recording.recording import Recording
from mrl_driver.robot import models, wirings
from mrl_driver.robot.inputs import Inputs
from mrl_driver.robot.models import Limits, kit
from mrl_driver.robot.radio import RadioNode
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.session.events import Awaited, Lost, Ready
from ros1_bridge.control.commander import Commander
from ros1_bridge.node import run_node
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.robot_parameters import check
from ros1_bridge.node.run_node import RESPAWN, RETRY_S
from ros1_bridge.robot import reconfigure, zone_topics
from ros1_bridge.robot.reconfigure import Description
from ros1_bridge.robot.robot_node import driver_options
from tests.models import without_encoders
from tests.waiting import wait_until

from . import node_bench
from .node_bench import NAME, PORT, ROS_S, WALL_S, Bench
from .tables import first_two, table

EVERYTHING = {"allow_calibration": True, "allow_gains": True, "zones": "both"}
TURN_S = 0.2
HUGE = 1 << 21  # bytes of a huge page


@pytest.fixture
def node(monkeypatch):
    return Bench(monkeypatch)


def twist(forward=0.0, angular_z=0.0, **linear):
    return Twist(Vector3(forward, linear.get("y", 0.0), linear.get("z", 0.0)), Vector3(0.0, 0.0, angular_z))


def turns(count):
    return iter(range(count))


def until_offered():
    """Turns until dynamic_reconfigure is offered, two seconds after the start."""
    return turns(11)


def kinds(made):
    return {name.replace("~", "robot_node/"): each.kind._type for name, each in made.items()}


# -- what it offers


def test_topics_and_services_are_those_of_the_readme(node):
    assert node.run(until_offered, given=EVERYTHING, imu=True) == 0
    ros = node.ros
    assert kinds(ros.topics) == first_two(table("### Published topics", "topic"))
    assert kinds(ros.inputs) == first_two(table("### Subscribed topics", "topic"))
    assert kinds(ros.services) == first_two(table("### Services", "service"))


def test_dynamic_reconfigure_comes_later(node):
    def script():
        yield from turns(9)
        assert "~limits/set_parameters" not in node.ros.services
        yield from turns(2)
        assert "~limits/set_parameters" in node.ros.services

    node.run(script)


def test_a_command_waits_for_no_other_and_for_no_full_packet(node):
    node.run(given={"zones": "scan"})
    assert {name: each.options for name, each in node.ros.inputs.items()} == {
        **{
            name: {"queue_size": 10, "tcp_nodelay": True}
            for name in ("cmd_vel", "cmd_vel/stamped", "cmd_vel/ping")
        },
        "scan": {"queue_size": 1, "tcp_nodelay": True},
        **{name: {"queue_size": 1} for name in ("pose", "set_pose")},
    }
    assert node.ros.topics["cmd_vel/echo"].options == {"queue_size": 10, "tcp_nodelay": True}


WITHOUT = {
    "odometry": ({"odom", "/tf", "joint_states", "encoders"}, {"set_pose"}, {"reset_odometry"}),
    "commands": (
        {"manual_mode", "move_base/cancel", "cmd_vel/echo"},
        {"cmd_vel", "cmd_vel/stamped", "cmd_vel/ping", "pose"},
        {"stop", "release_stop", "enable_motors", "manual_mode"},
    ),
    "status": ({"markers", "/diagnostics", "status", "battery_state"}, set(), set()),
    "sensors": ({"imu/data", "xbee/received"}, {"xbee/send"}, {"xbee/discover"}),
}


@pytest.mark.parametrize("left_out", [None, *WITHOUT])
def test_a_part_that_is_not_named_is_not_there(node, left_out):
    parts = [part for part in ("odometry", "sonars", "commands", "status", "sensors") if part != left_out]
    node.run(until_offered, given={"parts": ", ".join(parts)}, imu=True, radio="auto")
    ros = node.ros
    for part, names in WITHOUT.items():
        for there, some in zip((ros.topics, ros.inputs, ros.services), names):
            assert some & set(there) == (set() if part == left_out else some)
    opt_ins = {"calibrate", "~gains/set_parameters"}
    assert not opt_ins & set(ros.services) and "shutdown" in ros.services
    assert ("release_hold" in ros.services) == (left_out != "commands")


@pytest.mark.parametrize("robot", ["pioneer", "without encoders"])
def test_a_robot_without_motors_or_encoders_has_no_odometry(node, robot, tmp_path):
    name = robot if robot == "pioneer" else without_encoders(tmp_path)

    def script():
        if robot != "pioneer":
            node.publish("pose", pose(1.0, "base_link"))
            assert node.levels("pose refused: robot duo has no odometry") == ["warn"]
            yield from node.commands(twist(0.1))
            assert node.driver.command == (0.1, 0.0)

    assert node.run(script, given={"robot": name}, robot=name) == 0
    assert not {"odom", "/tf", "joint_states", "encoders", "imu/data"} & set(node.ros.topics)
    assert "reset_odometry" not in node.ros.services and "set_pose" not in node.ros.inputs
    sensors = {"alcohol", "compass", "dust", "light", "thermopile", "/diagnostics"}
    assert (node.ros.topics.keys() == sensors) == (robot == "pioneer")
    assert ("markers" in node.ros.topics) == ("cmd_vel" in node.ros.inputs) == (robot != "pioneer")
    assert len(node.lines("no motors: its sensors")) == (robot == "pioneer")
    assert len(node.lines("there is no odometry")) == (robot != "pioneer")


@pytest.mark.parametrize("profile, given", [("current", {}), ("2013-august", {"build": "environment"})])
def test_a_board_with_environment_sensors_publishes_them_beside_odometry(node, profile, given):
    """One of 2013 has no compass, and no rate."""
    sensors = first_two(table("in place of the sonars", "topic"))
    old = profile != "current" and sensors.pop("compass")
    node.run(lambda: turns(10), given=given, environment=True, profile=profile)
    topics = kinds(node.ros.topics)
    assert all(node.sent(name) for name in sensors)
    assert {"odom", *sensors} <= topics.keys() and ("compass" in topics) == (not old)
    assert not [name for name in topics if name.startswith("sonar/")]


def test_options_of_the_driver_are_the_parameters(tmp_path):
    """The driver has the timeout too: it stops the robot when the node itself is stuck."""
    path = str(tmp_path / "run.mrl")
    given = {
        **{"rate": 1, "cmd_vel_timeout": 0.3, "ignore_battery": True, "build": "sonar", "imu_rate": 25.33},
        **{"port_timeout": 9, "reconnect": False, "fast": True, "record": path},
    }
    expected = Options(
        **{"period_ms": 1000, "command_timeout_s": 0.3, "queued_s": QUEUED_S, "ignore_battery": True},
        **{"build": "sonar", "port_timeout_s": 9.0, "fast": True, "imu_period_ms": 39, "record": path},
    )
    parameters = dataclasses.replace(check({"port": PORT, **given}, "/n"), robot_id=7)
    assert driver_options(parameters) == expected._replace(robot_id=7)
    usual = driver_options(check({"port": PORT, "imu": False}, "/n"))
    assert usual == Options(queued_s=QUEUED_S, port_timeout_s=2.0, reconnect=True, imu_period_ms=0)


def test_the_driver_gets_port_robot_and_baud_and_is_served_at_once(node):
    """Not after the 5 ms for which Python lets another thread run."""

    def script():
        assert sys.getswitchinterval() == 0.0005

    node.run(script, given={"robot": "traxbot", "baud": 57600, "rate": 20})
    port, robot, baud, options = node.opened
    assert (port, robot, baud, options.period_ms) == (PORT, "traxbot", 57600, 50)


# -- commands


@pytest.mark.parametrize(
    "robot, message, command, ignored",
    [
        ("traxbot", twist(0.1, 0.2), (0.1, 0.2), ""),
        ("traxbot", twist(0.1, y=0.5), (0.1, 0.0), "linear.y"),
        ("traxbot", twist(0.1, z=0.5), (0.1, 0.0), "linear.z"),
        ("traxbot", Twist(Vector3(0.1, 0.0, 0.0), Vector3(1.0, 0.0, 0.0)), (0.1, 0.0), "angular.x"),
        ("traxbot", Twist(Vector3(0.1, 0.0, 0.0), Vector3(0.0, 1.0, 0.0)), (0.1, 0.0), "angular.y"),
        ("omni", twist(0.1, y=0.05), (0.1, 0.0, 0.05), ""),
        ("omni", twist(0.1, z=0.5, y=0.05), (0.1, 0.0, 0.05), "linear.z"),
        ("traxbot", twist(0.1, math.nan), None, ""),
        ("traxbot", twist(0.1, z=math.nan), None, ""),
    ],
)
def test_a_command_moves_the_robot_as_far_as_its_drive_can_follow(node, robot, message, command, ignored):
    """One that is not finite stops it, also in a field that the drive does not use."""

    def script():
        yield from node.commands(twist(0.1))
        yield from node.commands(message)
        assert node.driver.command == (command and pytest.approx(command))
        yield
        said = node.lines("ignored: the robot follows ")
        axes = "linear.x, linear.y and angular.z" if robot == "omni" else "linear.x and angular.z"
        line = f"cmd_vel {ignored} ignored: the robot follows {axes} alone"
        assert set(said) == ({("warn every 1 s", line)} if ignored else set())
        stopped = node.lines("expected a finite number; the robot was stopped")
        assert bool(stopped) == (command is None) and {level for level, _ in stopped} <= {"warn every 1 s"}
        assert not stopped or node.status()["stopped by"] == "not_a_number"

    assert node.run(script, robot=robot) == 0


def test_a_stop_that_the_next_command_ends_at_once_is_published(node):
    """An operator's page relies on it: the robot must not drive on as if nothing had happened."""

    def script():
        yield from node.commands(twist(0.1))
        before = len(node.sent("status"))
        node.sleep(0.4)
        node.publish("cmd_vel", twist(0.1))
        assert "command timeout" in node.sent("status")[before].message

    node.run(script, given={"cmd_vel_timeout": 0.3, "cmd_vel_pause": 0.0})


def test_commands_that_a_network_held_back_stop_the_robot(node):
    """They arrive at once when it is back; the sender may have stopped long ago."""

    def script():
        yield from node.commands(twist(0.2))
        yield from turns(150)
        for _ in range(10):
            node.publish("cmd_vel", twist(0.2))
            node.sleep(2e-4)
        yield
        assert node.driver.command is None and node.status()["stopped by"] == "command_too_late"
        assert node.lines("as if a network had held them back")
        yield from node.commands(twist(0.2))
        assert node.driver.command is not None

    node.run(script)


def test_a_refused_command_is_named_and_one_to_a_lost_robot_is_not(node, monkeypatch):
    def script():
        node.call("enable_motors", False)
        node.publish("cmd_vel", twist(0.1))
        assert node.levels("cmd_vel refused: the motors are disabled") == ["warn every 1 s"]
        assert node.status()["stopped by"] == "motors_disabled"
        yield
        count = len(node.ros.said)
        monkeypatch.setattr(node.driver, "drive", fail(LinkLost("gone")))
        node.publish("cmd_vel", twist(0.1))
        assert len(node.ros.said) == count

    node.run(script)


def fail(error):
    def raise_it(*_, **__):
        raise error

    return raise_it


def stamped(stamp_s, forward, name="desk"):
    message = TwistStamped(Header(0, rospy.Time.from_sec(stamp_s), name), twist(forward))
    return "cmd_vel/stamped", message


def test_a_late_command_of_an_operator_stops_the_robot_and_has_no_echo(node):
    def script():
        for n in range(5):
            node.publish(*stamped(10.0 + n * TURN_S, 0.1))
            yield
        assert node.driver.command[0] == 0.1
        assert [header.frame_id for header in node.sent("cmd_vel/echo")] == ["desk"] * 5
        node.publish(*stamped(5.0, 0.1))
        yield
        words = "expected at most 1.0 s (~max_command_delay): not followed, 1 so far"
        assert node.levels(words) == ["warn every 1 s"] and len(node.sent("cmd_vel/echo")) == 5
        assert (node.driver.command, node.status()["stopped by"]) == (None, "command_too_late")
        node.publish(*stamped(5.0, 0.0))
        assert len(node.sent("cmd_vel/echo")) == 6, "no stop is too late"
        yield from turns(6)
        (motion,) = [each for each in node.sent("/diagnostics")[-1].status if each.name.endswith("Motion")]
        assert KeyValue("Late Commands", "1") in motion.values

    assert node.run(script, given={"max_command_delay": 1.0}, heard=("/diagnostics",)) == 0


def test_a_ping_is_echoed_and_counts_as_the_fastest_message(node):
    def script():
        node.publish("cmd_vel/ping", Header(0, rospy.Time(100), "desk"))
        assert [each.frame_id for each in node.sent("cmd_vel/echo")] == ["desk"]
        node.publish(*stamped(90.0, 0.1))
        assert node.lines("a command arrived 10.0 s late") and node.driver.command is None
        yield
        assert node.status()["stopped by"] == "command_too_late", "though it stood"
        node.publish(*stamped(90.0, 0.1, "sofa"))
        assert node.driver.command

    node.run(script)


def operator(name):
    return lambda node: node.publish(*stamped(node.now() + 1.0, 0.1, name))


def program(name):
    return lambda node: node.publish("cmd_vel", twist(0.1), node=name)


@pytest.mark.parametrize("first, other", [(operator("a"), operator("b")), (program("/a"), program("/b"))])
@pytest.mark.parametrize("pause_s", [0.5, 0.0])
def test_after_a_stop_a_source_that_did_not_notice_it_must_pause(node, first, other, pause_s):
    """Each operator counts by himself, though one node passes all their commands on."""

    def script():
        first(node)
        yield
        assert node.driver.command and node.call("stop").success
        yield
        first(node)
        assert node.driver.command is None and node.call("release_stop").success
        yield
        first(node)
        assert (node.driver.command is None) == bool(pause_s)
        other(node)
        assert node.driver.command

    node.run(script, given={"cmd_vel_pause": pause_s})


def test_a_planner_that_goes_on_moves_nothing_after_the_board_was_silent(node):
    def script():
        yield from node.commands(twist(0.1), 40)
        assert node.lines("cmd_vel refused: its source has sent") and node.driver.command is None
        assert GoalID() in node.sent("move_base/cancel")
        yield from turns(3)
        yield from node.commands(twist(0.1), 1)
        assert node.driver.command

    node.run(script, faults=("freeze:at=2,lasts=2",))


@pytest.mark.parametrize("connects_s", [0.5, 5.0, math.inf])
def test_a_node_that_published_before_this_one_must_pause_after_it_has_connected(node, connects_s):
    """It is waited for, for 2 s, and then for its pause."""
    node.ros.graph[0] = {"cmd_vel": ["/teleop"], "odom": ["/other"]}

    def connect():
        node.ros.inputs["cmd_vel"].impl.connections = [SimpleNamespace(callerid_pub="/teleop")]

    def script():
        assert set(node.sleeps) == {0.02, 0.5}
        assert (
            sum(node.sleeps) == pytest.approx(2.5, abs=0.03) or connects_s == 0.5 and sum(node.sleeps) < 1.1
        )
        while connects_s < math.inf and node.now() < connects_s + 1.0:
            yield
        node.publish("cmd_vel", twist(0.1))
        assert (node.driver.command is None) == (connects_s == math.inf)

    if connects_s < math.inf:
        node.before = lambda: node.later(connects_s, connect)
    node.run(script)


# -- poses


def pose(x_m, frame):
    return PoseStamped(Header(frame_id=frame), Pose(Point(x_m, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0)))


def placed(x_m, frame):
    message = PoseWithCovarianceStamped(header=Header(frame_id=frame))
    message.pose.pose = pose(x_m, "").pose
    return message


def test_the_robot_drives_to_a_pose_in_the_frames_of_the_parameters(node):
    def script():
        node.publish("set_pose", placed(5.0, "r/odom"))
        node.publish("pose", pose(0.1, "r/base"))
        while not node.lines("the pose is reached"):
            assert node.now() < 30.0
            yield
        assert node.driver.pose.x_m == pytest.approx(5.1, abs=0.05)
        node.publish("pose", pose(0.0, "map"))
        assert node.lines("pose refused: pose is in 'map', expected r/odom (absolute) or r/base (relative)")

    node.run(script, given={"odom_frame": "r/odom", "base_frame": "r/base"})
    assert not node.lines("without seeing obstacles")


def test_a_board_without_sonars_says_once_that_it_sees_no_obstacles(node):
    def script():
        for _ in range(2):
            node.publish("pose", pose(1.0, "base_link"))
            yield
        assert node.status()["mode"] == "pose"

    node.run(script, environment=True)
    assert node.levels("to poses without seeing obstacles") == ["warn"]


@pytest.mark.parametrize("end", ["late command", "lost robot"])
def test_a_drive_to_a_pose_ends(node, monkeypatch, end):
    def script():
        node.publish("cmd_vel/ping", Header(0, rospy.Time(100), "desk"))
        node.publish("pose", pose(1.0, "base_link"))
        yield
        assert node.driver.command and node.status()["mode"] == "pose"
        if end == "late command":
            node.publish(*stamped(5.0, 0.1))
        else:
            monkeypatch.setattr(node.driver, "drive", fail(LinkLost("gone")))
        yield
        yield
        assert node.driver.command is None or end == "lost robot"
        assert node.status()["mode"] == ("drive" if end == "late command" else "pose")

    assert node.run(script) == 0


@pytest.mark.parametrize(
    "frame, level, words",
    [("odom", "info", "the pose is 2, 0, 0"), ("map", "warn", "set_pose refused: the pose is in 'map'")],
)
def test_a_pose_that_is_set_is_logged(node, frame, level, words):
    def script():
        node.publish("set_pose", placed(2.0, frame))
        assert [(said, text[: len(words)]) for said, text in node.lines(words)] == [(level, words)]

    node.run(script)


# -- services, modes and limits


def test_services_answer_and_tell_the_state_at_once(node):
    def script():
        assert node.call("calibrate").success
        for name, args, cause in (
            ("stop", (), "emergency_stop"),
            ("release_stop", (), "emergency_stop"),
            ("enable_motors", (False,), "motors_disabled"),
            ("manual_mode", (True,), "motors_disabled"),
        ):
            before = len(node.sent("status"))
            answer = node.call(name, *args)
            assert answer.success and answer.message and len(node.sent("status")) == before + 1
            assert name == "release_stop" or node.status()["stopped by"] == cause

    node.run(script, given={"allow_calibration": True})


def test_the_service_shutdown_stops_the_robot_and_answers_before_the_node_ends(node):
    def script():
        yield from node.commands(twist(0.1))
        answer = node.call("shutdown")
        assert (answer.success, answer.message) == (True, "stopped; the node closes the port and ends")
        assert node.driver.command is None and not node.ros.ended
        yield
        yield
        pytest.fail("the node goes on")

    assert node.run(script) == 0 and node.ros.ended == "the service shutdown was called"


def test_a_shutdown_that_cannot_reach_the_robot_says_so(node, monkeypatch):
    def script():
        monkeypatch.setattr(node.driver, "inhibit", fail(LinkLost("gone")))
        answer = node.call("shutdown")
        assert not answer.success and answer.message.endswith("gone; the node ends")

    node.run(script)


LIMITS = Limits(0.2, 0.8, 0.1, 0.5)
LOWER = dict(zip(reconfigure.LIMITS, LIMITS))


@pytest.mark.parametrize(
    "given, manual, limits, speed",
    [
        ({}, False, Limits(0.3, 1.0, 0.2, 1.0), 0.15),
        (LOWER, False, LIMITS, 0.15),
        ({"operation_mode": "manual", "manual_speed": 0.05}, True, Limits(0.3, 1.0, 0.2, 1.0), 0.05),
    ],
)
def test_limits_and_mode_begin_with_the_parameters(node, given, manual, limits, speed):
    model = models.load("traxbot").limits

    def script():
        assert node.sent("manual_mode") == [manual]
        assert (node.status()["operation mode"] == "manual") == manual
        yield from until_offered()
        now = node.configure("limits")
        assert [now[name] for name in LOWER] == list(limits[:4])
        assert node.call("manual_mode", True).message.startswith(f"manual mode: at most {speed:g} m/s")
        assert node.ros.parameters["~operation_mode"] == "manual"

    node.run(script, given=given)
    described = node.sent("~limits/parameter_descriptions")[0]
    assert {each.type for each in described.groups[0].parameters} == {"double"}
    assert {each.name: each.value for each in described.max.doubles} == dict(zip(LOWER, model))


STOPS = pytest.mark.parametrize(
    "stop, release, name, stopped",
    [
        (("stop",), ("release_stop",), "emergency_stop", True),
        (("enable_motors", False), ("enable_motors", True), "motors_enabled", False),
    ],
)


@STOPS
def test_a_stop_is_kept_for_a_respawn_until_its_release(node, stop, release, name, stopped):
    def script():
        for service, value in ((stop, stopped), (release, not stopped)):
            node.call(*service)
            yield
            assert node.ros.parameters[f"~{name}"] is value

    node.run(script)


@STOPS
def test_a_node_that_was_stopped_before_its_start_moves_after_the_release(node, stop, release, name, stopped):
    def script():
        node.publish("cmd_vel", twist(0.1))
        assert node.driver.command is None
        assert node.call(*release).success
        node.publish("cmd_vel", twist(0.1), node="/other")
        assert node.driver.command

    node.run(script, given={name: stopped})


def test_a_shutdown_is_no_stop_for_the_next_start(node):
    def script():
        node.call("shutdown")
        yield

    node.run(script)
    assert "~emergency_stop" not in node.ros.parameters


def test_limits_of_an_earlier_run_do_not_count(node):
    node.ros.parameters["~limits/max_linear_speed"] = node.ros.parameters["~sonars/clear_range"] = 0.02

    def script():
        yield from until_offered()
        assert node.configure("limits", max_angular_speed=0.5)["max_linear_speed"] == 0.3
        assert node.driver.limits[:2] == (0.3, 0.5)
        assert node.configure("limits", max_linear_speed=math.nan)["max_linear_speed"] == 0.3
        assert node.configure("limits", max_angular_speed=0.0)["max_angular_speed"] == 0.01
        with pytest.raises(rospy.ServiceException, match="max_linear_speed is 'fast', expected a number"):
            node.configure("limits", max_linear_speed="fast")
        assert node.driver.limits[:2] == (0.3, 0.01)
        assert "~clear_range" not in node.ros.parameters
        assert node.configure("sonars") == {"clear_range": 4.0}
        for given, now in ((3.0, 3.0), (math.nan, 3.0), (9.0, 6.45)):
            assert node.configure("sonars", clear_range=given)["clear_range"] == now
            assert node.ros.parameters["~clear_range"] == now
        yield from turns(4)

    node.run(script, given={"clear_range": 4.0}, heard=("sonar/front",), world="square")
    assert node.sent("sonar/front")[-1].max_range == pytest.approx(6.45)


def test_limits_that_were_set_are_those_of_a_node_that_starts_again(node):
    def script():
        yield from until_offered()
        assert "~max_linear_speed" not in node.ros.parameters
        node.configure("limits", max_linear_speed=0.12)
        assert node.ros.parameters["~max_linear_speed"] == 0.12
        assert "~max_angular_speed" not in node.ros.parameters

    node.run(script)


def test_gains_are_the_boards_and_are_stored_there(node, monkeypatch):
    def script():
        gains = {"kp": 700, "ki": 400, "kd": 200}
        yield from until_offered()
        assert {name: node.configure("gains")[name] for name in gains} == gains
        assert node.configure("gains", kp=650)["kp"] == 650
        assert node.levels("gains are 650, 400, 200") == ["info"]
        yield
        monkeypatch.setattr(node.driver, "request", fail(LinkLost("gone")))
        assert node.configure("gains", kp=1, ki=2)["kp"] == 650 and ("err", "gone") in node.ros.said

    node.run(script, given={"allow_gains": True})
    described = node.sent("~gains/parameter_descriptions")[0]
    (group,) = described.groups
    assert (group.name, group.type, group.parent, group.id) == ("Default", "", 0, 0)
    assert group.parameters == [
        ParamDescription(name, "int", 1, f"{kind} gain of the motor board; stored there", "")
        for name, kind in (("kp", "Proportional"), ("ki", "Integral"), ("kd", "Derivative"))
    ]
    assert {each.value for each in described.min.ints} == {0}
    assert {each.value for each in described.max.ints} == {32767}


def test_gains_that_cannot_be_read_are_not_offered(node):
    node.before = lambda: setattr(node.driver, "ask", fail(BoardTimeout("silent")))
    node.run(until_offered, given={"allow_gains": True})
    assert node.levels("gains are not offered, because those of the board cannot be read: silent") == ["err"]
    assert "~gains/set_parameters" not in node.ros.services


# -- what it says


def test_the_first_lines_name_robot_board_and_battery(node, tmp_path):
    path = str(tmp_path / "drive.mrl")

    def script():
        yield from node.commands(twist(0.1))

    node.run(script, given={"record": path}, battery=12.0)
    (text,) = [text for level, text in node.lines("traxbot (robot id 1, firmware ") if level == "info"]
    assert f" on {PORT} at 115200 baud, battery 1" in text
    assert node.levels(f"recording to {path}") == ["info"]
    remarks = [each.data.split(b" ")[0] for each in Recording(path) if each.direction == "!"]
    assert b"clock" in remarks, "the clock of the stamps is in the recording"
    assert not node.lines("is not complete")


@pytest.mark.parametrize(
    "given, board, words",
    [
        ({}, {"profile": "2013-august"}, "this board of 2013 is taken to have sonars"),
        ({"build": "environment"}, {}, "sonar"),
        ({}, {}, "/amcl, /hector was here before this node, whose odometry begins at 0, 0, 0"),
        ({}, {}, "/ekf publishes odometry/filtered: if it also publishes odom to base_link on /tf"),
    ],
)
def test_a_node_begins_with_its_warnings(node, given, board, words):
    if "/amcl" in words:
        node.ros.graph[1] = {"initialpose": ["/hector", "/amcl"]}
    if "/ekf" in words:
        node.ros.graph[0] = {"odometry/filtered": ["/ekf"]}
    node.run(given=given, **board)
    assert node.levels(words) == ["warn"]
    assert node.ros.asked == 1, "the state of a large system takes long"


@pytest.mark.parametrize(
    "sonar_a, zones, warned", [(14000, "sonars", 1), (11900, "both", 0), (14000, "scan", 0)]
)
def test_zones_by_sonars_warn_of_another_curve_on_the_board(node, sonar_a, zones, warned):
    node.before = lambda: node.emulated.engine.config.__setitem__("sonar_a", sonar_a)
    node.run(given={"zones": zones})
    long = "the sonars' curve is not that of the model traxbot: at 1 m ranges are 19 % long; if the model is right: "
    assert (
        node.levels(long + "mrl config set sonar_a 11767 sonar_b 9466 sonar_c -3759 --port")
        == ["warn"] * warned
    )


def test_a_board_that_does_not_answer_for_a_warning_does_not_end_the_node(node, monkeypatch):
    monkeypatch.setattr(Parameters, "curve_warning", mock.Mock(side_effect=BoardTimeout("no answer")))
    assert node.run(given={"zones": "sonars"}) == 0


@pytest.mark.parametrize("parts, code", [("odometry status", 0), ("all", 1)])
def test_only_a_node_with_commands_needs_a_master_that_answers(node, parts, code):
    """It must know who has published commands before."""
    node.ros.no_master = ConnectionRefusedError("refused")
    assert node.run(given={"parts": parts}) == code
    assert node.levels("the ROS master does not answer") == ["fatal"] * code


@pytest.mark.parametrize("respawn, waits", [("true", True), ("false", False)])
def test_a_node_with_a_wrong_parameter_is_not_started_again_and_again(node, monkeypatch, respawn, waits):
    """roslaunch would start it again whatever its exit code is; the shutdown ends the wait."""
    monkeypatch.setenv(RESPAWN, respawn)
    waited = []
    monkeypatch.setattr(run_node, "wait_until", lambda *args: waited.append(args))
    assert node.run(given={"parts": "wings"}) == 2
    assert waited == [(rospy.is_shutdown, RETRY_S)] * waits
    assert len(node.lines("; it is tried again in 30 s")) == waits
    assert node.levels("parts is 'wings'") == ["fatal"]


def test_an_odometry_that_others_use_is_not_reset(node):
    node.ros.graph[:] = {"initialpose": ["/rviz"]}, {"initialpose": ["/amcl"]}

    def script():
        answer = node.call("reset_odometry")
        assert not answer.success and answer.message.startswith("/amcl would")
        node.ros.no_master = ConnectionRefusedError()
        assert node.call("reset_odometry").success, "without a master nobody is known"

    node.run(script)
    node.ros.no_master = None


@pytest.mark.parametrize(
    "event, level, words, ends",
    [
        (Lost(PORT, "the cable is out"), "err", "the cable is out", False),
        (Ready(None, restarted=True, checked=True), "warn", "the board has restarted", True),
        (Ready(None, restarted=True, checked=False), "info", "the board answers again", False),
        (Ready(None, restarted=False, checked=True), "info", "the board answers again", False),
        (Inputs(("emergency_stop",), True), "err", "emergency stop is pressed", True),
        (Inputs(("bumper_left",), False), "warn", "bumper left is hit", False),
        (Mismatch("left", "blocked", 0.1, 0.0), "err", "left wheel moved 0 mm", True),
        (Awaited(PORT, "busy"), None, "busy", False),
    ],
)
def test_what_happens_to_the_robot_is_logged_and_ends_goals_where_it_stands(node, event, level, words, ends):
    def script():
        before = len(node.sent("move_base/cancel"))
        node.driver.tell(event)
        assert node.levels(words) == ([level] if level else [])
        assert len(node.sent("move_base/cancel")) == before + (2 if ends else 0)

    node.run(script)


def test_a_robot_that_cannot_be_stopped_does_not_end_the_node(node, monkeypatch):
    monkeypatch.setattr(Commander, "end_goals", fail(BoardTimeout("silent")))
    monkeypatch.setattr(Commander, "watch_link", fail(BoardTimeout("silent")))

    def script():
        node.driver.tell(Mismatch("left", "blocked", 0.1, 0.0))
        yield from turns(2)

    assert node.run(script) == 0


def test_a_port_that_is_awaited_is_named(node):
    node.before = lambda: node.driver.tell(Awaited(PORT, "busy"))
    node.run(given={"port_timeout": 5.0})
    assert node.levels("busy") == ["warn"]


def test_each_state_of_the_battery_is_logged_once(node):
    def script():
        for volts in (8.2, 7.0, 0.1, 12.0):
            node.emulated.plant.robot.set_battery(volts)
            yield from turns(50)

    node.run(script)
    said = [(level, *text.split(" ")[1:3]) for level, text in node.lines("battery ")[1:]]
    assert said == [("warn", "is", "low"), ("err", "is", "empty"), ("err", "reads", "0.1")]


@pytest.mark.parametrize(("ignored", "drives"), [(False, False), (True, True)])
def test_a_planner_does_not_drive_on_when_an_empty_battery_is_full_again(node, ignored, drives):
    def script():
        yield from node.commands(twist(0.2))
        before = len(node.sent("move_base/cancel"))
        node.emulated.plant.robot.set_battery(7.5)
        yield from node.commands(twist(0.2), turns=100)
        assert node.driver.battery_state == "empty" and (node.driver.command is not None) == ignored
        node.emulated.plant.robot.set_battery(12.0)
        yield from node.commands(twist(0.2), turns=100)
        assert node.driver.battery_state == "ok" and (node.driver.command is not None) == drives
        assert (len(node.sent("move_base/cancel")) == before) == drives

    node.run(script, given={"ignore_battery": ignored})


def test_the_node_looks_at_its_robot_its_master_and_its_recording_now_and_then(node):
    def script():
        begin_s = node.now()
        while node.now() < begin_s + 10.1:
            yield
        node.master.words = "no ROS master answers"
        yield from turns(25)

    node.run(script, given={"record": "/dev/full"}, heard=("/diagnostics", "markers"), imu=True)
    assert set(node.turns) == {TURN_S}
    assert (node.master.looks, node.master.uri) == (4, rosgraph.get_master_uri())
    assert node.lines("no ROS master answers") == [("err", "no ROS master answers")]
    reports = [each for each in node.sent("/diagnostics") if len(each.status) > 1]
    assert len(reports) in (15, 16)
    assert {each.hardware_id for each in reports[-1].status} == {f"{PORT} robot 1"}
    parts = ("Link", "Motion", "Battery", "Board", "IMU")
    assert [each.name for each in reports[-1].status] == [f"bench/robot_node: {part}" for part in parts]
    keys = {pair.key: pair.value for pair in reports[-1].status[0].values}
    assert keys["Serial Port"] == PORT and keys["Firmware Version"] and keys["Computed Latency"]
    assert node.sent("status")[0].hardware_id == f"{PORT} robot 1"
    assert node.sent("status")[0].name == f"{NAME}: status"
    markers = node.sent("markers")
    assert len(markers) > 70 and markers[0].markers[0].header.frame_id == "base_link"
    losses = node.levels("the recording is not complete: /dev/full lacks ")
    assert losses == ["err every 30 s"] * 2, "one at the start, one at the end"
    assert node.status()["protective zone clear"] == "not watched"


def test_while_the_board_is_silent_its_last_values_are_a_warning(node):
    def script():
        yield from turns(30)
        spoken = node.sent("/diagnostics")[-1].status
        yield from turns(15)
        for before, now in zip(spoken, node.sent("/diagnostics")[-1].status):
            old = now.name.split()[-1] in ("Battery", "Board", "IMU")
            assert (before.level, now.level) == (0, 1 if old else 2)
            assert now.message.endswith("; last known: the robot sends no data") == old
            assert [each.key for each in now.values] == [each.key for each in before.values]

    silence = "loss:rate=1,at=6.5,direction=to_host"
    assert node.run(script, heard=("/diagnostics",), imu=True, faults=(silence,)) == 0


def test_nobody_who_listens_costs_no_report(node):
    node.run(lambda: turns(10))
    assert all(len(each.status) == 1 for each in node.sent("/diagnostics"))


@pytest.mark.parametrize("wall", [True, False])
def test_stamps_are_times_of_the_clock_of_ros(node, wall):
    node.ros.wall = wall
    node.run(lambda: turns(3), heard=("odom",))
    for topic in ("odom", "robot_status"):
        stamp_s = node.sent(topic)[-1].header.stamp.to_sec()
        assert stamp_s == pytest.approx((WALL_S if wall else ROS_S) + node.now(), abs=1.0)


def test_planners_that_start_after_the_clock_was_set_back_take_goals(node, monkeypatch):
    """actionlib refuses goals that are older than the last cancel, which is latched."""

    def script():
        yield from turns(2)
        monkeypatch.setattr(node_bench, "WALL_S", WALL_S - 3600.0)
        yield from turns(2)

    node.run(script)
    latched_s = node.sent("move_base/cancel")[-1].stamp.to_sec()
    assert latched_s == pytest.approx(WALL_S - 3600.0 + node.now(), abs=1.0)
    assert node.levels("the clock was set back by 3600 s") == ["warn"]


def test_a_subscriber_that_breaks_off_does_not_end_the_node(node):
    broken, closed = rospy.exceptions.TransportException("gone"), []

    def script():
        node.ros.topics["odom"].impl.connections = [
            SimpleNamespace(write_data=fail(broken), close=lambda: closed.append(True))
        ]
        yield

    assert node.run(script) == 0 and closed


def test_present_objects_lie_in_huge_pages_and_are_not_collected(node):
    """Once, five seconds after the start."""

    def script():
        yield from turns(24)
        assert not node.memory
        yield from turns(10)

    node.run(script)
    *first, (address, size, advice), last = node.memory
    assert (first, size, advice, last) == (["collect", "unfreeze"], HUGE, 25, "freeze")
    assert address <= id(node) < address + HUGE and address % HUGE == 0


# -- how it ends


def test_ctrl_z_stops_the_robot_first(node, monkeypatch):
    monkeypatch.setattr(suspension, "CONFIRM_S", 0.0)
    killed = []

    def script():
        yield from node.commands(twist(0.1))
        monkeypatch.setattr(os, "kill", lambda pid, number: killed.append(number))
        node.handlers[signal.SIGTSTP](signal.SIGTSTP, None)
        assert node.driver.command is None and killed == [signal.SIGSTOP]

    node.run(script)


@pytest.mark.parametrize(
    "failed, ended, code",
    [(True, True, 0), (True, False, LinkLost.exit_code), (False, True, 0), (False, False, 6)],
)
def test_a_lost_robot_ends_the_node_with_its_code_unless_the_node_was_closed(node, failed, ended, code):
    """Not if the driver was closed while it connected, by the shutdown of ROS."""

    def lose():
        node.driver.failure = LinkLost("gone") if failed else None
        if ended:
            node.ros.ended = "signal 2"
        raise LinkLost("gone")

    node.before = lose
    assert node.run() == code
    assert node.lines("gone") == ([("fatal", LinkLost("gone").line)] if code else [])


# -- zones, planner, radio, servos


@pytest.fixture
def wall(tmp_path):
    """A world with a wall 0.5 m before the robot."""
    path = tmp_path / "wall.yaml"
    path.write_text("walls: [[0.62, -2, 0.62, 2]]\n")
    return str(path)


def test_a_zone_holds_the_robot_before_a_wall_and_is_logged_once(node, wall):
    def script():
        yield from turns(5)
        yield from node.commands(twist(0.3), 30)
        assert node.status()["stopped by"] == "protective_zone"
        assert node.status()["protective zone clear"] == "false" and node.status()["ready"] == "true"
        assert node.sent("protective_field_clear") == [False, True, False]
        state, *zones = node.sent("markers")[-1].markers
        assert (state.text, [each.color.a for each in zones]) == ("stopped by protective zone", [1.0] * 3)
        assert 0.1 < node.driver.pose.x_m < 0.3
        yield from node.commands(twist(-0.1), 5)
        assert node.status()["stopped by"] == "none"
        yield from node.commands(twist(0.3), 30)

    given = {"zones": "sonars", "planner": "none", "zone_protective": 0.3}
    node.run(script, given, heard=("markers",), world=wall)
    assert node.levels("the protective zone holds the robot") == ["warn", "warn"]


PLANNER, MEMORY = "/move_base/planner", "/move_base/planner/zone_limit"


@pytest.mark.parametrize("stored", [None, [0.1, 0.5]])
def test_the_planner_follows_the_zones_and_has_its_own_speed_after_the_end(node, wall, monkeypatch, stored):
    """Also after a node before this one was killed in a zone."""
    monkeypatch.setattr(zone_topics, "STEP_S", 0.001)
    speeds, first = [], stored[0] if stored else 0.5
    own = ("max_vel_x", first), ("min_vel_x", 0.02)
    rows = [Row(name, float, value, "", "", 0.0, 1.0) for name, value in own]
    Server(Description(rows), lambda config, level: (speeds.append(config["max_vel_x"]), config)[1], PLANNER)
    if stored:
        node.ros.parameters[MEMORY] = stored

    def script():
        yield from node.commands(twist(0.3), 15)
        assert ("planner", True) in [(each.name, each.daemon) for each in threading.enumerate()]
        wait_until(lambda: MEMORY in node.ros.parameters and speeds[-1] < 0.3)
        assert node.ros.parameters[MEMORY] == [speeds[-1], 0.5]

    node.run(script, given={"zones": "sonars", "planner": PLANNER}, world=wall)
    assert speeds[-1] == 0.5 and MEMORY not in node.ros.parameters
    assert node.levels("a zone is entered: the planner drives at") == ([] if stored else ["info"])


def test_a_planner_that_cannot_follow_is_named(node, wall, monkeypatch):
    monkeypatch.setattr(zone_topics, "STEP_S", 0.001)
    Server(Description([Row("speed", float, 0.5, "", "", 0.0, 1.0)]), lambda config, level: config, PLANNER)

    def script():
        yield from node.commands(twist(0.3), 15)
        wait_until(lambda: node.lines("does not follow the zones: the planner has no parameter max_vel_x"))

    node.run(script, given={"zones": "sonars", "planner": PLANNER}, world=wall)


def scan(node, range_m, late_s=0.0):
    message = LaserScan(angle_min=-1.0, angle_max=1.0, angle_increment=0.1, range_min=0.02, range_max=4.0)
    message.header.frame_id, message.ranges = "laser", [range_m] * 21
    message.header.stamp = rospy.Time.from_sec(ROS_S + node.now() - late_s)
    node.publish("scan", message)


@pytest.mark.parametrize(
    "mount, late_s, clear",
    [((0.1, 0.0, 0.0), 0.0, "true"), (None, 0.0, "false"), ((0.1, 0.0, 0.0), 9.0, "false")],
)
def test_a_laser_watches_the_zones_once_its_place_is_known(node, monkeypatch, mount, late_s, clear):
    found = mount and geometry.Pose(*mount)
    finder = SimpleNamespace(
        mount=lambda frame: found if frame == "laser" else None, trouble="nobody knows its place"
    )
    bases = []
    monkeypatch.setattr(zone_topics, "MountFinder", lambda base: (bases.append(base), finder)[1])

    def script():
        for _ in range(5):
            scan(node, 3.0, late_s)
            yield
        assert node.status()["protective zone clear"] == clear

    node.run(script, given={"zones": "scan", "planner": "none", "base_frame": "base"})
    assert set(node.levels("scan not used: ")) == (
        set() if clear == "true" else {"warn every 1 s"}
    ) and bases == ["base"]
    assert bool(node.lines("scan not used: nobody knows its place")) == (mount is None)


PEER = 0x0013A20040A1B2C3


def test_a_radio_sends_texts_and_finds_others(node, monkeypatch):
    def script():
        sent, send, radio = [], node.ros.inputs["xbee/send"], node.driver.radio
        assert send.options == {"queue_size": 16, "tcp_nodelay": True}
        monkeypatch.setattr(radio, "send", lambda *text: sent.append(text))
        send.callback(KeyValue("0013a20040a1b2c3", "hello"))
        assert sent == [(PEER, "hello")]
        send.callback(KeyValue("robot", "hello"))
        assert node.levels("xbee/send: radio address is 'robot', expected") == ["warn every 1 s"]
        assert len(sent) == 1
        monkeypatch.setattr(radio, "discover", lambda: [RadioNode(PEER, 0x12), RadioNode(7, 0xFFFE)])
        found = node.call("xbee/discover")
        assert (found.passed, found.id) == (1, "2 radios have answered")
        assert found.status == [
            DiagnosticStatus(0, key, "radio", "", [KeyValue("address", key), KeyValue("network", network)])
            for key, network in (("0013a20040a1b2c3", "0012"), (f"{7:016x}", "fffe"))
        ]
        monkeypatch.setattr(radio, "discover", lambda: [])
        assert "API mode 1" in node.call("xbee/discover").id
        monkeypatch.setattr(radio, "discover", fail(LinkLost("gone")))
        lost = node.call("xbee/discover")
        assert (lost.passed, lost.id, lost.status) == (0, "gone", [])

    node.run(script, radio="auto")
    assert kinds(node.ros.inputs)["xbee/send"] == "diagnostic_msgs/KeyValue"
    assert kinds(node.ros.services)["xbee/discover"] == "diagnostic_msgs/SelfTest"


def test_a_camera_pans_and_tilts_within_its_range(node, tmp_path):
    path = tmp_path / "rover.yaml"
    pins = {**wirings.load("pwm_d5_d6_dir_d4_d7").pins, "pin_servo_1": 9, "pin_servo_2": 10}
    path.write_text(kit.text_of(kit.Kit("rover", 11, 65.0, 150.0, 1496.0, "cytron", pins)))

    def script():
        for name, angle_rad in (("pan", 0.3), ("tilt", -9.0)):
            node.publish(f"servo/{name}/command", Float64(angle_rad))
        yield from turns(20)
        joints = next(each for each in reversed(node.sent("joint_states")) if "pan_joint" in each.name)
        angles = dict(zip(joints.name, joints.position))
        assert angles == pytest.approx({"pan_joint": 0.3, "tilt_joint": -0.785}, abs=0.01)

    node.run(script, given={"robot": str(path)}, heard=("joint_states",), robot=str(path))
