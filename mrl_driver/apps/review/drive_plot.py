"""Draws recorded drives with matplotlib, an optional package.

The colours are those of Okabe and Ito, which colour-blind people can distinguish.  Lines also differ in their dashes,
for black and white prints.
"""

import math
import os
from functools import partial
from typing import Any, Callable, Dict, Iterator, List, Sequence, Tuple

import numpy as np

from mrl_driver import figures
from mrl_driver.errors import ConfigError
from mrl_driver.figures import BLUE, GREEN, GREY, ORANGE, PINK
from mrl_driver.geometry import Pose
from mrl_driver.protocol.table import SENSOR_BY_NAME

from .drive_data import Column, DriveData

PARTS = ("path", "speeds", "ranges", "sensors", "battery")
_SONARS = {"left": (GREEN, "--"), "front": (BLUE, "-"), "right": (ORANGE, ":")}
_MOST_POINTS = 20000
_ARROWS = 8
_LEAST_SPAN_M = 0.4
_SMOOTH_S = 0.1  # measured speeds are averaged over this time: one count in one frame of 20 ms is 4 mm/s


def draw(drive: DriveData, path: str, parts: Sequence[str] = PARTS) -> None:
    """Draw the parts: the path on the left, and those over time one below the other on the right.

    Raises:
        ConfigError: the drive has no poses.
        OutputError: the file cannot be written.
    """
    _require_poses(drive)
    columns = list(_over_time(drive, parts))
    with_path = "path" in parts
    size = (6.5 * with_path + 6.5 * bool(columns) or 6.5, max(5.5, 1.9 * len(columns)))
    figure = figures.figure(*size)
    figure.suptitle(figures.plain(_title(drive)), fontsize="large")
    grid = figure.add_gridspec(max(1, len(columns)), with_path + bool(columns) or 1)
    if with_path:
        _draw_path(figure.add_subplot(grid[:, 0]), drive)
    first = None
    for row, draw_into in enumerate(columns):
        first = axes = figure.add_subplot(grid[row, -1], sharex=first)
        draw_into(axes, drive)
        axes.grid(color="0.9")
        axes.tick_params(labelbottom=row == len(columns) - 1)
        axes.set_xlabel("time since the start [s]" if row == len(columns) - 1 else "")
    figures.save(figure, path)


def path_length_m(drive: DriveData) -> float:
    """Length of the robot's path [m]."""
    return float(np.hypot(*np.diff(drive.poses.values[:, :2], axis=0).T).sum())


def _require_poses(drive: DriveData) -> None:
    if len(drive.poses.time_s):
        return
    if not drive.model.drives:
        raise ConfigError(
            f"{drive.path} holds no odometry, because {drive.model.name} is a board without motors; its sensors "
            f"are shown by: mrl replay {drive.path}"
        )
    raise ConfigError(
        f"{drive.path} holds no odometry, expected frames of a robot; check it with: mrl replay {drive.path}"
    )


def _over_time(drive: DriveData, parts: Sequence[str]) -> Iterator[Callable[[Any, DriveData], None]]:
    """The functions that draw the parts with a time axis: one for each axes, and for each sensor one."""
    has = {"ranges": bool(drive.ranges), "battery": bool(len(drive.battery.time_s)), "path": False}
    for part in parts:
        if part == "sensors":
            for name in drive.sensors:
                yield partial(_draw_sensor, name=name)
        elif has.get(part, True):
            yield _OVER_TIME[part]


def _title(drive: DriveData) -> str:
    name = f"{drive.model.name} {drive.robot_id or ''}".strip()
    duration_s = drive.poses.time_s[-1] - drive.poses.time_s[0]
    when = drive.started[:16].replace("T", " ")
    return (
        f"{name}, {os.path.basename(drive.path)}"
        + (f", {when} UTC" if when else "")
        + (f": {path_length_m(drive):.2f} m in {duration_s:.0f} s")
    )


def _thin(column: Column) -> List[Any]:
    """Times and columns of the values, thinned to at most about `_MOST_POINTS` points."""
    times_s, count = column.time_s, len(column.time_s)
    kept = np.unique(
        [*range(0, count, math.ceil(count / _MOST_POINTS) or 1), *[count - 1] * bool(count)]
    ).astype(int)
    values = column.values if column.values.ndim > 1 else column.values[:, None]
    return [times_s[kept], *values[kept].T]


def _draw_path(axes: Any, drive: DriveData) -> None:
    _, xs, ys, yaws = _thin(drive.poses)
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
    axes.legend(fontsize="small")


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


def _draw_speeds(axes: Any, drive: DriveData) -> None:
    times, linear, angular, _ = _thin(drive.speeds)
    commanded_s, commanded_linear, commanded_angular, _ = _held(_thin(drive.commands), times[-1])
    axes.step(
        commanded_s, commanded_linear, where="post", color=GREY, linestyle="--", label="forward, commanded"
    )
    axes.plot(times, _smooth(times, linear), color=BLUE, label="forward, measured")
    axes.set_ylabel("forward [m/s]", color=BLUE)
    turn = axes.twinx()
    turn.step(
        commanded_s, commanded_angular, where="post", color=GREY, linestyle=":", label="yaw rate, commanded"
    )
    turn.plot(times, _smooth(times, angular), color=ORANGE, linestyle="-.", label="yaw rate, measured")
    turn.set_ylabel("yaw rate [rad/s]", color=ORANGE)
    if len(drive.imu.time_s):
        gyro_s, rates, *_ = _thin(drive.imu)
        turn.plot(gyro_s, _smooth(gyro_s, rates), color=PINK, linewidth=0.8, label="yaw rate, gyro")
    _level(axes, turn)
    handles = [*axes.get_lines(), *turn.get_lines()]
    axes.legend(handles, [line.get_label() for line in handles], fontsize="x-small", ncol=2)


def _held(columns: List[Any], end_s: float) -> List[Any]:
    """Times and values, the last of them once more at the end; zeros if there is none."""
    times, *values = columns
    return [np.append(times, end_s), *(np.append(each, each[-1] if len(each) else 0.0) for each in values)]


def _level(*axes: Any) -> None:
    """Put zero at the same height in all axes."""
    for each in axes:
        most = max(0.05, *(abs(limit) for limit in each.get_ylim()))
        each.set_ylim(-most, most)


def _smooth(times: Any, values: Any) -> Any:
    """Moving average over `_SMOOTH_S`."""
    width = max(1, int(round(_SMOOTH_S * len(times) / max(1e-9, times[-1] - times[0]))))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1 / width), "valid")


def _draw_ranges(axes: Any, drive: DriveData) -> None:
    for name, readings in drive.ranges.items():
        times, values = _thin(readings)
        colour, dashes = _SONARS.get(name, (PINK, "-"))
        seen = np.where(np.isfinite(values), values, math.nan)
        axes.plot(times, seen, color=colour, linestyle=dashes, label=name)
    axes.set_ylabel("range [m]")
    axes.set_ylim(bottom=0)
    axes.legend(
        fontsize="x-small",
        ncol=3,
        title="sonars; gap: no reading, or nothing in range",
        title_fontsize="x-small",
    )


def _draw_sensor(axes: Any, drive: DriveData, name: str) -> None:
    times, *columns = _thin(drive.sensors[name])
    for values in columns:
        axes.plot(times, values, color=BLUE, linewidth=1.0)
    unit = SENSOR_BY_NAME[name].fields[0].base_unit
    axes.set_ylabel(f"{name} [{unit}]" if unit else name)


def _draw_battery(axes: Any, drive: DriveData) -> None:
    times, volts, _ = _thin(drive.battery)
    levels = drive.model.battery
    axes.plot(times, volts, "o-", markersize=3, color=BLUE, label="battery")
    axes.axhline(levels.low_v, color=ORANGE, linestyle="--", label="low")
    axes.axhline(levels.empty_v, color="black", linestyle=":", label="empty")
    axes.set_ylabel("battery [V]")
    axes.legend(fontsize="x-small", ncol=3)


_OVER_TIME: Dict[str, Callable[[Any, DriveData], None]] = {
    "speeds": _draw_speeds,
    "ranges": _draw_ranges,
    "battery": _draw_battery,
}
