"""The pin table of HARDWARE.md is the firmware's pins.h."""

import re

from .blocks import ROOT

PINS = (ROOT / "firmware" / "mrl_firmware" / "pins.h").read_text(encoding="utf-8")
TABLE = (ROOT / "HARDWARE.md").read_text(encoding="utf-8").split("## Pins")[1].split("##")[0]


def constants(text):
    """Names and Arduino numbers."""
    return {name: int(pin) for name, pin in re.findall(r"constexpr uint8_t (\w+) = (\d+);", text)}


def in_header():
    """Of every build, the builds with a motor board, the H-bridge build, sonars, environment sensors."""
    common, rest = PINS.split("#if MRL_BRIDGE")
    bridge, rest = rest.split("#else", 1)
    motor_board, rest = rest.split("#endif", 1)
    environment, rest = rest.split("#if MRL_ENVIRONMENT")[1].split("#else")
    sonar, _ = rest.split("#endif")
    return [constants(part) for part in (common, motor_board, bridge, sonar, environment)]


def number(pin):
    return int(pin[1:]) + (14 if pin[0] == "A" else 0)


def in_table():
    columns = [{}, {}, {}, {}, {}]
    for cells in re.findall(r"^\| ([AD]\d+) \|(.*)\|(.*)\|(.*)\|(.*)\|(.*)\|$", TABLE, re.M):
        for column, cell in zip(columns, cells[1:]):
            column.update({name: number(cells[0]) for name in re.findall(r"`(\w+)`", cell)})
    return columns


def test_pins_are_those_of_the_firmware():
    assert in_table() == in_header()
