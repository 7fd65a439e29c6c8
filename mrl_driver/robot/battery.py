"""Battery state from voltage and time, without I/O.

Sources of the levels: the 2013 host (motor power is off below 1 V, the battery is low below 8.5 V) and
(Araujo 2012) (packs are empty at about 9 V).
"""

import math
from typing import Optional

from mrl_driver.errors import BatteryDead

from .models import Battery

OK, LOW, EMPTY, OFF = "ok", "low", "empty", "off"

EMPTY_AFTER_S = 5.0
"""The voltage must stay low for this time [s], because a starting motor pulls it down for a moment."""
RECOVERY_V = 0.2
"""A state ends when the voltage is this much above its threshold [V], so that it does not flicker."""


def require_charge(volts: float, levels: Battery) -> None:
    """Raise BatteryDead before the start if the motors have no power or too little; NaN is not measured and passes."""
    if volts < levels.off_v:
        raise BatteryDead(
            f"battery reads {volts:.2f} V: motor power is off; switch it on or connect the battery "
            f"(expected at least {levels.empty_v:.1f} V)"
        )
    if volts < levels.empty_v:
        raise BatteryDead(
            f"battery reads {volts:.2f} V, expected at least {levels.empty_v:.1f} V to start; charge it, "
            "or override with --ignore-battery"
        )


def voltage_text(volts: float) -> str:
    """Return a voltage for people: `11.4 V`, or `not measured` for NaN."""
    return "not measured" if math.isnan(volts) else f"{volts:.1f} V"


class BatteryMonitor:
    """State of the battery while running: `ok`, `low` (warn), `empty` (stop gently), `off` (no power)."""

    def __init__(self, levels: Battery) -> None:
        self._levels = levels
        self._below_since_s: Optional[float] = None
        self.state = OK

    def update(self, volts: float, time_s: float) -> str:
        """Return the state after a reading of `volts` at `time_s` [s]; NaN (not measured) does not change it."""
        if math.isnan(volts):
            return self.state
        if volts < self._levels.off_v:
            self.state, self._below_since_s = OFF, None
            return OFF
        empty = self._is_empty(volts, time_s)
        low_v = self._levels.low_v + (RECOVERY_V if self.state == LOW else 0.0)
        self.state = EMPTY if empty else LOW if volts < low_v else OK
        return self.state

    def _is_empty(self, volts: float, time_s: float) -> bool:
        if self.state == EMPTY and volts < self._levels.empty_v + RECOVERY_V:
            return True
        if volts >= self._levels.empty_v:
            self._below_since_s = None
            return False
        if self._below_since_s is None:
            self._below_since_s = time_s
        return time_s - self._below_since_s >= EMPTY_AFTER_S
