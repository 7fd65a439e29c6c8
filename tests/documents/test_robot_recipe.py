"""The recipes of CONTRIBUTING.md for a robot and a sensor of one's own, carried out as they are written."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME, SENSORS
from mrl_driver.robot import models
from sim_arduino.board import parameter_store
from sim_arduino.serve import factory

from .blocks import ROOT, blocks, files

pytestmark = pytest.mark.timeout(600)  # it builds the firmware: minutes on a small computer
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


RECIPE = "firmware/SENSORS.md"
PARTS = (
    "Makefile",
    "firmware",
    "mrl_driver",
    "sim_arduino",
    "ros1_bridge",
    "build/firmware/core_uno",
    "build/sim",
)
STEP_C = 0.0625  # One count of the example's wire [degC]
_ADDRESSES = {row.i2c.address for row in SENSORS if row.i2c}
ADDRESS = next(each for each in range(0x48, 0x50) if each not in _ADDRESSES)
SENSOR = "recipe_temperature"


def own(text):
    """The recipe's words, for a sensor under a name and an address that the table does not have yet."""
    for written, free in (("air_temperature", SENSOR), ("0x48", hex(ADDRESS))):
        text = text.replace(written, free)
    return text


def run(tree, *command):
    environment = {**os.environ, "PYTHONPATH": str(tree), "MAKEFLAGS": ""}
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def carry_out(tree):
    """The three steps of the recipe."""
    for name, block in files(RECIPE).items():
        target, added = tree / own(name), own(block.text)
        if name == "mrl_driver/protocol/table.py":
            head, rest = target.read_text().split("SENSORS: Tuple[Sensor, ...] = (\n")
            rows, end, rest = rest.partition("\n)\n")
            text = head + "SENSORS: Tuple[Sensor, ...] = (\n" + rows + "\n" + added.rstrip() + end + rest
        else:
            text = (target.read_text() if target.exists() else "") + added
        target.write_text(text)
    run(tree, sys.executable, "-m", "mrl_driver.generate")


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    made = tmp_path_factory.mktemp("tree")
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            shutil.copytree(source, made / part)  # with its compiled modules
        elif source.exists():
            shutil.copy2(source, made / part)
    carry_out(made)
    return made


@pytest.fixture(scope="module")
def result(tree):
    run(tree, "make", "-s", "build/firmware/mrl_firmware.elf")
    (tree / "world.yaml").write_text(own(blocks(RECIPE)[-1].text))
    script = ROOT / "tests" / "documents" / "sensor_recipe.py"
    return json.loads(run(tree, sys.executable, str(script), "world.yaml", SENSOR))


@pytest.mark.parametrize("place, wanted_c", [("far", 18.0), ("near", 45.0)])
def test_the_sensor_is_read_by_the_driver(result, place, wanted_c):
    """Far from the warm place by the Python engine, in its middle by the real image on the simulated chip."""
    found = result[place]
    assert found["values"] == pytest.approx([wanted_c], abs=STEP_C)
    assert found["lost"] == 0 and not found["faults"]


@pytest.mark.parametrize("place, shown", [("far", "18.0"), ("near", "45.0")])
def test_it_is_shown_recorded_and_a_topic(result, place, shown):
    found = result[place]
    assert f"{SENSOR} {shown}" in found["line"]
    assert found["recorded"] == pytest.approx([float(shown) / STEP_C], abs=1)
    assert found["topic"] == ["one/air", pytest.approx(float(shown), abs=STEP_C), 0.25]


def test_a_board_without_it_has_no_fault(result):
    assert result["absent"] == {"faults": [], "read": False}
