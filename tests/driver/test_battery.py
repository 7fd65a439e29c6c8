import math

import pytest

from mrl_driver.errors import BatteryDead
from mrl_driver.robot.battery import (
    EMPTY,
    EMPTY_AFTER_S,
    LOW,
    OFF,
    OK,
    BatteryMonitor,
    require_charge,
    voltage_text,
)
from mrl_driver.robot.models import load

LEVELS = load("traxbot").battery


def state_after(*volts, period_s=1.0):
    monitor = BatteryMonitor(LEVELS)
    return [monitor.update(value, i * period_s) for i, value in enumerate(volts)]


def test_a_full_battery_is_ok():
    assert state_after(12.0) == [OK]


def test_below_nine_volts_is_low():
    assert state_after(8.9) == [LOW]


def test_a_short_dip_is_not_empty():
    assert state_after(8.0, 8.0, 12.0) == [LOW, LOW, OK]


def test_five_seconds_below_are_empty():
    assert state_after(*[8.4] * 7) == [LOW] * int(EMPTY_AFTER_S) + [EMPTY] * 2


def test_a_dip_starts_the_five_seconds_anew():
    assert EMPTY not in state_after(8.4, 8.4, 8.4, 8.6, 8.4, 8.4, 8.4, 8.4)


def test_low_does_not_flicker():
    assert state_after(8.9, 9.1, 8.9, 9.3) == [LOW, LOW, LOW, OK]


def test_empty_does_not_flicker():
    assert state_after(*[8.4] * 6, 8.6)[-1] == EMPTY


@pytest.mark.parametrize("between_v", [8.75, 0.3])
def test_after_empty_has_ended_a_short_dip_is_not_empty_at_once(between_v):
    assert state_after(*[8.4] * 6, between_v, 8.4, 8.4)[-3:] != [EMPTY] * 3
    assert state_after(*[8.4] * 6, between_v, 8.4, 8.4)[-2:] == [LOW, LOW]


def test_no_motor_power_shows_at_once():
    assert state_after(12.0, 0.3) == [OK, OFF]


def test_motor_power_that_returns_is_ok():
    assert state_after(0.3, 12.0) == [OFF, OK]


def test_a_start_without_motor_power_is_refused():
    with pytest.raises(BatteryDead, match="0.40 V: motor power is off"):
        require_charge(0.4, LEVELS)


def test_a_start_with_an_empty_battery_is_refused():
    with pytest.raises(BatteryDead, match="8.40 V, expected at least 8.5 V"):
        require_charge(8.4, LEVELS)


def test_a_start_with_a_low_battery_is_allowed():
    require_charge(8.5, LEVELS)


def test_a_voltage_that_is_not_measured_changes_no_state():
    """NaN for ten seconds; a low voltage for as long would be empty."""
    assert state_after(*[math.nan] * 21) == [OK] * 21
    require_charge(math.nan, LEVELS)


def test_a_voltage_that_is_not_measured_is_said_so():
    assert [voltage_text(each) for each in (11.44, math.nan)] == ["11.4 V", "not measured"]
