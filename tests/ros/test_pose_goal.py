"""The command `pose`, with a commander that only notes what it is told."""

import math
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header

from mrl_driver import geometry
from mrl_driver.robot import models
from mrl_driver.robot.models import Limits, SonarMount
from ros1_bridge.control.pose_goal import BLOCKED, REACHED, STEP_S, PoseGoal

HERE = geometry.Pose(1.0, 2.0, math.pi / 2)


class Noted:
    def __init__(self):
        self.limits, self.seeking, self.willing = Limits(0.3, 1.0, 0.2, 1.0), False, True
        self.speeds, self.stops = None, 0
        self.dropped, self.stopped_by, self.ready, self.manual = False, "link lost", True, False

    def drive(self, *speeds):
        self.speeds = speeds
        return self.willing

    def stop(self):
        self.stops += 1

    def refusal(self):
        return "the motors are disabled"


def message(frame, x, y, w=1.0):
    return PoseStamped(Header(frame_id=frame), Pose(Point(x, y, 0), Quaternion(0, 0, 0, w)))


@pytest.fixture
def noted():
    return Noted()


@pytest.fixture
def goal(noted):
    return PoseGoal(noted, "odom", "base_link", models.load("traxbot").sonars)


def at(pose, seconds):
    return SimpleNamespace(pose=pose, ranges={}, arrival_s=seconds)


@pytest.mark.parametrize("frame", ["odom", ""])
def test_in_the_frame_of_odom_a_pose_is_absolute(goal, frame):
    assert goal.start(message(frame, 3.0, 4.0), HERE) == (3.0, 4.0, 0.0)


def test_in_the_robots_own_frame_it_is_relative(goal):
    assert goal.start(message("base_link", 1.0, 0.0), HERE) == pytest.approx((1.0, 3.0, math.pi / 2))


@pytest.mark.parametrize(
    "wrong, words",
    [
        (message("map", 1, 1), "pose is in 'map', expected odom"),
        (message("odom", math.nan, 1), "finite"),
        (message("odom", 1e308, 1), "at most 1e"),
        (message("odom", 1, 1, 0.0), "quaternion"),
    ],
)
def test_a_wrong_pose_is_refused_and_the_one_before_stays(goal, noted, wrong, words):
    goal.start(message("odom", 3.0, 4.0), HERE)
    with pytest.raises(ValueError, match=words):
        goal.start(wrong, HERE)
    assert noted.seeking


def test_the_frame_of_a_refused_pose_is_quoted_in_one_short_line(goal):
    with pytest.raises(ValueError) as refused:
        goal.start(message("\x1b[2J\n[ERROR] " * 100, 1, 1), HERE)
    assert str(refused.value).isprintable() and len(str(refused.value)) < 200


def test_a_pose_is_refused_while_the_robot_may_not_move(goal, noted):
    """Otherwise the robot would set off by itself, much later, when telemetry is back."""
    noted.ready = False
    with pytest.raises(ValueError, match="the motors are disabled"):
        goal.start(message("odom", 3.0, 4.0), HERE)
    assert noted.seeking is False


def test_a_pose_is_refused_in_manual_mode(goal, noted):
    noted.manual = True
    with pytest.raises(ValueError, match="manual mode; call the service manual_mode with false"):
        goal.start(message("odom", 3.0, 4.0), HERE)
    assert goal.on_telemetry(at((0.0, 0.0, 0.0), 1.0)) == ""
    assert (noted.seeking, noted.speeds) == (False, None)


def test_an_emergency_stop_that_is_released_between_two_steps_ends_it(goal, noted):
    """The robot then stands still until the next command."""
    goal.start(message("odom", 1.0, 0.0), HERE)
    goal.on_telemetry(at((0.0, 0.0, 0.0), 1.0))
    noted.seeking, noted.speeds = False, None  # what `Commander.latch` does
    assert (
        goal.on_telemetry(at((0.0, 0.0, 0.0), 2.0))
        == f"{BLOCKED}: the robot was stopped, or got another command"
    )
    assert (goal.on_telemetry(at((0.0, 0.0, 0.0), 3.0)), noted.speeds) == ("", None)


def test_it_drives_there_and_stops(goal, noted):
    goal.start(message("odom", 1.0, 0.0), HERE)
    assert goal.on_telemetry(at((0.0, 0.0, 0.0), 1.0)) == "" and noted.speeds[0] > 0 and noted.seeking
    assert goal.on_telemetry(at((1.0, 0.0, 0.0), 1.0 + STEP_S)) == REACHED
    assert (noted.stops, noted.seeking) == (1, False)


def test_it_gives_up_when_it_comes_no_nearer(goal, noted):
    goal.start(message("odom", 1.0, 0.0), HERE)
    ends = [goal.on_telemetry(at((0.0, 0.0, 0.0), float(second))) for second in range(70)]
    assert f"{BLOCKED}: 1.0 m away it came no closer for 60 s" in ends and noted.stops == 1


def test_it_gives_up_when_the_driver_has_stopped_the_robot(goal, noted):
    """As when the link was lost: back again, the robot waits for a new command."""
    noted.dropped = True  # by the goal before; a new one is a new command
    goal.start(message("odom", 1.0, 0.0), HERE)
    assert goal.on_telemetry(at((0.0, 0.0, 0.0), 1.0)) == "" and noted.speeds
    noted.speeds = None
    assert goal.on_telemetry(at((0.0, 0.0, 0.0), 2.0)) == f"{BLOCKED}: the robot was stopped (link lost)"
    assert (noted.speeds, noted.seeking) == (None, False)


def test_it_gives_up_when_the_robot_may_not_move(goal, noted):
    noted.willing = False
    goal.start(message("odom", 1.0, 0.0), HERE)
    assert "motors are disabled" in goal.on_telemetry(at((0.0, 0.0, 0.0), 1.0)) and not noted.seeking


def test_it_keeps_straight_on_beside_what_a_sonar_sees_elsewhere(noted):
    """This robot's sonar of the name `front` looks back."""
    goal = PoseGoal(noted, "odom", "base_link", {"front": SonarMount(-0.1, 0.0, 180.0)})
    goal.start(message("odom", 3.0, 0.0), HERE)
    for step in range(3):
        goal.on_telemetry(
            SimpleNamespace(pose=(0.0, 0.0, 0.0), ranges={"front": 0.58}, arrival_s=float(step))
        )
    assert noted.speeds == (noted.limits.linear_m_s, 0.0)


def test_another_command_takes_its_place(goal, noted):
    goal.start(message("odom", 1.0, 0.0), HERE)
    goal.cancel()
    assert goal.on_telemetry(at((0.0, 0.0, 0.0), 1.0)) == "" and noted.speeds is None


@pytest.mark.parametrize("stopped", [False, True])
def test_a_goal_that_ends_while_its_step_is_written_does_not_drive_on(goal, noted, stopped):
    """By a command of zero, or an emergency stop that is released: the step of before must not stay in force."""
    goal.start(message("odom", 1.0, 0.0), HERE)
    drive = noted.drive

    def ended_before(*speeds):
        if stopped:
            noted.seeking = False
        else:
            goal.cancel()
        return drive(*speeds)

    noted.drive = ended_before
    goal.on_telemetry(at((0.0, 0.0, 0.0), 1.0))
    assert noted.stops == 1
