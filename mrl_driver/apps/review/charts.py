"""The curves of a drive, reduced to what one page can hold.  Pure.

All curves share one list of times.  Near each moment of interest it has the time of every telemetry frame; elsewhere it
has two times for each interval, with the smallest and the largest value, so that no peak is lost.
"""

import math
from typing import Any, Dict, Iterable, List, NamedTuple, Sequence

import numpy as np

from mrl_driver.protocol.table import SENSOR_BY_NAME
from mrl_driver.robot.models.drives import metres_per_count
from mrl_driver.robot.odometry import WHEELS_BY_COUNT
from mrl_driver.view.rows import sonar_order

from .drive_data import Column, DriveData

MOST_VALUES = 130_000  # values on a page; each takes two to seven bytes, so that the page stays below 1 MB
NEAR_S = 3.0  # a page keeps all telemetry this close to a moment of interest [s]
_FRAMES_S, _SLOW_S, _FOREVER_S = 0.5, 10.0, math.inf
"""A value is shown this long, until the next one [s]: of telemetry, of rare answers, of commands."""
_JITTERED = 6  # without board time, the speed of a wheel is that between frames which are this far apart
_FASTEST_M_S = 5.0  # no robot has faster wheels; such a step is a counter that began again
_DEGREES = 180 / math.pi


class Curve(NamedTuple):
    """Values over time; NaN is unknown, and infinities are those of ranges."""

    name: str
    time_s: np.ndarray  # shape (N,), in order
    values: np.ndarray  # shape (N,), in the unit of the chart
    step: float  # the page rounds to multiples of this
    hold_s: float = _FRAMES_S  # the page shows a value this long if no other follows [s]
    stepped: bool = False


class Chart(NamedTuple):
    """Curves with one unit."""

    title: str
    unit: str
    curves: Sequence[Curve]


def charts_of(drive: DriveData) -> List[Chart]:
    """Return the charts of a drive, without those that have no values."""
    names = sonar_order(tuple(drive.ranges))
    found = [
        *_motion(drive),
        Chart("Ranges", "m", [_curve(name, drive.ranges[name], 0, 0.01) for name in names]),
        Chart("Battery", "V", [_curve("battery", drive.battery, 0, 0.01, _SLOW_S)]),
        Chart("Temperature", "degC", [_curve("board", drive.battery, 1, 0.1, _SLOW_S)]),
        *_link(drive),
        Chart("Acceleration", "m/s²", [_curve(axis, drive.imu, i, 0.01) for i, axis in enumerate("xyz", 1)]),
        *sensor_charts(drive),
    ]
    known = [[each for each in chart.curves if not np.all(np.isnan(each.values))] for chart in found]
    return [chart._replace(curves=curves) for chart, curves in zip(found, known) if curves]


def _motion(drive: DriveData) -> List[Chart]:
    if not drive.model.drives:
        return []

    def pair(axis: int, step: float, factor: float = 1.0) -> List[Curve]:
        asked = _curve("asked", drive.commands, axis, step, _FOREVER_S, factor)._replace(stepped=True)
        return [asked, _curve("driven", drive.speeds, axis, step, factor=factor)]

    turning, sideways = pair(1, 0.1, _DEGREES), pair(2, 0.001)
    if len(drive.imu.time_s):
        turning.append(_curve("gyro", drive.imu, 0, 0.1, factor=_DEGREES))
    return [
        Chart("Speed", "m/s", pair(0, 0.001)),
        Chart("Sideways", "m/s", sideways if any(np.any(each.values) for each in sideways) else []),
        Chart("Turning", "°/s", turning),
        Chart("Wheels", "m/s", _wheels(drive)),
    ]


def _wheels(drive: DriveData) -> List[Curve]:
    """Speeds of the wheels, from the counts of two frames."""
    counts, stamps_s = drive.counts, np.asarray(drive.stamps_s, float)
    apart = 1 if len(drive.delays.time_s) else _JITTERED
    dt_s = stamps_s[apart:] - stamps_s[:-apart]
    dt_s = np.where(dt_s > 0, dt_s, np.nan)
    curves = []
    names = WHEELS_BY_COUNT[counts.values.shape[1]]._fields
    scales = metres_per_count(drive.model.base, names)
    for name, m_per_count, count in zip(names, scales, counts.values.T):
        speeds = (count[apart:] - count[:-apart]) * m_per_count / dt_s
        speeds = np.where(np.abs(speeds) < _FASTEST_M_S, speeds, np.nan)
        curves.append(Curve(name, counts.time_s[apart:], speeds, 0.001))
    return curves


def _link(drive: DriveData) -> List[Chart]:
    damaged_s = np.array([each[0] for each in drive.garbage], float)
    counts = [
        _count("lost", drive.lost.time_s, drive.lost.values),
        _count("damaged", damaged_s, np.arange(1.0, len(damaged_s) + 1)),
    ]
    late = _curve("telemetry late", drive.delays, 0, 0.1, _SLOW_S, 1000)
    return [
        Chart("Lost or damaged frames", "", [each for each in counts if len(each.time_s) > 1]),
        Chart("Delays", "ms", [late, _curve("answer", drive.round_trips, 0, 0.1, _SLOW_S, 1000)]),
    ]


def _count(name: str, time_s: np.ndarray, values: np.ndarray) -> Curve:
    """A count that begins at zero and only grows."""
    return Curve(name, np.append(0.0, time_s), np.append(0.0, values), 1.0, _FOREVER_S, stepped=True)


def sensor_charts(drive: DriveData) -> List[Chart]:
    """Return a chart of each sensor of `table.SENSORS`."""
    charts = []
    for name, column in drive.sensors.items():
        fields = SENSOR_BY_NAME[name].fields if name in SENSOR_BY_NAME else ()
        unit = fields[0].base_unit if fields else ""
        names = [field.name.replace("_", " ") for field in fields][: column.values.shape[1]]
        curves = [_curve(each, column, i, 0.01, _SLOW_S) for i, each in enumerate(names)]
        charts.append(Chart(name.replace("_", " ").capitalize(), unit, curves))
    return charts


def _curve(
    name: str, column: Column, axis: int, step: float, hold_s: float = _FRAMES_S, factor: float = 1.0
) -> Curve:
    time_s, values = np.asarray(column.time_s, float), factor * np.asarray(column.values, float)
    if not len(time_s):
        return Curve(name, time_s, time_s, step, hold_s)
    return Curve(name, time_s, values if values.ndim == 1 else values[:, axis], step, hold_s)


def reduced(drive: DriveData, moments: Iterable[float]) -> Dict[str, Any]:
    """Return all that the charts and the map of a page need, for `json_text`.

    `moments` are times of interest [s], the most important first; telemetry near them is complete while there is room.
    """
    charts = charts_of(drive)
    curves = [curve for chart in charts for curve in chart.curves]
    grid = _Grid(drive, curves, moments, max(2, MOST_VALUES // (len(curves) + 4)))

    def shown(curve: Curve) -> Dict[str, Any]:
        values = in_steps(grid.reduce(curve), curve.step)
        return {"name": curve.name, "stepped": curve.stepped, "step": curve.step, "values": values}

    return {
        "times": in_steps(grid.times_s, 0.001),
        "duration": float(drive.duration_s),
        "charts": [{**each._asdict(), "curves": list(map(shown, each.curves))} for each in charts],
        "poses": [in_steps(grid.sample(drive.poses, axis), 0.001) for axis in range(3)],
    }


class _Grid:
    """The times of a page, and the values of curves at them."""

    def __init__(
        self, drive: DriveData, curves: Sequence[Curve], moments: Iterable[float], most: int
    ) -> None:
        base_s = np.asarray(drive.poses.time_s, float)
        if not len(base_s):
            base_s = max([curve.time_s for curve in curves], key=len, default=base_s)
        self._starts_s = _starts(base_s, drive.duration_s, moments, most)
        ends = np.append(self._starts_s[1:], math.inf)
        self._pairs = np.searchsorted(base_s, ends) - np.searchsorted(base_s, self._starts_s) > 1
        self.times_s = self._spread(
            self._starts_s, (self._starts_s + np.append(ends[:-1], drive.duration_s)) / 2
        )

    def _spread(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """One value for each interval with one telemetry frame, two for the others."""
        at = np.repeat(np.arange(len(first)), 1 + self._pairs)
        again = np.append(False, at[1:] == at[:-1])
        return np.where(again, second[at], first[at])

    def reduce(self, curve: Curve) -> np.ndarray:
        """Return the values of a curve; in an interval that has none it holds the last one for its time."""
        begin = np.searchsorted(curve.time_s, self._starts_s)
        end = np.append(begin[1:], len(curve.time_s))
        last = np.maximum(end - 1, 0)
        held = (end > 0) & (self._starts_s - curve.time_s[last] <= curve.hold_s)
        low = np.where(held, curve.values[last], np.nan)
        high = low.copy()
        some = begin < end
        finite = np.where(np.isfinite(curve.values), curve.values, np.nan)
        if np.any(some):
            for extreme, of in ((low, np.fmin), (high, np.fmax)):
                found = of.reduceat(finite, begin[some])
                extreme[some] = np.where(np.isnan(found), extreme[some], found)
        rises = curve.values[np.minimum(begin, len(curve.values) - 1)] <= curve.values[last]
        single = some & ~self._pairs
        low[single] = high[single] = curve.values[last[single]]
        return self._spread(np.where(rises, low, high), np.where(rises, high, low))

    def sample(self, column: Column, axis: int) -> np.ndarray:
        """Return the values of a column in force at each time; NaN before the first."""
        if not len(column.time_s):
            return np.full(len(self.times_s), np.nan)
        at = np.searchsorted(column.time_s, self.times_s, "right") - 1
        return np.where(at >= 0, np.asarray(column.values, float)[np.maximum(at, 0), axis], np.nan)


def _starts(base_s: np.ndarray, duration_s: float, moments: Iterable[float], most: int) -> np.ndarray:
    """Starts of the intervals [s]: each time of `base_s` near a moment, even ones elsewhere; at most `most` values."""
    if len(base_s) < most:
        return np.unique(np.append(0.0, base_s))
    near, room = np.zeros(len(base_s), bool), most // 2
    for moment_s in moments:
        begin, end = np.searchsorted(base_s, (moment_s - NEAR_S, moment_s + NEAR_S))
        room -= np.count_nonzero(~near[begin:end])
        if room < 0:
            break
        near[begin:end] = True
    even_s = np.linspace(0.0, duration_s, max(1, (most - np.count_nonzero(near)) // 2), endpoint=False)
    after = np.searchsorted(base_s, even_s)
    beside = np.append(near, False)[after] & np.append(False, near)[after]
    return np.unique(np.concatenate((even_s[~beside], base_s[near])))


def in_steps(values: np.ndarray, step: float) -> List[float]:
    """Return values as whole numbers of steps, which JSON text holds in few bytes; those that are not finite stay."""
    return [round(each / step) if math.isfinite(each) else each for each in values.tolist()]
