"""Sonar values of the wire to ranges in metres, and which of them are new.  No I/O.

Ranges follow REP 117: -inf means too near, nan no valid reading, +inf nothing in range.
"""

import math
from typing import Sequence, Tuple

from mrl_driver.protocol.table import RANGE_NOTHING, SONAR_NOTHING

from .models import CHAIN_S, MB1300, RangeKind

NAMES = ("front", "left", "right")  # the sonars in the order of the wire
FIELD_OF_VIEW_RAD, NEAREST_M, FARTHEST_M = MB1300[1:4]
VOLTS_PER_COUNT, LEAST_COUNT = 5 / 1024, 4
"""Counts of the board's converter.  An analog sensor whose count is below the least, 20 mV, has no supply, or its wire
is open; without an obstacle its output is higher [V]."""
AGREE_CM = 20
"""More than the noise of a reading, and than a robot drives between two of them; less than most damaged digits make."""

_A_2013, _A, _B, _C = 1.767, 1.1767, 0.94657, -0.3759
NOTHING_2013_CM = int(_A_2013 * 640**_B + _C)
"""Wire value [cm] that 2013 boards send for 640 counts (1 count is about 1 cm; the maximum is 6.45 m): 800."""


def range_m(wire_cm: int, version: int = 2) -> float:
    """Return the range [m] for a sonar value of the wire [cm], from a board with this firmware version.

    Boards of version 1 (2013) use 1.767 as the factor of the curve, (Araujo 2012) 1.1767; this function corrects it.
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


def _near(value_m: float, nearest_m: float = NEAREST_M) -> float:
    return value_m if value_m >= nearest_m else -math.inf


def input_range_m(wire: int, kind: RangeKind) -> float:
    """Return the range [m] for a value of `read_ranges`: that of an HC-SR04 [mm], or the count of an analog sensor."""
    if wire < (LEAST_COUNT if kind.curve else 0):
        return math.nan
    far = wire >= RANGE_NOTHING
    value_m = math.inf if far else _curve_m(wire, kind.curve) if kind.curve else wire / 1000
    return math.inf if value_m > kind.farthest_m else _near(value_m, kind.nearest_m)


def _curve_m(count: int, curve: Sequence[Tuple[float, float]]) -> float:
    """Return the distance for a count [m]; between two points the voltage is linear in the reciprocal of the distance.

    It is infinite below the last voltage, and minus infinity above the first.
    """
    volts = (count + 0.5) * VOLTS_PER_COUNT
    for (near_m, most_v), (far_m, least_v) in zip(curve, curve[1:]):
        if least_v <= volts <= most_v:
            share = (volts - least_v) / (most_v - least_v)
            return 1 / (1 / far_m + share * (1 / near_m - 1 / far_m))
    return math.inf if volts < curve[-1][1] else -math.inf


class RepeatedReadings:
    """Believes a value of a board without checksums once two frames in a row have it, to within `AGREE_CM`.

    A 2013 board streams 325 frames a second, each with all sonars, so a true value waits for 3 ms.
    """

    def __init__(self) -> None:
        self._last: Tuple[int, ...] = ()
        self._believed: Tuple[int, ...] = ()

    def update(self, values: Tuple[int, ...]) -> Tuple[int, ...]:
        """Return the values to use [cm]; those of the first frame count at once."""
        rows = zip(values, self._last or values, self._believed or values)
        self._believed = tuple(new if abs(new - last) <= AGREE_CM else old for new, last, old in rows)
        self._last = values
        return self._believed


class NewReadings:
    """Finds the sonars with a new reading, because every frame of the stream repeats the old ones.

    A changed value is new.  An unchanged value counts as new once per cycle, because it was measured again with the
    same result.
    """

    def __init__(self, names: Sequence[str] = NAMES, cycle_s: float = CHAIN_S) -> None:
        self.values: Tuple[int, ...] = ()
        """The last values.  As long as they are equal, and before `due_s`, nothing is new."""
        self.due_s = -math.inf
        self._names, self._cycle_s, self._due_s = names, cycle_s, [-math.inf] * len(names)

    def update(self, values: Tuple[int, ...], time_s: float) -> Tuple[str, ...]:
        """Return the names of the sonars with a new reading at `time_s` [s]."""
        old, self.values = self.values or (None,) * len(self._names), values
        new = [i for i, value in enumerate(values) if value != old[i] or time_s >= self._due_s[i]]
        for i in new:
            self._due_s[i] = time_s + self._cycle_s
        self.due_s = min(self._due_s)
        return tuple(self._names[i] for i in new)
