"""The recipe for a sensor of one's own is carried out as it is written, in a copy of the tree."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from mrl_driver.protocol.table import SENSORS

from .blocks import ROOT, blocks, files

RECIPE = "firmware/SENSORS.md"
PARTS = (
    "Makefile",
    "firmware",
    "mrl_driver",
    "sim_arduino",
    "ros1_bridge",
    "build/firmware/core",
    "build/sim",
)
STEP_C = 0.0625  # One count of the example's wire [degC]
_TAKEN = {row.i2c.address for row in SENSORS if row.i2c}
ADDRESS = next(each for each in range(0x48, 0x50) if each not in _TAKEN)
NAME = "recipe_temperature"


def own(text):
    """The recipe's words, for a sensor under a name and an address that the table does not have yet."""
    for written, free in (("air_temperature", NAME), ("0x48", hex(ADDRESS))):
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
    return json.loads(run(tree, sys.executable, str(script), "world.yaml", NAME))


@pytest.mark.parametrize("place, wanted_c", [("far", 18.0), ("near", 45.0)])
def test_the_sensor_is_read_by_the_driver(result, place, wanted_c):
    """Far from the warm place by the Python engine, in its middle by the real image on the simulated chip."""
    found = result[place]
    assert found["values"] == pytest.approx([wanted_c], abs=STEP_C)
    assert found["lost"] == 0 and not found["faults"]


@pytest.mark.parametrize("place, shown", [("far", "18.0"), ("near", "45.0")])
def test_it_is_shown_recorded_and_a_topic(result, place, shown):
    found = result[place]
    assert f"{NAME} {shown}" in found["line"]
    assert found["recorded"] == pytest.approx([float(shown) / STEP_C], abs=1)
    assert found["topic"] == ["one/air", pytest.approx(float(shown), abs=STEP_C), 0.25]


def test_a_board_without_it_has_no_fault(result):
    assert result["absent"] == {"faults": [], "read": False}
