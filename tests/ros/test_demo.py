"""The demonstration without ROS: square, keys, view, text."""

import io
import math
import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist, TwistStamped
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rich.console import Console
from sensor_msgs.msg import BatteryState, Range

from mrl_driver import geometry
from mrl_driver.navigation.line_follower import FollowerLimits, Square
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.terminal.live_panels import render
from mrl_driver.terminal.teleop_keys import ANGULAR_RAD_S, HOLD_S, LINEAR_M_S, Teleop
from mrl_driver.view.shown_state import SILENT_S
from mrl_driver.view.words import STOPS, remedied_text
from ros1_bridge.demo.demo_node import run_lines
from ros1_bridge.demo.demo_screen import DemoScreen
from ros1_bridge.topics.topic_robot import TopicRobot
from tests.waiting import wait_until

from .rig import START_S

STEP_S = 0.05
LAG = 0.4
"""Share of the difference to the commanded speed that the wheels of the test's robot make up in one step."""
CORNER_M = 0.006


def drive_square(start):
    """The position at which a robot with lag reached the last corner of its square."""
    square, (x, y, yaw), (v, w) = Square(1.0, FollowerLimits()), start, (0.0, 0.0)
    for _ in range(int(60 / STEP_S)):
        wanted = square.command((x, y, yaw))
        if square.corner == 4:
            return x, y
        v, w = v + LAG * (wanted[0] - v), w + LAG * (wanted[1] - w)
        x, y, yaw = x + v * math.cos(yaw) * STEP_S, y + v * math.sin(yaw) * STEP_S, yaw + w * STEP_S
    raise AssertionError(f"only {square.corner} corners in time")


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-math.pi, math.pi))
def test_square_starts_from_any_pose(x, y, yaw):
    assert math.dist(drive_square((x, y, yaw)), (x, y)) < CORNER_M


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-math.pi, math.pi))
def test_square_never_exceeds_its_limits(x, y, yaw):
    square = Square()
    square.command((0.0, 0.0, 0.0))
    linear, angular = square.command((x, y, yaw))
    assert 0 <= linear <= FollowerLimits().linear_m_s
    assert abs(angular) <= FollowerLimits().angular_rad_s


def test_keys_drive_while_they_are_held_the_newer_of_two_opposite_ones_counts_and_space_stops():
    teleop = Teleop()
    teleop.press("w", 0.0)
    assert teleop.command(HOLD_S - 0.01) == (LINEAR_M_S, 0.0)
    assert teleop.command(HOLD_S) == (0.0, 0.0)
    for key, speeds in (("w", (1, 0)), ("d", (1, -1)), ("down", (-1, -1))):
        teleop.press(key, 1.0)
        assert teleop.command(1.1) == (speeds[0] * LINEAR_M_S, speeds[1] * ANGULAR_RAD_S)
    assert teleop.press("space", 1.2) and teleop.command(1.2) == (0.0, 0.0)


class Demo:
    """A view and the robot behind it; the published speeds, and time by hand."""

    def __init__(self, monkeypatch, square=False, duration_s=0.0, model="traxbot"):
        self.now_s = 100.0
        monkeypatch.setattr(time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(time, "clock_gettime", lambda clock: self.now_s)
        self.published = []
        self.robot = TopicRobot(lambda *speeds: self.published.append(speeds), lambda: False, model)
        self.screen = DemoScreen(self.robot, "ROS_MASTER_URI=here", square, duration_s)

    def odometry(self, x=0.0, yaw=0.0, after_s=0.02, y=0.0):
        self.now_s += after_s
        message = Odometry()
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        turn = message.pose.pose.orientation
        turn.z, turn.w = geometry.quaternion_of(yaw)
        self.robot.on_odometry(message)

    def steer(self, after_s=0.05):
        self.now_s += after_s
        self.screen.steer(self.now_s)

    def drive(self):
        """Two steps: a course first turns towards its leg."""
        for _ in range(2):
            self.odometry()
            self.steer()

    def press(self, key):
        self.screen.press(key, self.now_s)

    def picture(self):
        console = Console(file=io.StringIO(), width=120, height=34, force_terminal=True, color_system=None)
        console.print(render(self.screen.content(self.now_s), 120, 34), end="")
        return console.file.getvalue()


@pytest.fixture
def demo(monkeypatch):
    return lambda **options: Demo(monkeypatch, **options)


def test_without_a_terminal_the_view_ends_after_the_square_where_it_began(demo, monkeypatch):
    view, pose, laps = demo(square=True), geometry.Pose(0.0, 0.0, 0.0), 0.0

    def pass_time(_):
        nonlocal pose, laps
        assert view.screen.live.frames < 2000, "it goes on"
        view.odometry(pose.x_m, pose.yaw_rad, 0.07, pose.y_m)
        linear, angular = view.published[-1] if view.published else (0.0, 0.0)
        pose = geometry.advance(pose, 0.07 * linear, 0.07 * angular)
        laps += 0.07 * angular / (2 * math.pi)

    monkeypatch.setattr(time, "sleep", pass_time)
    run_lines(view.robot, view.screen)
    assert math.hypot(pose.x_m, pose.y_m) < 0.02 and laps < 1.1
    assert view.published[-1] == (0.0, 0.0) and view.robot.command is None


def test_the_square_stops_while_there_is_no_odometry(demo):
    view = demo(square=True)
    view.drive()
    view.steer(after_s=SILENT_S)
    assert view.published[-1] == (0.0, 0.0) and view.robot.command is None


@pytest.mark.parametrize(
    "key, speeds", [("space", (0.0, 0.0)), ("\n", (0.0, 0.0)), ("s", (-LINEAR_M_S, 0.0))]
)
def test_any_key_ends_the_square_with_its_own_command(demo, key, speeds):
    view = demo(square=True)
    view.drive()
    assert view.published[-1][0] > 0
    view.press(key)
    view.steer()
    assert view.published[-1] == speeds


def test_a_key_moves_a_robot_that_can_sideways_and_ends_its_square(demo):
    view = demo(square=True, model="omni")
    view.drive()
    view.press(",")
    view.steer()
    assert view.published[-1] == (0.0, 0.0, LINEAR_M_S)


def test_r_drives_a_square_and_nothing_is_published_before(demo):
    """Other nodes may drive meanwhile."""
    view = demo()
    view.drive()
    assert view.published == []
    view.press("r")
    view.drive()
    assert view.published[-1][0] > 0


def test_an_r_that_was_typed_while_the_program_was_suspended_drives_no_square(demo):
    view = demo()
    view.screen.press("r", view.now_s - HOLD_S)
    view.drive()
    assert view.published == []


def test_a_run_ends_when_its_time_of_odometry_is_over(demo):
    view = demo(duration_s=1.0)
    view.steer(after_s=5.0)
    view.odometry()
    view.steer()
    assert not view.screen.ended
    view.steer(after_s=1.0)
    assert view.screen.ended


def link(**values):
    values = {"Device ID": "4", "Firmware Version": "2", "Serial Port": "/dev/ttyACM7", **values}
    pairs = [KeyValue(key.replace("_", " "), value) for key, value in values.items()]
    return DiagnosticArray(status=[DiagnosticStatus(name="robot_node: Link", values=pairs)])


def test_the_view_shows_what_the_topics_say(demo):
    view = demo()
    view.odometry(1.25)
    view.robot.on_range(Range(range=0.75), "left")
    view.robot.on_battery(BatteryState(voltage=8.1, percentage=0.05))
    port = "/home/someone/a folder/run/23456/robot"
    view.robot.on_diagnostics(
        link(Garbage="bad_field 2, text 5", Lost_Frames="3", Serial_Port=port, Errors="3")
    )
    view.robot.on_status(DiagnosticStatus(level=2, message="stopped by wheel mismatch"))
    text = view.picture()
    shown = "traxbot 4|x +1.250|0.75 m|8.1 V low|er/run/23456/robot|3 lost, 7 bad|square|→|stopped by wheel mismatch"
    assert not [words for words in shown.split("|") if words not in text]
    assert "x +1.250 m" in view.screen.summary() and "3 link errors" in view.screen.summary()


@pytest.mark.parametrize("reason", ["command_too_late", "host_paused", "commands_unpaused", "emergency_stop"])
def test_a_driven_robot_that_stands_has_the_reason_and_the_remedy_in_the_view(demo, reason):
    view = demo(square=True)
    view.robot.on_status(DiagnosticStatus(message="ready", values=[KeyValue("stopped by", reason)]))
    assert not view.screen.warning(), "before anything drives"
    view.drive()
    assert view.screen.warning() == remedied_text(StopReason(reason)) and STOPS[StopReason(reason)].remedy
    view.robot.on_status(DiagnosticStatus(message="driving"))
    assert not view.screen.warning()


def test_the_boards_id_chooses_the_model(demo):
    view = demo(model="auto")
    assert view.robot.model is None
    view.robot.on_diagnostics(link())
    assert view.robot.model.name == "stingbot"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_during_the_square_sends_a_stop(rig, number):
    rig.node(rig.board().port)
    rig.topic("odom", Odometry).wait()
    commands = rig.topic("cmd_vel/stamped", TwistStamped)
    view = rig.program("demo_view", "_square:=true")
    wait_until(lambda: any(message.twist != Twist() for message in commands.messages), START_S)
    view.signal(number)
    wait_until(lambda: view.exit_code is not None, START_S)
    wait_until(lambda: commands.messages[-1].twist == Twist(), 2.0)
