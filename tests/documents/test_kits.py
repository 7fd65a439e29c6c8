"""The robots of docs/robots: the page's commands write their files, and the diagrams show each wire of these."""

import collections
import xml.etree.ElementTree

import pytest
import yaml
from click.testing import CliRunner

from mrl_driver.cli.main import cli
from mrl_driver.errors import ConfigError
from mrl_driver.generate.wiring_diagram import wiring_diagram
from mrl_driver.robot import models
from mrl_driver.robot.chips import CHIPS

from .blocks import ROOT
from .shown import shown

FOLDER = ROOT / "docs" / "robots"
PAGE = "docs/robots/kits.md"
KITS = [path.stem for path in sorted(FOLDER.glob("*.yaml"))]
EACH_KIT = pytest.mark.parametrize("kit", KITS)
OTHERS = ("USB", "5V", "GND", "VM")
"""What a row begins with, besides the pins of a robot's file; VM is an input of the TB6612 from the battery."""
TB6612 = {"pwm_a": "PWM{}", "pwm_b": "{}IN1", "logic": "{}IN2"}
"""Inputs of a channel of the TB6612 by the functions of their pins: the column of HARDWARE.md."""


def texts(path):
    """The texts of a robot's diagram."""
    return xml.etree.ElementTree.fromstring(wiring_diagram(str(path))).findall("{*}text")


def drawn(path):
    """What each row of a diagram leads a pin to: pairs of texts at the same height."""
    rows = collections.defaultdict(list)
    for each in texts(path):
        rows[int(each.get("y"))].append((int(each.get("x")), each.text))
    lines = (sorted(row) for row in rows.values())
    return [tuple(text for _, text in line[:2]) for line in lines if len(line) > 1]


def pins_of(kit):
    """The pins of a robot's file, by function."""
    file = yaml.safe_load((FOLDER / f"{kit}.yaml").read_text(encoding="utf-8"))
    return {name: pin for name, pin in file["wiring"].items() if name not in ("chip", "i2c")}


@EACH_KIT
def test_the_pages_command_writes_the_robots_file(kit, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    words = next(each.words for each in shown() if each.document == PAGE and each.words[1:3] == ["new", kit])
    CliRunner().invoke(cli, words[1:], standalone_mode=False, catch_exceptions=False)
    written = (tmp_path / "mrl-driver" / "robots" / f"{kit}.yaml").read_text(encoding="utf-8")
    kept = (FOLDER / f"{kit}.yaml").read_text(encoding="utf-8")
    assert written.splitlines()[1:] == kept.splitlines()[1:]  # the first one has the path of the schema


@EACH_KIT
def test_each_pin_of_the_file_has_one_wire(kit):
    chip = CHIPS[models.load(str(FOLDER / f"{kit}.yaml")).chip]
    wires = [pin for pin, _ in drawn(FOLDER / f"{kit}.yaml") if pin not in OTHERS]
    assert sorted(wires) == sorted([*pins_of(kit).values(), *map(chip.label, chip.bus)])


@EACH_KIT
def test_motors_and_encoders_are_at_the_inputs_of_their_wheels(kit):
    wires, pins = drawn(FOLDER / f"{kit}.yaml"), pins_of(kit)
    for wheel, channel in (("left", "A"), ("right", "B"), ("rear_left", "A"), ("rear_right", "B")):
        for function, name in TB6612.items():
            if f"{wheel}_{function}" in pins:
                assert (pins[f"{wheel}_{function}"], name.format(channel)) in wires
        for line in "ab":
            if f"{wheel}_encoder_{line}" in pins:
                what = f"{line.upper()} of {wheel.replace('_', ' ')}"
                assert (pins[f"{wheel}_encoder_{line}"], what) in wires


@EACH_KIT
def test_each_input_of_a_bridge_has_its_resistor(kit):
    """A motor must not start while the pins float."""
    root = xml.etree.ElementTree.fromstring(wiring_diagram(str(FOLDER / f"{kit}.yaml")))
    assert len(root.findall("{*}circle")) == sum(name.endswith(tuple(TB6612)) for name in pins_of(kit))


def test_a_part_that_the_robot_lacks_is_not_drawn(tmp_path):
    path = tmp_path / "bare.yaml"
    lines = (FOLDER / "two_wheels.yaml").read_text(encoding="utf-8").splitlines()
    lacking = ("bumper_", "battery: A3", "range_1", "i2c")
    kept = [each for each in lines if not each.strip().startswith((*lacking, "sonars", "front"))]
    path.write_text("\n".join([*kept, "sonars: {}"]))
    parts = {each.text for each in texts(path) if each.get("class") == "b"}
    assert parts == {"Uno or Nano", "Computer", "TB6612 (1)", "Encoders"}


@pytest.mark.parametrize(
    "line, other, words",
    [
        ("  i2c: true", "  emergency_stop: D35\n  i2c: true", "no part has pin_emergency_stop"),
        ("bridge: tb6612", "bridge: vnh5019", "bridge vnh5019 has no picture"),
    ],
)
def test_what_has_no_picture_is_refused(line, other, words, tmp_path):
    path = tmp_path / "other.yaml"
    path.write_text((FOLDER / "four_wheels.yaml").read_text(encoding="utf-8").replace(line, other))
    with pytest.raises(ConfigError, match=words):
        wiring_diagram(str(path))
