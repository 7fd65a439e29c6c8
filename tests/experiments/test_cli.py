"""`mrl experiment` on the command line."""

import builtins
import os
from concurrent.futures import Future
from contextlib import contextmanager
from unittest import mock

import pytest
from click.testing import CliRunner
from rich.console import Console

from mrl_driver.errors import ConfigError, MrlError
from sim_arduino.experiments import cli, report, step_test, workers
from sim_arduino.experiments.stage import Setting


def run(*args):
    return CliRunner().invoke(cli.main, args, prog_name="experiment")


@contextmanager
def at_once(_count):
    """A pool without processes."""

    def submit(function, *args):
        future = Future()
        try:
            future.set_result(function(*args))
        except MrlError as error:
            future.set_exception(error)
        return future

    yield submit


def outcome(name, _setting):
    if name != "l-course":
        raise ConfigError(f"{name}: no")
    return name, None, 0.0


def test_list_names_all_experiments():
    listed = {line.split()[0] for line in run("--list").output.splitlines()}
    assert listed == set(cli.EXPERIMENTS)


@pytest.mark.parametrize("name", cli.EXPERIMENTS)
def test_each_experiment_can_be_run(name):
    module = __import__(f"sim_arduino.experiments.{cli.EXPERIMENTS[name].module}", fromlist=["run"])
    assert callable(module.run)


def test_unknown_experiment_is_one_line():
    result = run("squares")
    assert result.exit_code == ConfigError.exit_code
    assert result.output.count("\n") == 1 and "square" in result.output


def test_all_are_run_once():
    assert cli._chosen(["square", "all"]) == list(cli.EXPERIMENTS)


def test_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    result = run("square", "--out", str(tmp_path / "file" / "folder"))
    assert result.exit_code == ConfigError.exit_code and "--out" in result.output


def test_missing_matplotlib_is_said_before_anything_is_driven(tmp_path, monkeypatch):
    load = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "matplotlib":
            raise ImportError(name)
        return load(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    result = run("square", "--out", str(tmp_path))
    assert "pip install" in result.output and not list(tmp_path.iterdir())


def test_figures_and_picture_are_named(tmp_path):
    result = run("sonar-calibration", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    assert (
        report.read(str(tmp_path), "sonar-calibration") is not None
        and (tmp_path / "sonar-calibration.png").exists()
    )


def test_a_real_robot_is_driven_by_this_process(monkeypatch):
    """So that a signal which ends it stops the robot too."""
    monkeypatch.setattr(cli, "timed", lambda name, setting: (name, None, os.getpid()))
    found = list(cli._results(["square"], Setting("", port="/dev/ttyACM0"), Console()))
    assert found == [("square", None, os.getpid())]


def test_a_step_test_that_fails_stops_the_robot_before_it_ends_the_mirror(monkeypatch):
    ended = []
    driver, mirror = mock.MagicMock(), mock.MagicMock()
    driver.return_value.__exit__.side_effect = lambda *_: ended.append("robot")
    mirror.return_value.close.side_effect = lambda: ended.append("mirror")
    monkeypatch.setattr(step_test, "Driver", driver)
    monkeypatch.setattr(step_test, "Mirrored", mirror)
    monkeypatch.setattr(step_test, "_go", mock.Mock(side_effect=MrlError("not reached")))
    with pytest.raises(MrlError):
        step_test.run(Setting("", port="/dev/ttyACM0"))
    assert ended == ["robot", "mirror"]


def test_others_go_on_when_one_fails(monkeypatch):
    """The failure comes when all are done, in one line."""
    monkeypatch.setattr(cli, "timed", outcome)
    monkeypatch.setattr(workers, "pool", at_once)
    found = []
    with pytest.raises(MrlError, match="(power|square): no; (power|square): no") as caught:
        found.extend(cli._results(["power", "square", "l-course"], Setting(""), Console(quiet=True)))
    assert [name for name, *_ in found] == ["l-course"] and caught.value.exit_code == ConfigError.exit_code
