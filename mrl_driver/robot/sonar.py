"""Sonar values of the wire to ranges in metres, and which of them are new.  Pure.

Ranges follow REP-117: -inf is too near, nan no valid reading, +inf nothing in range.
"""

import math
from typing import Tuple

from mrl_driver.protocol.table import SONAR_NOTHING

NAMES = ("front", "left", "right")
"""The sonars in the order of the wire."""
NEAREST_M = 0.15
"""Dead zone of the MB1300 (robots' data sheet)."""
FARTHEST_M = 6.45
FIELD_OF_VIEW_RAD = math.radians(36.0)
CYCLE_S = 0.3
"""The chain of three gives each sonar a reading about this often (100 ms for each of them)."""

_A_2013, _A, _B, _C = 1.767, 1.1767, 0.94657, -0.3759
NOTHING_2013_CM = int(_A_2013 * 640**_B + _C)
"""What 2013 boards send for counts of 640 (1 count is about 1 cm, 6.45 m is the most): 800."""


def range_m(wire_cm: int, version: int = 2) -> float:
    """Range [m] for a sonar value of the wire [cm], from a board of that firmware version.

    Boards of version 1 (2013) have 1.767 as the curve's factor where the thesis has 1.1767; that is undone
    here.
    """
    if version < 2:
        return _range_2013(wire_cm)
    if wire_cm < 0:
        return math.nan
    return math.inf if wire_cm >= SONAR_NOTHING else _near(wire_cm / 100)


def _range_2013(wire_cm: int) -> float:
    if wire_cm <= 0:
        return math.nan
    if wire_cm >= NOTHING_2013_CM:
        return math.inf
    return _near(((wire_cm - _C) * _A / _A_2013 + _C) / 100)


def _near(value_m: float) -> float:
    return value_m if value_m >= NEAREST_M else -math.inf


class NewReadings:
    """Tells which sonars have a new reading; the wire repeats the old one in every frame.

    A value that changed is new.  One that did not counts as new once per cycle of the chain, for it was
    measured again and came out the same.
    """

    def __init__(self, cycle_s: float = CYCLE_S) -> None:
        self._cycle_s = cycle_s
        self._values: Tuple[int, ...] = ()
        self._due_s = [-math.inf] * len(NAMES)
        self._first_due_s = -math.inf

    def update(self, values: Tuple[int, ...], time_s: float) -> Tuple[str, ...]:
        """Names of the sonars that are new at `time_s` [s]."""
        if values == self._values and time_s < self._first_due_s:
            return ()
        old, self._values = self._values or (None,) * len(NAMES), values
        new = [i for i, value in enumerate(values) if value != old[i] or time_s >= self._due_s[i]]
        for i in new:
            self._due_s[i] = time_s + self._cycle_s
        self._first_due_s = min(self._due_s)
        return tuple(NAMES[i] for i in new)
