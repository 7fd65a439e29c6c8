"""Experiments through ROS."""

import importlib.util
import math
import subprocess
import sys
from contextlib import ExitStack
from types import SimpleNamespace

import pytest
import rosgraph
from click.testing import CliRunner

from mrl_driver.cli.main import registered
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.geometry import Pose
from mrl_driver.navigation.waypoint_tour import DONE
from mrl_driver.robot.sonar import NAMES
from ros1_bridge.experiments import legs, one_robot_node, team_node
from ros1_bridge.experiments.legs import Parts, environment
from sim_arduino.experiments import cli, l_course, square
from sim_arduino.experiments.experiment_report import Result
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.team import Member
from sim_arduino.hardware.sonars import HALF_CONE_RAD
from tests.waiting import wait_until

from .rig import START_S

START, AHEAD_M, NEAR_M, DRIVE_S = Pose(-1.0, 0.5, math.pi / 2), 0.15, 0.06, 60.0


@pytest.fixture
def parts(master, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with Parts(str(tmp_path)) as made:
        yield made


def test_real_robot_reaches_a_waypoint_of_the_map_and_its_mirror_follows(parts):
    """Board, robot node, go_to_goal, follow_waypoints and world node: odometry that begins elsewhere, what is heard."""
    with ExitStack() as stack:
        member = Member("real1", START, virtual=False)
        made = team_node.gather(stack, parts, Setting(""), [member], navigated=True)
        master = rosgraph.Master("/tests")
        wait_until(
            lambda: {f"/real1/heard/{name}" for name in NAMES} <= heard_by(master, "/real1/go_to_goal")
        )
        goal = START.compose(AHEAD_M, 0.0)
        team_node.begin_tour(parts, "real1", [goal])
        (player,) = made.players
        team_node.watch(made, DRIVE_S, lambda _: player.robot.tour == DONE)
        assert (player.robot.visits, player.bumps) == (1, 0)
        (mirror,) = player.virtual.robots()
        for pose in player.robot.true_pose, player.robot.pose, mirror.pose:
            assert math.dist(pose[:2], goal[:2]) < NEAR_M


def test_lap_through_ros_ends_where_its_odometry_does_not(parts, monkeypatch):
    """A right wheel that is 5 % smaller turns the robot by 0.05 * 0.4 m / 0.18 m to the right."""
    monkeypatch.setattr(one_robot_node, "LAP", ((0.4, 0.0),))
    monkeypatch.setattr(one_robot_node, "LAP_STOP_S", 0.5)
    monkeypatch.setattr(
        square, "LIKE_PUBLISHED", {"wheel_ratio": 0.95, "axle": 1.0, "noise": 0, "turn_noise": 0}
    )
    error = one_robot_node.lap(parts, Setting("", seed=1))
    assert error.yaw_rad == pytest.approx(-0.11, abs=0.02) and error.y_m == pytest.approx(-0.022, abs=0.006)


def test_course_through_ros_has_the_pose_of_each_reading(parts, monkeypatch):
    """The wall ahead is at 2 m, the side walls at 0 and 1 m; a sonar measures along the side of its cone.

    The first message of a sonar may be NaN, because it has not measured yet.  Of the course the first 20 cm are driven.
    """
    monkeypatch.setattr(l_course, "WAYPOINTS", ((0.5, 0.5),))
    monkeypatch.setattr(one_robot_node, "COURSE_STOP_S", 0.3)
    course = one_robot_node.drive(parts, Setting("", seed=1))
    beyond_m = [
        true.x_m + ranges[len(ranges) // 2] * math.cos(true.yaw_rad) for _, ranges, true in course.scans
    ]
    assert beyond_m == pytest.approx([2.0] * len(beyond_m), abs=0.04) and len(beyond_m) > 10
    measured = [cone for cone in course.cones if not math.isnan(cone[1])]
    for by_odometry, range_m, true in measured:
        aside_m = true.y_m if math.sin(true.yaw_rad) < 0 else 1.0 - true.y_m
        assert range_m == pytest.approx(aside_m / math.sin(abs(true.yaw_rad) + HALF_CONE_RAD), abs=0.06)
        assert math.dist(by_odometry[:2], true[:2]) < 0.03
    assert {math.copysign(1, true.yaw_rad) for _, _, true in measured} == {-1, 1}
    assert course.path[0] == Pose(0.3, 0.5, 0.0) and course.path[-1].x_m == pytest.approx(0.5, abs=0.03)
    assert math.dist(course.path[-1][:2], course.true_path[-1][:2]) < 0.03


def test_pose_of_a_message_is_between_those_before_and_after_it():
    poses = [(1.0, Pose(0.0, 1.0, 3.0)), (2.0, Pose(1.0, 1.0, -3.0))]
    between, before = one_robot_node.poses_at(poses, [1.25, 0.5])
    assert tuple(between) == pytest.approx((0.25, 1.0, 3.0 + (2 * math.pi - 6.0) / 4))
    assert before == poses[0][1]


def heard_by(master, node):
    """Topics that a node subscribes to."""
    return {topic for topic, nodes in master.getSystemState()[1] if node in nodes}


def test_what_ros_and_shared_worlds_write_is_in_the_folder():
    made = environment("/folder")
    assert {made[name] for name in ("ROS_HOME", "ROS_LOG_DIR", "XDG_RUNTIME_DIR")} == {"/folder"}
    assert made["ROS_MASTER_URI"].startswith("http://127.0.0.1:") and made["ROS_IP"] == "127.0.0.1"


def test_part_that_died_is_named_with_its_last_words(tmp_path):
    with Parts(str(tmp_path)) as parts, pytest.raises(MrlError, match="space/nothing .* No such file"):
        parts.node("nothing", "space").wait(START_S)
        parts.check()


@pytest.fixture
def experiment(monkeypatch, tmp_path):
    """Runs `mrl experiment` with experiments that do nothing but tell whether they go through ROS."""
    through_ros = []

    def run_one(name, setting):
        through_ros.append(setting.ros)
        return Result(name, name, [])

    monkeypatch.setattr(cli, "run", run_one)

    def run(*words):
        result = CliRunner().invoke(cli.main, [*words, "--out", str(tmp_path)], standalone_mode=False)
        return result, through_ros

    return run


def test_experiments_are_found_without_ros():
    code = "import sys; sys.modules['rosgraph'] = None; import ros1_bridge.experiments.legs"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_experiments_through_ros_are_found():
    """By the entry point; their names are experiments."""
    assert registered("mrl.experiments")["ros"].load() is legs and set(legs.NODES) <= set(cli.EXPERIMENTS)


@pytest.mark.parametrize("robot, path", [("own.yaml", "{}/own.yaml"), ("stingbot", "stingbot")])
def test_paths_are_those_of_the_caller(monkeypatch, tmp_path, robot, path):
    """An experiment runs in another folder.  A model's name is not a path."""
    commands = []

    def child(_, command, *__):
        commands.append(command)
        return SimpleNamespace(exit_code=0, output=list, signal=lambda _: None, finish=lambda _: None)

    monkeypatch.setattr(legs, "Child", child)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MrlError):
        legs.run("step-test", Setting("build/experiments", robot=robot))
    assert {str(tmp_path / "build" / "experiments"), path.format(tmp_path)} <= set(commands[0])


@pytest.mark.parametrize(
    "words, told",
    [(["power", "mixed-team"], "mixed-team\n"), (["mixed-team", "--no-ros"], ""), (["power", "--ros"], "")],
)
def test_without_ros_a_line_names_what_runs_without_it(monkeypatch, experiment, words, told):
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "rospy" else found(name))
    result, through_ros = experiment(*words)
    assert not any(through_ros)
    assert result.stderr.endswith(told) and result.stderr.count("\n") == bool(told)
    needing, _ = experiment("mixed-team", "--ros")
    assert isinstance(needing.exception, ConfigError) and "rospy" in str(needing.exception)
