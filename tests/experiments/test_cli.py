"""`mrl experiment` on the command line."""

from unittest import mock

import pytest
from click.testing import CliRunner

from mrl_driver.errors import ConfigError, LinkLost
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import load
from sim_arduino.experiments import cli, experiment_report, experiment_robot, step_test
from sim_arduino.experiments.experiment_robot import Setting


def run(*args):
    return CliRunner().invoke(cli.main, args, standalone_mode=False)


@pytest.fixture
def started(monkeypatch):
    """Experiments that do nothing are started; which, and those fail but for the L-course."""
    calls = []

    def run_one(name, setting):
        calls.append(name)
        if setting.robot == "stingbot" and name != "l-course":
            raise ConfigError(f"{name}: no")
        return experiment_report.Result(name, name, [])

    monkeypatch.setattr(cli, "run", run_one)
    return calls


def test_each_experiment_is_listed_and_can_be_run():
    listed = {line.split()[0] for line in run("--list").output.splitlines()}
    assert listed == set(cli.EXPERIMENTS)
    for row in cli.EXPERIMENTS.values():
        module = __import__(f"sim_arduino.experiments.{row.module}", fromlist=["run"])
        assert callable(module.run)


def test_what_cannot_be_run_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    for args, said in (
        (["squares"], "square"),
        (["square", "--out", str(tmp_path / "file" / "folder")], "--out"),
    ):
        error = run(*args).exception
        assert error.exit_code == ConfigError.exit_code and said in str(error)


def test_all_are_run_once(started, tmp_path):
    assert run("square", "all", "--no-ros", "--out", str(tmp_path)).exception is None
    assert started == list(cli.EXPERIMENTS)


def test_a_step_test_that_fails_stops_the_robot_before_it_ends_the_mirror(monkeypatch):
    ended = []
    driver, mirror = mock.MagicMock(), mock.MagicMock()
    driver.return_value.__exit__.side_effect = lambda *_: ended.append("robot")
    robot = driver.return_value.__enter__.return_value
    robot.model, robot.pose, robot.ranges, robot.now_s = load("traxbot"), Pose(0.0, 0.0, 0.0), {}, 0.0
    robot.drive.side_effect = LinkLost("it went away")
    mirror.return_value.close.side_effect = lambda: ended.append("mirror")
    monkeypatch.setattr(experiment_robot, "Driver", driver)
    monkeypatch.setattr(step_test, "Mirrored", mirror)
    with pytest.raises(LinkLost):
        step_test.run(Setting("", port="/dev/ttyACM0"))
    assert ended == ["robot", "mirror"]


def test_others_go_on_when_one_fails(started, tmp_path):
    """The failure comes when all are done, in one line."""
    error = run("power", "square", "l-course", "--robot", "stingbot", "--out", str(tmp_path)).exception
    assert (error.exit_code, str(error)) == (ConfigError.exit_code, "power: no; square: no")
    assert experiment_report.read(str(tmp_path), "l-course") and not experiment_report.read(
        str(tmp_path), "power"
    )


def test_port_is_refused_where_robots_are_emulated(started):
    error = run("power", "gyro", "square", "--port", "/dev/ttyACM0", "--yes").exception
    assert "gyro, square needs emulated robots, got --port /dev/ttyACM0" in str(error) and not started


def test_a_real_robot_is_not_driven_on_after_a_failure(started, tmp_path):
    words = ("--port", "tcp://robot:1", "--yes", "--robot", "stingbot", "--out", str(tmp_path))
    assert run("power", "step-test", *words).exception.exit_code == ConfigError.exit_code
    assert started == ["power"]
