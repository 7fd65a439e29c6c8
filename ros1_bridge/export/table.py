"""A recording as a table: CSV with a row for each telemetry, for spreadsheets, pandas and PlotJuggler.  No ROS."""

import csv
import math
from typing import Any, Callable, List, Optional, Sequence, Set

from mrl_driver.driver import Telemetry
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.files import replacing
from mrl_driver.session.events import SensorRead
from mrl_driver.view.live_json import AtTelemetry, key
from mrl_driver.view.series import Series
from mrl_driver.view.shown_state import has_motors

TIMES = ("time_s", "timestamp")
"""When the row's telemetry arrived, since the recording began; and when the board measured it, since 1970 [s]."""
COUNTS = ("right_count", "left_count", "rear_count")


def write(recorded: RecordedDriver, path: str, advance: Callable[[float], None]) -> int:
    """Play a recording into a file; return the number of rows.  `advance` is as for `RecordedDriver.play`.

    The columns are named as the keys of `mrl monitor --udp`.  A cell is empty if its value is not known, `inf` if a
    sonar sees nothing in range, and `-inf` if something is too close.  Boards without motors have no telemetry: theirs
    are rows for the readings of sensors.

    Raises:
        OSError: the file cannot be written.
    """
    with open(path, "w", newline="", encoding="utf-8") as file:
        table = _Table(recorded, csv.writer(file, lineterminator="\n"))
        recorded.play(advance)
    if len(table.columns) > table.first_columns:
        _widen(path, table.columns)
    return table.rows


def _widen(path: str, columns: List[str]) -> None:
    """Give a file all columns, because some of them began after its first row."""
    with replacing(path) as wider, open(path, newline="", encoding="utf-8") as old, open(
        wider, "w", newline="", encoding="utf-8"
    ) as new:
        rows, out = csv.reader(old), csv.writer(new, lineterminator="\n")
        next(rows)
        out.writerow(columns)
        out.writerows(row + [""] * (len(columns) - len(row)) for row in rows)


class _Table:
    """Writes rows while a recording is played.  A column keeps its place; new ones, of a new sensor, come at the end.

    Attributes:
        first_columns: number of columns in the file's first line.
    """

    def __init__(self, recorded: RecordedDriver, out: Any) -> None:
        self._recorded, self._out = recorded, out
        self.columns: List[str] = []
        self.rows = self.first_columns = 0
        self._robot: Any = None
        self._series: Optional[Series] = None
        self._places: List[int] = []
        self._heard: Set[str] = set()
        recorded.on_telemetry(self._on_telemetry)
        recorded.on_imu(lambda _: self._note("imu"))
        recorded.on_sensor(self._on_sensor)

    def _on_telemetry(self, telemetry: Telemetry) -> None:
        if self._robot is None:
            self._robot = AtTelemetry(self._recorded)
        self._robot.telemetry = telemetry
        self._add(telemetry.stamp_s, telemetry.counts)

    def _on_sensor(self, read: SensorRead) -> None:
        self._note(read.name)
        if not has_motors(self._recorded.model):
            self._robot = self._recorded
            self._add(read.reading.stamp_s, ())

    def _note(self, name: str) -> None:
        """Look for new values if a part of the board has answered for the first time."""
        if name not in self._heard:
            self._heard.add(name)
            self._series = None

    def _add(self, stamp_s: float, counts: Sequence[float]) -> None:
        recorded = self._recorded
        series = self._series or self._take_columns(len(counts))
        row: List[Any] = [None] * len(self.columns)
        values = recorded.time_s, recorded.clock_ahead_s + stamp_s, *counts, *series.values()
        for place, value in zip(self._places, values):
            row[place] = None if math.isnan(value) else value
        if not self.rows:
            self._out.writerow(self.columns)
            self.first_columns = len(self.columns)
        self._out.writerow(row)
        self.rows += 1

    def _take_columns(self, wheels: int) -> Series:
        series = self._series = Series(self._robot)
        names = [*TIMES, *COUNTS[:wheels], *map(key, series.names)]
        self.columns += [name for name in names if name not in self.columns]
        self._places = [self.columns.index(name) for name in names]
        return series
