"""Periodic requests to the board's sensors (rows of `table.SENSORS`), and their last readings; without I/O or clock.

A sensor without a capability may be absent.  After two requests without an answer it is requested rarely.  If the
board's telemetry is the stream `SENSOR_STREAM`, the sensors in it are not requested.
"""

import math
from typing import Dict, FrozenSet, List, NamedTuple, Tuple

from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_NAME, SENSOR_BY_NAME, SENSORS, Sensor

ABSENT_S = 10.0  # period of the requests to a sensor that has not answered and may be absent [s]
PATIENCE = 2
OLD_S = 2.0  # a reading older than this plus two periods is ignored [s]
LEAST_2013_S = 1.0
"""Shortest period of the requests to one sensor of a 2013 board, which executes few requests while it streams [s]."""
BY_CODE: Dict[int, Sensor] = {row.code: row for row in SENSORS}
SENSOR_STREAM = "start_sensor_ldr_stream"
"""Row of the stream that has counters and sensors; the telemetry of 2013 boards with environment sensors."""
# Position in a frame of `SENSOR_STREAM` of each sensor that is in it: alcohol, dust, light.  The hottest pixel is left
# out, because the thermopile has all pixels.
STREAMED: Dict[str, int] = {
    row.name: at
    for row in SENSORS
    for at, field in enumerate(BY_NAME[SENSOR_STREAM].reply)
    if row.fields == (field,)
}
LAST_2013 = 28  # last command code of 2013 boards


class Reading(NamedTuple):
    """A sensor's reading: its fields in order, in their base units, and its time [s, caller's clock]."""

    values: Tuple[float, ...]
    stamp_s: float


def reading(sensor: Sensor, args: Tuple[int, ...], now: float) -> Reading:
    """Convert the fields of a reply to their base units.

    2013 boards send a dust value above 32767 as a negative number.
    """
    if sensor.name == "dust":
        args = (args[0] & 0xFFFF,)
    return Reading(tuple(value * field.scale for value, field in zip(args, sensor.fields)), now)


def streamed(args: Tuple[int, ...], now: float) -> Dict[str, Reading]:
    """Return the readings in a frame of `SENSOR_STREAM`."""
    return {name: reading(SENSOR_BY_NAME[name], args[at : at + 1], now) for name, at in STREAMED.items()}


def of_board(capabilities: FrozenSet[str], version: int) -> List[Sensor]:
    """Return the sensors that a board has or may have.

    A 2013 board has those in its stream, and those that it knows the commands of: no compass, because its stream of
    bearings would end the telemetry.
    """
    if version >= 2:
        return [row for row in SENSORS if not row.capability or row.capability in capabilities]
    known = [row for row in SENSORS if row.code <= LAST_2013 or row.name in STREAMED]
    return [row for row in known if row.capability in capabilities]


def text(sensor: Sensor, found: Reading) -> str:
    """Format a reading with its unit, such as `21.5 degC`."""
    digits = max(0, math.ceil(-math.log10(sensor.fields[0].scale)))
    numbers = " ".join(f"{value:.{min(3, digits)}f}" for value in found.values)
    return f"{numbers} {sensor.fields[0].base_unit}".strip()


class SensorPoll:
    """Requests a board's sensors, each with its period."""

    def __init__(self) -> None:
        self.readings: Dict[str, Reading] = {}  # the last reading of each sensor that has answered, by name
        self._due_s: Dict[int, float] = {}
        self._unanswered: Dict[int, int] = {}
        self._period_s: Dict[int, float] = {}
        self._told_s: Dict[str, float] = {}

    def begin(self, capabilities: FrozenSet[str], version: int, now: float, in_stream: bool = False) -> None:
        """Start: a board has been greeted; `in_stream` says that its telemetry is `SENSOR_STREAM`."""
        rows = of_board(capabilities, version)
        least_s = 0.0 if version >= 2 else LEAST_2013_S
        self._period_s = {row.code: max(least_s, row.period_ms / 1000) for row in rows}
        left = [row.code for row in rows if not (in_stream and row.name in STREAMED)]
        self._due_s = {code: now + self._period_s[code] for code in left}
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
            self._due_s[code] = now + (ABSENT_S if absent else self._period_s[code])
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
            self._due_s[frame.code] = now + self._period_s[frame.code]
        self.readings[row.name] = reading(row, frame.args, now)

    def in_stream(self, args: Tuple[int, ...], now: float) -> List[str]:
        """Store the readings in a frame of `SENSOR_STREAM`; return the names of those to report.

        Each is reported as often as a sensor that is requested.
        """
        found = streamed(args, now)
        self.readings.update(found)
        names = [
            name
            for name in found
            if now - self._told_s.get(name, -math.inf) >= SENSOR_BY_NAME[name].period_ms / 1000
        ]
        self._told_s.update(dict.fromkeys(names, now))
        return names

    def fresh(self, now: float) -> Dict[str, Reading]:
        """Return the readings that are not too old."""
        limits = {row.name: OLD_S + 2e-3 * row.period_ms for row in SENSORS}
        return {name: found for name, found in self.readings.items() if now - found.stamp_s <= limits[name]}
