"""Recordings as pictures, by matplotlib, which is optional.

Colours are Okabe and Ito's, which all people can tell apart; lines differ in dashes too, for print.
"""

import math
import os
from typing import Any, Callable, Dict, List, Sequence, Tuple

from mrl_driver import figures
from mrl_driver.figures import BLUE, GREEN, GREY, ORANGE, PINK
from mrl_driver.geometry import Pose

from .timeline import Chronicle, way_m

PARTS = ("path", "speeds", "ranges", "battery")
_SONARS = {"left": (GREEN, "--"), "front": (BLUE, "-"), "right": (ORANGE, ":")}
_MOST_POINTS = 20000
_ARROWS = 8
_LEAST_SPAN_M = 0.4
_SMOOTH_S = 0.1
"""Measured speeds are averaged over this time: one count in one frame of 20 ms is 4 mm/s."""


def draw(chronicle: Chronicle, path: str, parts: Sequence[str] = PARTS) -> None:
    """Draw the parts, those over time below each other beside the path.

    Raises:
        OutputError: the file cannot be written.
    """
    columns = [part for part in parts if part != "path" and _has(chronicle, part)]
    with_path = "path" in parts
    size = (6.5 * with_path + 6.5 * bool(columns) or 6.5, max(5.5, 1.9 * len(columns)))
    figure = figures.figure(*size)
    figure.suptitle(_title(chronicle), fontsize="large")
    grid = figure.add_gridspec(max(1, len(columns)), with_path + bool(columns) or 1)
    if with_path:
        _draw_path(figure.add_subplot(grid[:, 0]), chronicle)
    first = None
    for row, part in enumerate(columns):
        first = axes = figure.add_subplot(grid[row, -1], sharex=first)
        _OVER_TIME[part](axes, chronicle)
        axes.grid(color="0.9")
        axes.tick_params(labelbottom=row == len(columns) - 1)
        axes.set_xlabel("time since the start [s]" if row == len(columns) - 1 else "")
    figures.save(figure, path)


def _has(chronicle: Chronicle, part: str) -> bool:
    return bool({"ranges": chronicle.ranges, "battery": chronicle.battery}.get(part, True))


def _title(chronicle: Chronicle) -> str:
    name = f"{chronicle.model.name} {chronicle.robot_id or ''}".strip()
    duration_s = chronicle.poses[-1][0] - chronicle.poses[0][0]
    when = chronicle.started[:16].replace("T", " ")
    return (
        f"{name}, {os.path.basename(chronicle.path)}"
        + (f", {when} UTC" if when else "")
        + (f": {way_m(chronicle):.2f} m in {duration_s:.0f} s")
    )


def _thin(rows: Sequence[Tuple[float, ...]]) -> List[List[float]]:
    """Columns of at most some thousand rows."""
    step = math.ceil(len(rows) / _MOST_POINTS) or 1
    kept = list(rows[::step]) + list(rows[-1:] if len(rows) % step != 1 and step > 1 else [])
    return [list(column) for column in zip(*kept)]


def _draw_path(axes: Any, chronicle: Chronicle) -> None:
    _, xs, ys, yaws = _thin(chronicle.poses)
    hits = _hits(chronicle)
    if hits:
        axes.scatter(*zip(*hits), s=4, color=GREY, label="seen by sonars", linewidths=0)
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


def _hits(chronicle: Chronicle) -> List[Tuple[float, float]]:
    """Places at which sonars saw something, on the middle of their cones [m]."""
    found = []
    for name, readings in chronicle.ranges.items():
        mount, last = chronicle.model.sonars[name], math.nan
        for (_, x, y, yaw), (_, value) in zip(chronicle.poses[-len(readings) :], readings):
            if not math.isfinite(value) or value == last:
                continue
            last = value
            found.append(Pose(x, y, yaw).compose(*mount.pose).compose(value, 0.0)[:2])
    return found[:: math.ceil(len(found) / _MOST_POINTS) or 1]


def _draw_speeds(axes: Any, chronicle: Chronicle) -> None:
    times, linear, angular = _thin(chronicle.twists)
    commands = [*chronicle.commands, (times[-1], *(chronicle.commands or [(0.0, 0.0, 0.0)])[-1][1:])]
    asked_s, asked_linear, asked_angular = _thin(commands)
    axes.step(asked_s, asked_linear, where="post", color=GREY, linestyle="--", label="forward, asked")
    axes.plot(times, _smooth(times, linear), color=BLUE, label="forward, measured")
    axes.set_ylabel("forward [m/s]", color=BLUE)
    turn = axes.twinx()
    turn.step(asked_s, asked_angular, where="post", color=GREY, linestyle=":", label="yaw rate, asked")
    turn.plot(times, _smooth(times, angular), color=ORANGE, linestyle="-.", label="yaw rate, measured")
    turn.set_ylabel("yaw rate [rad/s]", color=ORANGE)
    _level(axes, turn)
    handles = [*axes.get_lines(), *turn.get_lines()]
    axes.legend(handles, [line.get_label() for line in handles], fontsize="x-small", ncol=2)


def _level(*axes: Any) -> None:
    """Zero at the same height in all."""
    for each in axes:
        most = max(0.05, *(abs(limit) for limit in each.get_ylim()))
        each.set_ylim(-most, most)


def _smooth(times: List[float], values: List[float]) -> List[float]:
    """Means over `_SMOOTH_S`."""
    import numpy as np

    width = max(1, round(_SMOOTH_S * len(times) / max(1e-9, times[-1] - times[0])))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    smoothed: List[float] = np.convolve(padded, np.full(width, 1 / width), "valid").tolist()
    return smoothed


def _draw_ranges(axes: Any, chronicle: Chronicle) -> None:
    for name, readings in chronicle.ranges.items():
        times, values = _thin(readings)
        colour, dashes = _SONARS.get(name, (PINK, "-"))
        seen = [value if math.isfinite(value) else math.nan for value in values]
        axes.plot(times, seen, color=colour, linestyle=dashes, label=name)
    axes.set_ylabel("range [m]")
    axes.set_ylim(bottom=0)
    axes.legend(
        fontsize="x-small", ncol=3, title="sonars; a gap is no reading or nothing", title_fontsize="x-small"
    )


def _draw_battery(axes: Any, chronicle: Chronicle) -> None:
    times, volts = _thin(chronicle.battery)
    levels = chronicle.model.battery
    axes.plot(times, volts, "o-", markersize=3, color=BLUE, label="battery")
    axes.axhline(levels.low_v, color=ORANGE, linestyle="--", label="low")
    axes.axhline(levels.empty_v, color="black", linestyle=":", label="empty")
    axes.set_ylabel("battery [V]")
    axes.legend(fontsize="x-small", ncol=3)


_OVER_TIME: Dict[str, Callable[[Any, Chronicle], None]] = {
    "speeds": _draw_speeds,
    "ranges": _draw_ranges,
    "battery": _draw_battery,
}
