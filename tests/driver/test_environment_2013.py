"""Boards of 2013 with environment sensors send gas, dust and light where others send sonars: no ranges come of that."""

import pytest

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.robot import models
from sim_arduino.serve import factory

PROFILES = ("2013-august", "2013-january")


def own_model(folder, robot_id, build=""):
    """A TraxBot's file with another id, and with a build where one is given."""
    path = folder / "own.yaml"
    text = (folder / models.__file__).with_name("traxbot.yaml").read_text(encoding="utf-8")
    path.write_text(text.replace("ids: [1, 2, 3]", f"ids: [{robot_id}]{build}"), encoding="utf-8")
    return str(path)


def told_ranges(model, **board):
    """Ranges of a second with a board, as telemetry and the driver tell them, and whether it has sonars."""
    emulated = factory.make(factory.Options(**board))
    told = {}
    try:
        with SteppedDriver(emulated.engine, model, options=Options(ignore_battery=True)) as driver:
            driver.on_telemetry(lambda each: told.update({name: each.ranges[name] for name in each.fresh}))
            driver.wait(1.0)
            return {**told, **driver.ranges}, driver.has_sonars
    finally:
        emulated.close()


@pytest.mark.parametrize("profile", PROFILES)
def test_build_of_the_model_leaves_no_ranges(tmp_path, profile):
    model = own_model(tmp_path, 2, "\nbuild: environment")
    assert told_ranges(model, robot_id=2, profile=profile, environment=True) == ({}, False)


@pytest.mark.parametrize("robot_id", [6, 10])
def test_ids_of_sensor_boards_leave_no_ranges(tmp_path, robot_id):
    model = own_model(tmp_path, robot_id)
    board = {"robot_id": robot_id, "profile": "2013-august", "environment": True}
    assert told_ranges(model, **board) == ({}, False)


@pytest.mark.parametrize("profile", PROFILES)
def test_boards_of_2013_with_sonars_have_ranges(profile):
    ranges, has_sonars = told_ranges("traxbot", profile=profile)
    assert set(ranges) == {"front", "left", "right"} and has_sonars


def test_board_that_tells_its_build_is_believed_whatever_its_id(tmp_path):
    ranges, has_sonars = told_ranges(own_model(tmp_path, 7), robot_id=7)
    assert set(ranges) == {"front", "left", "right"} and has_sonars


def test_unknown_build_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="build is 'sonnar', expected sonar or environment"):
        models.load(own_model(tmp_path, 2, "\nbuild: sonnar"))
