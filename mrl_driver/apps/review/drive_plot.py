"""Draws recorded drives with matplotlib, an optional package: the path, and the charts of a review's page.

The colours are those of Okabe and Ito, which colour-blind people can distinguish.  Lines also differ in their dashes,
for black and white prints.
"""

import math
import os
import shlex
from itertools import cycle
from typing import Any, Iterator, List, Sequence, Tuple

import numpy as np

from mrl_driver import figures
from mrl_driver.errors import ConfigError
from mrl_driver.figures import BLUE, GREEN, GREY, ORANGE, PINK
from mrl_driver.geometry import Pose

from .charts import Chart, charts_of, sensor_charts
from .drive_data import DriveData

PARTS = ("path", "speeds", "ranges", "sensors", "battery")
_TITLES = {"speeds": ("Speed", "Sideways", "Turning"), "ranges": ("Ranges",), "battery": ("Battery",)}
_STYLES = ((BLUE, "-"), (ORANGE, "-."), (GREEN, "--"), (PINK, ":"))
_MOST_POINTS = 20000
_MOST_NAMES = 6  # of curves in a legend
_ARROWS = 8
_LEAST_SPAN_M = 0.4
_SMOOTH_S = 0.1  # measured speeds are averaged over this time: one count in one frame of 20 ms is 4 mm/s


def draw(drive: DriveData, path: str, parts: Sequence[str] = PARTS) -> None:
    """Draw the parts: the path on the left, and those over time one below the other on the right.

    Raise ConfigError if the drive has no poses.
    """
    _require_poses(drive)
    charts, with_path = list(_over_time(drive, parts)), "path" in parts
    size = (6.5 * with_path + 6.5 * bool(charts) or 6.5, max(5.5, 1.9 * len(charts)))
    figure = figures.figure(*size)
    figure.suptitle(figures.plain(_title(drive)), fontsize="large")
    grid = figure.add_gridspec(max(1, len(charts)), with_path + bool(charts) or 1)
    if with_path:
        _draw_path(figure.add_subplot(grid[:, 0]), drive)
    first = None
    for row, chart in enumerate(charts):
        first = axes = figure.add_subplot(grid[row, -1], sharex=first)
        _draw_chart(axes, chart, drive)
        axes.grid(color="0.9")
        axes.tick_params(labelbottom=row == len(charts) - 1)
        axes.set_xlabel("time since the start [s]" if row == len(charts) - 1 else "")
    figures.save(figure, path)


def _require_poses(drive: DriveData) -> None:
    if not len(drive.poses.time_s) or not drive.model.has_odometry:
        why = "expected frames of a robot; check it with"
        if not drive.model.drives:
            why = f"because {drive.model.name} is a board without motors; its sensors are shown by"
        elif not drive.model.has_odometry:
            why = f"because the motors of {drive.model.name} have no encoders; the rest is shown by"
        raise ConfigError(f"{drive.path} holds no odometry, {why}: mrl replay {shlex.quote(drive.path)}")


def _over_time(drive: DriveData, parts: Sequence[str]) -> Iterator[Chart]:
    """The charts of the parts with a time axis."""
    charts = charts_of(drive)
    for part in parts:
        found = sensor_charts(drive) if part == "sensors" else charts
        yield from (each for each in found if part == "sensors" or each.title in _TITLES.get(part, ()))


def _title(drive: DriveData) -> str:
    duration_s = drive.poses.time_s[-1] - drive.poses.time_s[0]
    when = drive.started[:16].replace("T", " ")
    return (
        f"{drive.robot_name}, {os.path.basename(drive.path)}"
        + (f", {when} UTC" if when else "")
        + (f": {drive.path_length_m:.2f} m in {duration_s:.0f} s")
    )


def _thin(time_s: Any, values: Any) -> Tuple[Any, Any]:
    """Times and values, thinned to at most about `_MOST_POINTS` points, of which the last one stays."""
    step = math.ceil(len(time_s) / _MOST_POINTS) or 1
    kept = np.union1d(np.arange(0, len(time_s), step), np.arange(len(time_s))[-1:])
    return time_s[kept], values[kept]


def _draw_path(axes: Any, drive: DriveData) -> None:
    xs, ys, yaws = _thin(drive.poses.time_s, drive.poses.values)[1].T
    hits = _hits(drive)
    if hits:
        axes.scatter(*zip(*hits), s=4, color=GREY, label="sonar readings", linewidths=0)
    axes.plot(xs, ys, color=BLUE, linewidth=1.6, label="path")
    axes.plot(xs[0], ys[0], "o", color=GREEN, markersize=8, label="start")
    axes.plot(xs[-1], ys[-1], "s", color=ORANGE, markersize=8, label="end")
    reach = max(_LEAST_SPAN_M, max(xs) - min(xs), max(ys) - min(ys)) / 14
    chosen = sorted({round(i * (len(xs) - 1) / _ARROWS) for i in range(_ARROWS + 1)})
    for i in chosen:
        tip = xs[i] + reach * math.cos(yaws[i]), ys[i] + reach * math.sin(yaws[i])
        axes.annotate("", tip, (xs[i], ys[i]), arrowprops={"arrowstyle": "->", "color": BLUE})
    axes.set(xlabel="x [m]", ylabel="y [m]", title="path in the odom frame")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.1)
    axes.grid(color="0.9")
    axes.legend(fontsize="small", loc="upper right")


def _hits(drive: DriveData) -> List[Tuple[float, float]]:
    """Points that the sonars measured, on the axes of their cones [m]."""
    found = []
    for name, (times_s, values) in drive.ranges.items():
        mount, last = drive.model.sonars[name], math.nan
        at = np.searchsorted(drive.poses.time_s, times_s).clip(max=len(drive.poses.time_s) - 1)
        for pose, value in zip(drive.poses.values[at].tolist(), values.tolist()):
            if not math.isfinite(value) or value == last:
                continue
            last = value
            found.append(Pose(*pose).compose(*mount.pose).compose(value, 0.0)[:2])
    return found[:: math.ceil(len(found) / _MOST_POINTS) or 1]


def _draw_chart(axes: Any, chart: Chart, drive: DriveData) -> None:
    for curve, (colour, dashes) in zip(chart.curves, cycle(_STYLES)):
        times, values = _thin(curve.time_s, np.where(np.isfinite(curve.values), curve.values, math.nan))
        if curve.stepped:  # commands hold until the end
            times, values = np.append(times, drive.duration_s), np.append(values, values[-1])
            axes.step(times, values, where="post", color=GREY, linestyle="--", label=curve.name)
        else:
            smooth = _smooth(times, values) if chart.title in _TITLES["speeds"] else values
            axes.plot(times, smooth, color=colour, linestyle=dashes, label=curve.name)
    if chart.title == "Battery":
        levels = drive.model.battery
        axes.axhline(levels.low_v, color=ORANGE, linestyle="--", label="low")
        axes.axhline(levels.empty_v, color="black", linestyle=":", label="empty")
    if chart.title == "Ranges":
        axes.set_ylim(bottom=0)
    axes.set_ylabel(f"{chart.title.lower()} [{chart.unit}]" if chart.unit else chart.title.lower())
    if len(chart.curves) <= _MOST_NAMES:
        axes.legend(fontsize="x-small", loc="upper right", ncol=3)


def _smooth(times: Any, values: Any) -> Any:
    """Moving average over `_SMOOTH_S`."""
    width = round(_SMOOTH_S * len(times) / max(1e-9, times[-1] - times[0]))
    width = min(len(times), max(1, width))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1 / width), "valid")
