"""Names that programs import keep working, wherever the modules stand."""

import importlib

import pytest

import mrl_driver

from .blocks import blocks

PUBLIC = {
    "mrl_driver.driver": ["Driver", "Options", "Telemetry", "Board"],
    "mrl_driver.stepped": ["SteppedDriver"],
    "mrl_driver.robots": ["load", "RobotModel"],
    "mrl_driver.errors": ["MrlError", "BoardTimeout", "LinkLost"],
    "mrl_driver.table": ["COMMANDS"],
    "mrl_driver.terminal.shown_state": ["line", "snapshot"],
    "mrl_driver.terminal.trail": ["Trail"],
    "mrl_driver.codec": ["FrameDecoder", "encode_reply", "encode_request"],
    "sim_arduino.board": ["PythonBoard"],
    "sim_arduino.boards": ["make", "Options"],
    "sim_arduino.grid_map": ["draw", "write"],
    "sim_arduino.laser": ["LaserScanner"],
    "sim_arduino.plant": ["Plant"],
    "sim_arduino.testing": ["EmulatedBoard"],
    "sim_arduino.world_file": ["load"],
}
"""What the documents of this version and of earlier ones import, by module."""


@pytest.mark.parametrize("module, name", [(m, n) for m, names in PUBLIC.items() for n in names])
def test_a_documented_name_is_there(module, name):
    assert hasattr(importlib.import_module(module), name)


def test_the_packages_example_is_the_readmes():
    example = next(each.text for each in blocks("README.md") if each.language == "python")
    assert example in (mrl_driver.__doc__ or "")
