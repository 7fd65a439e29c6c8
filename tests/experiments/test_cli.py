"""`mrl experiment` on the command line."""

import os
import re
from unittest import mock

import pytest
from click.testing import CliRunner

from mrl_driver.errors import ConfigError, LinkLost
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import load
from sim_arduino.experiments import cli, experiment_report, step_test, workers
from sim_arduino.experiments.experiment_robot import Setting
from tests.experiments.pools import at_once


def run(*args):
    return CliRunner().invoke(cli.main, args, prog_name="experiment")


@pytest.fixture
def started(monkeypatch):
    """Experiments that do nothing are started; who starts which, and those that fail but for the L-course."""
    calls = []

    def timed(name, setting):
        calls.append((name, os.getpid()))
        if setting.robot == "stingbot" and name != "l-course":
            raise ConfigError(f"{name}: no")
        return name, experiment_report.Result(name, name, []), 0.0

    monkeypatch.setattr(cli, "timed", timed)
    return calls


def test_each_experiment_is_listed_and_can_be_run():
    listed = {line.split()[0] for line in run("--list").output.splitlines()}
    assert listed == set(cli.EXPERIMENTS)
    for row in cli.EXPERIMENTS.values():
        module = __import__(f"sim_arduino.experiments.{row.module}", fromlist=["run"])
        assert callable(module.run)


def test_what_cannot_be_run_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    for args, said in (
        (["squares"], "square"),
        (["square", "--out", str(tmp_path / "file" / "folder")], "--out"),
    ):
        result = run(*args)
        assert result.exit_code == ConfigError.exit_code
        assert result.output.count("\n") == 1 and said in result.output


def test_all_are_run_once(started, tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "pool", at_once)
    assert run("square", "all", "--no-ros", "--out", str(tmp_path)).exit_code == 0
    assert [name for name, _ in started] == list(cli.EXPERIMENTS)


def test_a_real_robot_is_driven_by_this_process(started, tmp_path):
    """So that a signal which ends it stops the robot too."""
    assert run("square", "--port", "/dev/ttyACM0", "--yes", "--out", str(tmp_path)).exit_code == 0
    assert started == [("square", os.getpid())]


def test_a_step_test_that_fails_stops_the_robot_before_it_ends_the_mirror(monkeypatch):
    ended = []
    driver, mirror = mock.MagicMock(), mock.MagicMock()
    driver.return_value.__exit__.side_effect = lambda *_: ended.append("robot")
    robot = driver.return_value.__enter__.return_value
    robot.model, robot.pose, robot.ranges, robot.now_s = load("traxbot"), Pose(0.0, 0.0, 0.0), {}, 0.0
    robot.drive.side_effect = LinkLost("it went away")
    mirror.return_value.close.side_effect = lambda: ended.append("mirror")
    monkeypatch.setattr(step_test, "Driver", driver)
    monkeypatch.setattr(step_test, "Mirrored", mirror)
    with pytest.raises(LinkLost):
        step_test.run(Setting("", port="/dev/ttyACM0"))
    assert ended == ["robot", "mirror"]


def test_others_go_on_when_one_fails(started, tmp_path, monkeypatch):
    """The failure comes when all are done, in one line."""
    monkeypatch.setattr(workers, "pool", at_once)
    result = run("power", "square", "l-course", "--robot", "stingbot", "--out", str(tmp_path))
    assert result.exit_code == ConfigError.exit_code
    assert re.search("(power|square): no; (power|square): no\n$", result.output)
    assert experiment_report.read(str(tmp_path), "l-course") and not experiment_report.read(
        str(tmp_path), "power"
    )
