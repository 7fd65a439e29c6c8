"""Experiments through ROS."""

import importlib.util
import json
import math
import os
from contextlib import ExitStack

import pytest
import rosgraph
from click.testing import CliRunner

from mrl_driver.cli.main import registered
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.geometry import Pose
from mrl_driver.robot.sonar import NAMES
from ros1_bridge.experiments import legs, team_node
from ros1_bridge.experiments.experiment_processes import Parts, environment
from ros1_bridge.experiments.wire_log import command_s, commanded, odometry_s, read, sent
from sim_arduino.experiments import cli, workers
from sim_arduino.experiments.experiment_report import Result
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.team import Member
from tests.experiments.pools import at_once
from tests.waiting import wait_until

from .rig import START_S

START, AHEAD_M, NEAR_M = Pose(-1.0, 0.5, math.pi / 2), 0.15, 0.06
HOST, BOARD = "host", "board"


@pytest.fixture
def parts(master, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with Parts(str(tmp_path)) as made:
        yield made


def test_real_robot_reaches_a_goal_of_the_map_and_its_mirror_follows(parts):
    """Board, robot node, go_to_goal and world node: odometry that begins elsewhere, what is heard, truth."""
    with ExitStack() as stack:
        member = Member("real1", START, virtual=False)
        (player,) = team_node.gather(stack, parts, Setting(""), [member], navigated=True).players
        master = rosgraph.Master("/tests")
        wait_until(
            lambda: {f"/real1/heard/{name}" for name in NAMES} <= heard_by(master, "/real1/go_to_goal")
        )
        goal = START.compose(AHEAD_M, 0.0)
        seek = player.robot.seek(goal)

        def ended():
            step = seek(player.ranges())
            player.step(step.speeds)
            return step if step.reached or step.blocked else None

        assert wait_until(ended).reached and not player.bumps
        (mirror,) = player.virtual.robots()
        for pose in player.robot.true_pose, player.robot.pose, mirror.pose:
            assert math.dist(pose[:2], goal[:2]) < NEAR_M


def heard_by(master, node):
    """Topics that a node subscribes to."""
    return {topic for topic, nodes in master.getSystemState()[1] if node in nodes}


def test_frames_and_commands_are_found_in_the_boards_log(tmp_path):
    """Times are the host's; the first frame of a speed counts, and its bytes on the wire."""
    log, truth = tmp_path / "log", tmp_path / "truth"
    truth.write_text(json.dumps({"t": 1.0, "host_monotonic": 101.0}) + "\n")
    noted = [
        (2.0, BOARD, "@8,1,2,3,4,5,6,7,8e\r\n"),
        (2.5, HOST, "@30e@11,299,0,7e"),
        (2.6, HOST, "@11,299,0,7e"),
        (3.0, BOARD, "@30,1e\r\n"),
    ]
    log.write_text("".join(json.dumps({"t": t, "from": who, "bytes": data}) + "\n" for t, who, data in noted))
    rows = read(log, truth)
    assert sent(rows) == [102.0]
    assert commanded(rows, 0.0) == {299: pytest.approx(102.5 + 16 * 10 / 115200)}
    assert commanded(rows, 102.55) == {299: pytest.approx(102.6 + 12 * 10 / 115200)}


def test_odometry_belongs_to_the_frame_before_it():
    assert odometry_s([1.0, 2.0, 3.0], [1.001, 2.002, 3.009]) == pytest.approx(0.002)


def test_command_that_was_overtaken_does_not_count():
    assert command_s({299: 1.0, 298: 2.0}, {298: 2.003}) == pytest.approx(0.003)


def test_what_ros_and_shared_worlds_write_is_in_the_folder():
    made = environment("/folder", {"PATH": "/bin"})
    assert {made[name] for name in ("ROS_HOME", "ROS_LOG_DIR", "XDG_RUNTIME_DIR")} == {"/folder"}
    assert made["ROS_MASTER_URI"].startswith("http://127.0.0.1:") and made["ROS_IP"] == "127.0.0.1"


def test_part_that_died_is_named_with_its_last_words(tmp_path):
    with Parts(str(tmp_path)) as parts, pytest.raises(MrlError, match="space/nothing .* No such file"):
        parts.node("nothing", "space").wait(START_S)
        parts.check()


def test_failure_of_an_experiment_is_its_last_line(monkeypatch):
    monkeypatch.setitem(legs.NODES, "turnaround", "no_such_node")
    with pytest.raises(MrlError, match=r"^experiment turnaround: .*No module named '\S+\.no_such_node'$"):
        legs.run("turnaround", Setting(""))


@pytest.fixture
def without_ros(monkeypatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "rospy" else found(name))


@pytest.fixture
def experiment(monkeypatch, tmp_path):
    """Runs `mrl experiment` with experiments that do nothing but tell whether they go through ROS."""
    through_ros = []

    def timed(name, setting):
        through_ros.append(setting.ros)
        return name, Result(name, name, []), 0.0

    monkeypatch.setattr(cli, "timed", timed)
    monkeypatch.setattr(workers, "pool", at_once)

    def run(*words):
        result = CliRunner().invoke(cli.main, [*words, "--out", str(tmp_path)])
        return result, through_ros

    return run


def test_without_ros_a_line_names_what_runs_without_it(without_ros, experiment):
    result, through_ros = experiment("square", "mixed-team")
    (line,) = result.stderr.splitlines()
    assert "rospy" in line and line.endswith("mixed-team") and "install" in line
    assert through_ros == [False, False]


def test_an_experiment_with_ros_needs_rospy(without_ros, experiment):
    result, _ = experiment("mixed-team", "--ros")
    assert result.exit_code == ConfigError.exit_code
    assert result.output.count("\n") == 1 and "rospy" in result.output


def test_experiments_that_are_not_about_ros_do_not_ask_for_it(without_ros, experiment):
    result, through_ros = experiment("square", "--ros")
    assert through_ros == [False] and not result.stderr


@pytest.mark.parametrize("words, through", [((), True), (("--no-ros",), False)])
def test_ros_can_be_left_out(experiment, words, through):
    assert experiment("mixed-team", *words)[1] == [through]


def test_experiments_through_ros_are_found():
    """By the entry point; their names are experiments."""
    assert registered("mrl.experiments")["ros"].load() is legs and set(legs.NODES) <= set(cli.EXPERIMENTS)


def test_experiment_that_is_about_ros_is_run_by_the_bridge(monkeypatch):
    monkeypatch.setattr(legs, "run", lambda name, setting: f"{name} by {os.path.basename(setting.folder)}")
    assert cli.timed("mixed-team", Setting("/ros", ros=True))[1] == "mixed-team by ros"
