"""The demonstration without ROS: square, keys, view, text."""

import io
import math
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rich.console import Console
from sensor_msgs.msg import BatteryState, Range

from mrl_driver import geometry
from mrl_driver.navigation.line_follower import FollowerLimits, Square
from mrl_driver.terminal.live_panels import render
from mrl_driver.terminal.teleop_keys import ANGULAR_RAD_S, HOLD_S, LINEAR_M_S, Teleop
from ros1_bridge.demo.demo_screen import PATIENCE_S, DemoScreen
from ros1_bridge.topics.topic_robot import STALE_S, TopicRobot

STEP_S = 0.05
LAG = 0.4
"""Share of the difference to the commanded speed that the wheels of the test's robot make up in one step."""
CORNER_M = 0.006


def drive_square(start, rounds=1):
    """Positions at which a robot with lag reached the corners of its square."""
    square, (x, y, yaw), (v, w), reached = Square(1.0, FollowerLimits()), start, (0.0, 0.0), []
    for _ in range(int(rounds * 60 / STEP_S)):
        corner = square.corner
        wanted = square.command((x, y, yaw))
        if square.corner > corner:
            reached.append((x, y))
        if square.corner == 4 * rounds:
            return reached
        v, w = v + LAG * (wanted[0] - v), w + LAG * (wanted[1] - w)
        x, y, yaw = x + v * math.cos(yaw) * STEP_S, y + v * math.sin(yaw) * STEP_S, yaw + w * STEP_S
    raise AssertionError(f"only {square.corner} corners in time")


def test_square_reaches_its_corners_exactly():
    corners = [(1, 0), (1, 1), (0, 1), (0, 0)]
    gaps_m = [math.dist(*pair) for pair in zip(drive_square((0.0, 0.0, 0.0)), corners)]
    assert len(gaps_m) == 4 and max(gaps_m) < CORNER_M


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-math.pi, math.pi))
def test_square_starts_from_any_pose(x, y, yaw):
    last = drive_square((x, y, yaw))[-1]
    assert math.dist(last, (x, y)) < CORNER_M


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-math.pi, math.pi))
def test_square_never_exceeds_its_limits(x, y, yaw):
    square = Square()
    square.command((0.0, 0.0, 0.0))
    linear, angular = square.command((x, y, yaw))
    assert 0 <= linear <= FollowerLimits().linear_m_s
    assert abs(angular) <= FollowerLimits().angular_rad_s


def test_key_drives_until_it_is_released():
    teleop = Teleop()
    teleop.press("w", 0.0)
    assert teleop.command(HOLD_S - 0.01) == (LINEAR_M_S, 0.0)
    assert teleop.command(HOLD_S) == (0.0, 0.0)


def test_two_keys_drive_a_curve():
    teleop = Teleop()
    teleop.press("w", 0.0)
    teleop.press("d", 0.1)
    assert teleop.command(0.2) == (LINEAR_M_S, -ANGULAR_RAD_S)


def test_opposite_key_takes_over():
    teleop = Teleop()
    teleop.press("w", 0.0)
    teleop.press("down", 0.1)
    assert teleop.command(0.2) == (-LINEAR_M_S, 0.0)


def test_space_stops_at_once():
    teleop = Teleop()
    teleop.press("w", 0.0)
    assert teleop.press("space", 0.1)
    assert teleop.command(0.1) == (0.0, 0.0)


class Demo:
    """A view and the robot behind it; the published speeds, and time by hand."""

    def __init__(self, monkeypatch, square=False, duration_s=0.0, model="traxbot"):
        self.now_s = 100.0
        monkeypatch.setattr(time, "monotonic", lambda: self.now_s)
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


def test_the_square_is_driven_by_odometry(demo):
    view = demo(square=True)
    view.drive()
    assert view.published[-1][0] > 0


def test_the_square_ends_where_it_began(demo):
    view, pose, laps = demo(square=True), geometry.Pose(0.0, 0.0, 0.0), 0.0
    while laps < 2.0 and (len(view.published) < 3 or view.screen.square):
        view.odometry(pose.x_m, pose.yaw_rad, y=pose.y_m)
        view.steer()
        linear, angular = view.published[-1]
        pose, laps = (
            geometry.advance(pose, 0.07 * linear, 0.07 * angular),
            laps + 0.07 * angular / (2 * math.pi),
        )
    assert math.hypot(pose.x_m, pose.y_m) < 0.02 and laps < 1.1
    assert view.published[-1] == (0.0, 0.0) and view.robot.command is None


def test_the_square_stops_while_there_is_no_odometry(demo):
    view = demo(square=True)
    view.drive()
    view.steer(after_s=STALE_S)
    assert view.published[-1] == (0.0, 0.0) and view.robot.command is None


def test_a_key_ends_the_square_and_drives(demo):
    view = demo(square=True)
    view.press("s")
    view.steer()
    assert view.published[-1] == (-LINEAR_M_S, 0.0)


@pytest.mark.parametrize("key", ["space", "\n"])
def test_space_and_enter_end_the_square_with_a_stop(demo, key):
    view = demo(square=True)
    view.odometry()
    view.steer()
    view.press(key)
    view.steer()
    assert view.published[-1] == (0.0, 0.0)


def test_r_drives_a_square(demo):
    view = demo()
    view.press("r")
    view.drive()
    assert view.published[-1][0] > 0


def test_nothing_is_published_while_nothing_drives(demo):
    """Other nodes may drive meanwhile."""
    view = demo()
    for _ in range(5):
        view.odometry()
        view.steer()
    assert view.published == []


def test_a_run_ends_when_its_time_of_odometry_is_over(demo):
    view = demo(duration_s=1.0)
    view.steer(after_s=5.0)
    view.odometry()
    view.steer()
    assert not view.screen.ended
    view.steer(after_s=1.0)
    assert view.screen.ended and not view.screen.overdue


def test_a_run_without_odometry_ends_as_overdue(demo):
    view = demo(duration_s=1.0)
    view.steer(after_s=PATIENCE_S + 1.0)
    assert view.screen.ended and view.screen.overdue


def test_summary_has_pose_distance_frames_and_errors(demo):
    view = demo()
    for i in range(3):
        view.odometry(0.1 * i, 0.5)
    view.robot.on_diagnostics(link(Errors="2"))
    text = view.screen.summary()
    assert "x +0.200 m" in text and "yaw +28.6 deg" in text and "distance 0.200 m" in text
    assert "3 odometry frames" in text and "2 link errors" in text


def link(**values):
    values = {"Device ID": "4", "Firmware Version": "2", "Serial Port": "/dev/ttyACM7", **values}
    pairs = [KeyValue(key.replace("_", " "), value) for key, value in values.items()]
    return DiagnosticArray(status=[DiagnosticStatus(name="robot_node: Link", values=pairs)])


def test_the_view_shows_what_the_topics_say(demo):
    view = demo()
    view.odometry(1.25)
    view.robot.on_range(Range(range=0.75), "left")
    view.robot.on_battery(BatteryState(voltage=8.1, percentage=0.05))
    view.robot.on_diagnostics(
        link(
            Garbage="bad_field 2, text 5",
            Lost_Frames="3",
            Serial_Port="/home/someone/a folder/run/23456/robot",
        )
    )
    text = view.picture()
    for words in (
        "traxbot 4",
        "x +1.250",
        "0.75 m",
        "8.1 V low",
        "er/run/23456/robot",
        "3 lost, 7 bad",
        "square",
        "→",
    ):
        assert words in text, words


def test_the_view_says_why_the_robot_does_not_drive(demo):
    view = demo()
    view.robot.on_status(DiagnosticStatus(level=2, message="stopped by wheel mismatch"))
    assert "stopped by wheel mismatch" in view.picture()
    view.robot.on_status(DiagnosticStatus(level=0, message="moving"))
    assert "moving" not in view.picture()


def test_the_view_says_that_there_is_no_odometry_yet(demo):
    assert "NO TELEMETRY yet" in demo().picture()


def test_the_boards_id_chooses_the_model(demo):
    view = demo(model="auto")
    assert view.robot.model is None
    view.robot.on_diagnostics(link())
    assert view.robot.model.name == "stingbot"
