"""The model file of a new robot."""

import math

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import BRIDGES
from mrl_driver.robot import models
from mrl_driver.robot.models import kit
from mrl_driver.robot.models.kit import Kit

ROVER = Kit("rover", 11, 65.0, 150.0, 1496.0, "tb6612")


def test_the_file_is_a_model():
    model = kit.model_of(ROVER)
    assert (model.name, model.ids) == ("rover", (11,))
    assert model.drive.wheel_separation_m == 0.15
    assert model.drive.metres_per_count == pytest.approx(math.pi * 0.065 / 1496, rel=1e-6)
    assert BRIDGES[model.board["bridge"]] == "tb6612"
    assert model.board["axis_radius"] == 7500 and model.board["wheel_radius"] == 3250


def test_a_new_robot_has_no_wiring():
    """Its board must not move before the wiring is known."""
    assert "wiring" not in kit.model_of(ROVER).board


@pytest.mark.parametrize("bridge", BRIDGES[1:])
def test_each_bridge_makes_a_model_and_has_wires(bridge):
    assert kit.model_of(ROVER._replace(bridge=bridge)).board["bridge"] == BRIDGES.index(bridge)
    assert len(kit.WIRES[bridge]) == 3


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("wheel_diameter_mm", 0, "wheel diameter .mm. is 0, expected a number from 10 to 650"),
        ("wheel_separation_mm", 700, "wheel separation .mm. is 700, expected a number from 30 to 650"),
        ("counts_per_turn", 0, "counts of a wheel turn is 0, expected a number from 4 to 100000"),
        ("counts_per_turn", math.nan, "counts of a wheel turn is nan"),
        ("bridge", "l293d", "bridge is 'l293d', expected vnh5019, cytron"),
        ("bridge", "unset", "bridge is 'unset', expected vnh5019"),
    ],
)
def test_what_no_robot_has_is_refused(field, value, words):
    with pytest.raises(ConfigError, match=words):
        kit.model_of(ROVER._replace(**{field: value}))


@pytest.mark.parametrize("text", ["", "0", "11x", "a x 4", "nan", "inf", "-4", "1000001"])
def test_other_counts_are_refused(text):
    with pytest.raises(
        ConfigError, match="expected a number from 4 to 100000, or a product such as 11 x 4 x 34"
    ):
        kit.parse_counts(text)


@pytest.mark.parametrize("counts", [4.0, 40.0, 979.62, 1496.0, 3276.7, 3276.8, 12000.0, 99999.9])
def test_gearbox_and_encoder_give_the_counts(counts):
    """Within half of the smallest step of both parameters."""
    gearbox, encoder = kit.gearbox_and_counts(counts)
    assert gearbox <= 32767 and encoder <= 32767
    assert gearbox * encoder / 100 == pytest.approx(counts, abs=gearbox / 200)


def test_a_new_robot_gets_the_lowest_free_id(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    folder = tmp_path / "mrl-driver" / "robots"
    folder.mkdir(parents=True)
    assert kit.free_id() == 11
    (folder / "rover.yaml").write_text(kit.text_of(ROVER))
    (folder / "broken.yaml").write_text("ids: [12]\n")
    assert kit.free_id() == 12 and models.by_id(11) == "rover"
