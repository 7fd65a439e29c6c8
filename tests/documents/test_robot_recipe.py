"""The robot of CONTRIBUTING.md: one YAML file, found by name, that drives in the emulator."""

import pytest

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from mrl_driver.robot import models
from sim_arduino.board import parameter_store
from sim_arduino.serve import factory

from .blocks import blocks

BLOCK = next(block.text for block in blocks("CONTRIBUTING.md") if "name: eswarbot" in block.text)
NAME = "recipe-robot"
_TAKEN = {each for name in models.packaged() for each in models.load_packaged(name).ids}
IDS = sorted(set(range(11, 100)) - _TAKEN)[:3]
TEXT = BLOCK.replace("eswarbot", NAME).replace("[11, 12, 13]", str(IDS))
"""The recipe's robot, under a name and with ids that no packaged model has."""
PLACE_M, WAY_M = 0.01, 0.4


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A user's folder of models with the eSwarBot in it."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    folder = tmp_path / "mrl-driver" / "robots"
    folder.mkdir(parents=True)
    (folder / f"{NAME}.yaml").write_text(TEXT)
    return folder


def test_it_is_found_by_name_and_by_id(home):
    assert (models.load(NAME).name, models.by_id(IDS[1])) == (NAME, NAME)
    assert models.names() == sorted([NAME, *models.packaged()])


@pytest.mark.parametrize("engine", ["python", "avr"])
def test_it_drives_as_far_as_it_is_told(home, engine):
    """And its board's idea of its wheels agrees with the driver's."""
    emulated = factory.make(factory.Options(robot=NAME, engine=engine, world="corridor"))
    with SteppedDriver(emulated.engine, options=Options(command_timeout_s=None)) as robot:
        start = emulated.plant.true_pose
        robot.drive(0.2, 0.0)
        robot.wait(WAY_M / 0.2 + 0.15)
        robot.stop()
        robot.wait(0.2)
        assert robot.model.name == NAME
        number = PARAMETER_BY_NAME["axis_radius"].number
        assert robot.ask(BY_NAME["read_config"].code, number) == (number, robot.model.board["axis_radius"])
        went_m = emulated.plant.true_pose.x_m - start.x_m
        assert robot.pose.x_m == pytest.approx(went_m, abs=PLACE_M)
        assert went_m == pytest.approx(WAY_M, abs=0.1)
    emulated.close()


def test_a_blank_board_becomes_one(home):
    """The firmware's own defaults for an unknown id are TraxBot's."""
    model, board = models.load(NAME), factory.make(factory.Options(robot="traxbot", robot_id=0)).engine
    with SteppedDriver(board, model, Options(any_id=True)) as robot:
        robot.parameters.save_model(IDS[0], model)
    values = parameter_store.Config(board.eeprom)
    assert {name: values[name] for name in model.board} == model.board and values["robot_id"] == IDS[0]


def test_a_users_file_comes_before_the_packaged_one(home):
    text = TEXT.replace(str(IDS), "[2]").replace("0.120", "0.181")
    (home / "my-traxbot.yaml").write_text(text.replace(f"name: {NAME}", "name: my-traxbot"))
    assert [models.by_id(1), models.by_id(2)] == ["traxbot", "my-traxbot"]
    (home / "traxbot.yaml").write_text(text)
    assert models.load("traxbot").drive.wheel_separation_m == 0.181
    assert models.load_packaged("traxbot").drive.wheel_separation_m == 0.180
