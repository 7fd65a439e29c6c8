"""The pins in HARDWARE.md, in tables and drawings, are those of the firmware's pins.h."""

import re

import pytest

from .blocks import ROOT

PINS = (ROOT / "firmware" / "mrl_firmware" / "pins.h").read_text(encoding="utf-8")
TEXT = (ROOT / "HARDWARE.md").read_text(encoding="utf-8")
BRIDGE = TEXT.split("## H-bridge build")[1].split("\n## ")[0]
DRAWN = {"L298N": "L298N module", "TB6612": "TB6612 board"}
"""Bridges with a drawing, and their columns in the table of wires."""


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


def rows_of(text):
    """Cells of the rows that begin with a pin."""
    lines = re.findall(r"^\| (?:[AD]\d+) \|.*\|$", text, re.M)
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def column(rows, at):
    """Names in one column and their pins."""
    return {name: number(row[0]) for row in rows for name in re.findall(r"`(\w+)`", row[at])}


def terminals(title):
    """Pins of the terminals of a bridge, in the table of wires."""
    (head,) = re.findall(r"^\| Uno pin \| function \| VNH.*$", BRIDGE, re.M)
    at = [cell.strip() for cell in head.strip("|").split("|")].index(title)
    return {row[at]: row[0] for row in rows_of(BRIDGE) if len(row) > at}


def test_the_pin_table_is_that_of_the_firmware():
    rows = rows_of(TEXT.split("## Pins")[1].split("##")[0])
    assert [column(rows, at) for at in range(1, 6)] == in_header()


def test_each_wire_of_a_bridge_is_at_its_pin():
    wires, bridge = column(rows_of(BRIDGE), 1), in_header()[2]
    assert wires == {name: pin for name, pin in bridge.items() if "PWM" in name or "LOGIC" in name}


@pytest.mark.parametrize("name", DRAWN)
def test_a_drawing_shows_the_pins_of_its_table(name):
    drawing = BRIDGE.split(f"### {name}, step by step")[1].split("```")[1]
    drawn = re.findall(r"Uno (D\d+) +-+\| (\w+)", drawing)
    assert {terminal: pin for pin, terminal in drawn} == terminals(DRAWN[name])


def test_the_divider_is_drawn_at_its_pin():
    (pin,) = re.findall(r"Uno ([AD]\d+) -+\+---- 100 nF", BRIDGE)
    assert number(pin) == in_header()[2]["BATTERY"]
