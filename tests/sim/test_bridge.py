"""The truth table of each bridge, and shares of time for duties on its wires."""

import pytest

from mrl_driver.protocol.table import BRIDGES as NAMES
from mrl_driver.protocol.table import PARAMETER_BY_NAME
from sim_arduino.hardware.bridge import BRIDGES, Shares

LEVELS = [f"{bits:03b}" for bits in range(8)]
TABLES = {
    "vnh5019": "coast coast coast brake brake backward forward brake",
    "cytron": "brake brake brake brake forward backward forward backward",
    "l298n": "coast coast coast coast brake backward forward brake",
    "tb6612": "coast brake brake brake coast backward forward brake",
    "drv8833": "coast coast backward backward forward forward brake brake",
    "bts7960": "brake brake backward backward forward forward brake brake",
}
"""States at 000, 001, ... 111 of the wires PWM_A, PWM_B, LOGIC, copied from the data sheets named in `bridge.py`."""


def bridge(name):
    return BRIDGES[NAMES.index(name)]


def test_every_value_of_the_parameter_has_a_bridge():
    row = PARAMETER_BY_NAME["bridge"]
    assert sorted(BRIDGES) == list(range(row.low + 1, row.high + 1))


@pytest.mark.parametrize("name", TABLES)
def test_the_states_are_those_of_the_data_sheet(name):
    assert [bridge(name).state(levels).value for levels in LEVELS] == TABLES[name].split()


@pytest.mark.parametrize("name", TABLES)
def test_the_shares_of_constant_levels_are_the_state(name):
    for levels in LEVELS:
        shares = bridge(name).shares(*map(float, levels))
        assert getattr(shares, bridge(name).state(levels).value) == 1.0
        assert sum(shares) == 1.0


WITH_INPUT = ("vnh5019", "l298n", "tb6612")
"""Bridges that need wire B high for a drive forward."""
BETWEEN = {"vnh5019": "coast", "l298n": "coast", "drv8833": "coast"}
"""What these bridges do between two pulses; the others brake."""


@pytest.mark.parametrize("name", TABLES)
def test_between_two_pulses_a_bridge_brakes_or_coasts(name):
    shares = bridge(name).shares(0.3, float(name in WITH_INPUT), 0.0)._asdict()
    expected = dict.fromkeys(shares, 0.0)
    expected.update({"forward": 0.3, BETWEEN.get(name, "brake"): 0.7})
    assert shares == pytest.approx(expected)


def test_an_inverted_pulse_beside_a_high_input_brakes_between():
    """Slow decay of a DRV8833: both wires of one timer rise together."""
    assert bridge("drv8833").shares(1.0, 0.7, 0.0) == pytest.approx(Shares(0.3, 0.0, 0.7, 0.0))
