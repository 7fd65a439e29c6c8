"""Experiments through ROS, called from any folder: paths are those of the caller."""

from types import SimpleNamespace

import pytest

from mrl_driver.errors import MrlError
from ros1_bridge.experiments import legs
from sim_arduino.experiments.experiment_robot import Setting


@pytest.fixture
def command_of(monkeypatch, tmp_path):
    """The command that an experiment is run by, from another folder."""
    commands = []

    def child(_, command, *__):
        commands.append(command)
        return SimpleNamespace(exit_code=0, output=list, signal=lambda _: None, finish=lambda _: None)

    monkeypatch.setattr(legs, "Child", child)
    monkeypatch.chdir(tmp_path)

    def run(setting):
        with pytest.raises(MrlError):
            legs.run("step-test", setting)
        return commands[0]

    return run


def test_results_go_to_the_callers_folder(command_of, tmp_path):
    assert str(tmp_path / "build" / "experiments") in command_of(Setting("build/experiments"))


def test_robot_is_the_callers_file(command_of, tmp_path):
    assert str(tmp_path / "own.yaml") in command_of(Setting("out", robot="own.yaml"))


def test_name_of_a_model_is_no_path(command_of):
    assert "stingbot" in command_of(Setting("out", robot="stingbot"))
