"""A recording as a table: CSV with a row for each telemetry, for spreadsheets, pandas and PlotJuggler.  No ROS."""

import csv
import math
from typing import Any, Callable, Optional, Sequence

from mrl_driver.driver import Telemetry
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.session.events import SensorRead
from mrl_driver.view.live_json import AtTelemetry, key
from mrl_driver.view.series import Series
from mrl_driver.view.shown_state import has_motors

TIMES = ("time_s", "timestamp")
"""When the row's telemetry arrived, since the recording began; and when the board measured it, since 1970 [s]."""


def write(recorded: RecordedDriver, path: str, advance: Callable[[float], None]) -> int:
    """Play a recording into a file; return the number of rows.  `advance` is as for `RecordedDriver.play`.

    The columns are the values that the board has, named as the keys of `mrl monitor --udp`.  A cell is empty if its
    value is not known, `inf` if a sonar sees nothing in range, and `-inf` if something is too close.  Boards without
    motors have no telemetry: theirs are rows for the readings of sensors.  OSError if the file cannot be written.
    """
    with open(path, "w", newline="", encoding="utf-8") as file:
        table = _Table(recorded, csv.writer(file, lineterminator="\n"))
        recorded.play(advance)
    return table.rows


class _Table:
    """Writes rows while a recording is played."""

    def __init__(self, recorded: RecordedDriver, out: Any) -> None:
        self._recorded, self._out = recorded, out
        self.rows = 0
        self._robot: Any = None
        self._series: Optional[Series] = None
        recorded.on_telemetry(self._on_telemetry)
        recorded.on(SensorRead, self._on_sensor)

    def _on_telemetry(self, telemetry: Telemetry) -> None:
        if self._robot is None:
            self._robot = AtTelemetry(self._recorded)
        self._robot.telemetry = telemetry
        self._add(telemetry.stamp_s, telemetry.counts)

    def _on_sensor(self, read: SensorRead) -> None:
        if not has_motors(self._recorded.model):
            self._robot = self._recorded
            self._add(read.reading.stamp_s, ())

    def _add(self, stamp_s: float, counts: Sequence[float]) -> None:
        recorded, series = self._recorded, self._series
        if series is None:
            series = self._series = Series(self._robot)
            names = getattr(counts, "_fields", ())
            self._out.writerow([*TIMES, *(f"{name}_count" for name in names), *map(key, series.names)])
        values = recorded.time_s, recorded.clock_ahead_s + stamp_s, *counts, *series.values()
        self._out.writerow([None if math.isnan(value) else value for value in values])
        self.rows += 1
