"""Periodic requests to the board's sensors (rows of `table.SENSORS`), and their last readings; without I/O or clock.

A sensor without a capability may be absent.  After two requests without an answer it is requested rarely.
"""

import math
from typing import Dict, FrozenSet, List, NamedTuple, Tuple

from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import SENSORS, Sensor

ABSENT_S = 10.0
"""Period of the requests to a sensor that has not answered and may be absent [s]."""
PATIENCE = 2
OLD_S = 2.0
"""A reading older than this plus two periods is ignored [s]."""
BY_CODE: Dict[int, Sensor] = {row.code: row for row in SENSORS}


class Reading(NamedTuple):
    """A sensor's reading: its fields in order, in their base units, and its time [s, caller's clock]."""

    values: Tuple[float, ...]
    stamp_s: float


def reading(sensor: Sensor, args: Tuple[int, ...], now: float) -> Reading:
    """Convert the fields of a reply to their base units."""
    return Reading(tuple(value * field.scale for value, field in zip(args, sensor.fields)), now)


def of_board(capabilities: FrozenSet[str], version: int) -> List[Sensor]:
    """Return the sensors that a board has or may have."""
    return [row for row in SENSORS if version >= 2 and (not row.capability or row.capability in capabilities)]


def text(sensor: Sensor, found: Reading) -> str:
    """Format a reading with its unit, such as `21.5 degC`."""
    digits = max(0, math.ceil(-math.log10(sensor.fields[0].scale)))
    numbers = " ".join(f"{value:.{min(3, digits)}f}" for value in found.values)
    return f"{numbers} {sensor.fields[0].base_unit}".strip()


class SensorPoll:
    """Requests a board's sensors, each with its period.

    Attributes:
        readings: the last reading of each sensor that has answered, by name.
    """

    def __init__(self) -> None:
        self.readings: Dict[str, Reading] = {}
        self._due_s: Dict[int, float] = {}
        self._unanswered: Dict[int, int] = {}

    def begin(self, capabilities: FrozenSet[str], version: int, now: float) -> None:
        """Start: a board has been greeted."""
        self._due_s = {row.code: now + row.period_ms / 1000 for row in of_board(capabilities, version)}
        self._unanswered.clear()

    def end(self) -> None:
        """Stop: the board is away or is being greeted."""
        self._due_s.clear()

    @property
    def next_s(self) -> float:
        """Time of the next request [s]."""
        return min(self._due_s.values(), default=math.inf)

    def take(self, now: float) -> List[int]:
        """Return the codes of the requests to send now."""
        codes = [code for code, due_s in self._due_s.items() if due_s <= now]
        for code in codes:
            row, missing = BY_CODE[code], self._unanswered.get(code, 0)
            absent = missing >= PATIENCE and not row.capability
            self._due_s[code] = now + (ABSENT_S if absent else row.period_ms / 1000)
            self._unanswered[code] = missing + 1
        return codes

    @staticmethod
    def name_of(code: int) -> str:
        """Return the name of the sensor with this command code, or an empty string."""
        row = BY_CODE.get(code)
        return row.name if row else ""

    def heard(self, frame: Frame, now: float) -> None:
        """Store the reading if the frame is a sensor's answer."""
        row = BY_CODE.get(frame.code)
        if row is None:
            return
        if self._unanswered.pop(frame.code, 0) > PATIENCE and frame.code in self._due_s:
            self._due_s[frame.code] = now + row.period_ms / 1000
        self.readings[row.name] = reading(row, frame.args, now)

    def fresh(self, now: float) -> Dict[str, Reading]:
        """Return the readings that are not too old."""
        limits = {row.name: OLD_S + 2e-3 * row.period_ms for row in SENSORS}
        return {name: found for name, found in self.readings.items() if now - found.stamp_s <= limits[name]}
