import math

import pytest

from mrl_driver.errors import BatteryDead
from mrl_driver.robot import battery
from mrl_driver.robot.models import load

LEVELS = load("traxbot").battery


def states_after(*volts):
    """One reading a second."""
    monitor = battery.BatteryMonitor(LEVELS)
    return [monitor.update(value, float(i)) for i, value in enumerate(volts)]


@pytest.mark.parametrize(
    "volts, states",
    [
        ((8.9, 9.1, 8.9, 9.3), [battery.LOW, battery.LOW, battery.LOW, battery.OK]),
        ((8.0, 8.0, 12.0), [battery.LOW, battery.LOW, battery.OK]),
        ((8.4, 8.4, 8.4, 8.6, 8.4, 8.4, 8.4, 8.4), [battery.LOW] * 8),
        ((*[8.4] * 6, 8.6), [battery.LOW] * 5 + [battery.EMPTY] * 2),
        ((*[8.4] * 6, 8.75, 8.4, 8.4), [battery.LOW] * 5 + [battery.EMPTY] + [battery.LOW] * 3),
        ((*[8.4] * 6, 0.3, 8.4, 8.4), [battery.LOW] * 5 + [battery.EMPTY, battery.OFF] + [battery.LOW] * 2),
        ((12.0, 0.3, 12.0), [battery.OK, battery.OFF, battery.OK]),
        ([math.nan] * 21, [battery.OK] * 21),
    ],
    ids=[
        "low does not flicker",
        "a short dip is not empty",
        "a dip starts the five seconds anew",
        "empty does not flicker",
        "after empty a short dip is not empty at once",
        "nor after motor power was off",
        "no motor power shows at once",
        "not measured",
    ],
)
def test_states_of_a_battery(volts, states):
    assert states_after(*volts) == states


def test_five_seconds_below_are_empty():
    assert states_after(*[8.4] * 7) == [battery.LOW] * int(battery.EMPTY_AFTER_S) + [battery.EMPTY] * 2


@pytest.mark.parametrize(
    "volts, words", [(0.4, "0.40 V: motor power is off"), (8.4, "8.40 V, expected at least 8.5 V")]
)
def test_a_start_with_an_empty_battery_is_refused(volts, words):
    with pytest.raises(BatteryDead, match=words):
        battery.require_charge(volts, LEVELS)


def test_a_start_with_a_low_battery_or_one_that_is_not_measured_is_allowed():
    battery.require_charge(8.5, LEVELS)
    battery.require_charge(math.nan, LEVELS)
    assert battery.voltage_text(math.nan) == "not measured"
