"""Findings about battery and temperature."""

import math
from typing import Any, Iterator, Optional, Tuple

import numpy as np

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.robot.battery import EMPTY, LOW, OFF, BatteryMonitor

from .evidence import INFO, Finding, finding, heard, outside

SAG_SHARE, SAG_S = 0.1, 3.0
"""A battery sags if it loses more than this share of its full voltage within this time [s].  A pack of 12 V with 0.15
ohm loses 4 % while both motors run (3 A), and 12 % only while both stall (10 A)."""
SETTLED_S = 1.5  # the voltage is not used this long before and after the motor board did not answer [s]
LAGS = 3  # the voltage is read once a second
HOT_C = 60.0  # temperature of the motor board that is too high [degC], as in `mrl doctor`
_STATES = (
    (OFF, 88, "Motor power was off"),
    (EMPTY, 86, "The battery was empty"),
    (LOW, 60, "The battery was low"),
)


def check(drive: DriveData) -> Iterator[Finding]:
    """Return what is wrong with the supply."""
    known = _measured(drive)
    times_s, values = drive.battery.time_s[known], drive.battery.values[known]
    volts, heat, levels = values[:, 0], values[:, 1], drive.model.battery
    monitor = BatteryMonitor(levels)
    states = [monitor.update(float(each), float(at)) for at, each in zip(times_s, volts)]
    for state, weight, title in _STATES:
        if state in states:
            first = states.index(state)
            scale = f"{levels.empty_v:g} V is empty, {levels.full_v:g} V is full"
            text = f"The battery read {volts[first]:.1f} V ({scale})."
            yield finding(f"battery_{state}", weight, text, heard(drive, times_s[first], INFO), title=title)
            break
    sag = None if OFF in states else _sag(times_s, volts, SAG_SHARE * levels.full_v)
    if sag is not None:
        at, before_v, after_v = sag
        text = f"It fell from {before_v:.1f} V to {after_v:.1f} V within {SAG_S:g} s: a weak cell, or a poor contact."
        yield finding("battery_sag", 84, text, heard(drive, times_s[at], INFO))
    hot = np.flatnonzero(heat > HOT_C)
    if len(hot):
        text = f"It reached {np.nanmax(heat):.0f} degC."
        yield finding("hot", 50, text, heard(drive, times_s[hot[0]], INFO))


def _measured(drive: DriveData) -> Any:
    """Whether each reading was measured: a motor board that does not answer leaves zeros."""
    absent = [time_s for time_s, status in drive.statuses if "motor_board" in status.faults]
    return outside(drive.battery.time_s, [(at - SETTLED_S, at + SETTLED_S) for at in absent])


def _sag(times_s: Any, volts: Any, limit_v: float) -> Optional[Tuple[int, float, float]]:
    """Return the index of the reading after the largest fall, and the voltages before and after; None if all are
    small."""
    worst, found = limit_v, None
    for lag in range(1, 1 + LAGS):
        fall = volts[:-lag] - volts[lag:]
        fall[times_s[lag:] - times_s[:-lag] > SAG_S] = math.nan
        if np.any(fall > worst):
            at = int(np.nanargmax(fall))
            worst, found = fall[at], (at + lag, float(volts[at]), float(volts[at + lag]))
    return found
