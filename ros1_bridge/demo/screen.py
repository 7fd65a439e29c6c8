"""The live view: draws a snapshot as panels in a terminal.  Pure, apart from the terminal library."""

import math
from typing import List

from rich.columns import Columns
from rich.console import Group, RenderableType
from rich.layout import Layout
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from .braille_path import ARROWS, GRID, GRID_M, draw
from .report import Snapshot, range_text

KEYS = (("w a s d / arrows", "drive"), ("space", "stop"), ("r", "square"), ("q", "quit"))
STALE_S = 0.3
_LEFT_COLUMNS = 38
_FURTHEST_BAR_M = 3.0
_BAR = 14
_NEAR_M = 0.3


def render(now: Snapshot, title: str, width: int, height: int, note: str = "") -> RenderableType:
    """The whole screen of `width` x `height` characters; `note` appears below the path."""
    screen = Layout()
    screen.split_column(Layout(name="body"), Layout(_footer(), name="keys", size=1))
    trail = _trail(now, width - _LEFT_COLUMNS, height - 1)
    trail.subtitle = note
    screen["body"].split_row(Layout(_left(now, title), size=_LEFT_COLUMNS), Layout(trail))
    return screen


def _left(now: Snapshot, title: str) -> RenderableType:
    return Group(
        _panel(_motion(now), title, "cyan"),
        _panel(_sonars(now), "sonars", "blue"),
        _panel(_battery(now), "battery", "blue"),
        _panel(_link(now), "link", "red" if now.age_s > STALE_S else "blue"),
    )


def _panel(content: RenderableType, title: str, colour: str) -> Panel:
    return Panel(content, title=f"[bold]{title}[/]", title_align="left", border_style=colour, padding=(0, 1))


def _grid() -> Table:
    grid = Table.grid(padding=(0, 1))
    grid.add_column(style="dim", width=9)
    grid.add_column()
    return grid


def _motion(now: Snapshot) -> Table:
    x, y, yaw = now.pose
    grid = _grid()
    grid.add_row("mode", Text(now.mode, style="bold yellow" if now.mode == "stopped" else "bold green"))
    grid.add_row("x, y", f"{x:+8.3f} {y:+8.3f} m")
    grid.add_row("yaw", f"{math.degrees(yaw):+8.2f} deg   {ARROWS[round(yaw / (math.pi / 4)) % 8]}")
    grid.add_row("speed", f"{now.twist[0]:+8.3f} m/s")
    grid.add_row("turn", f"{now.twist[1]:+8.3f} rad/s")
    grid.add_row("distance", f"{now.distance_m:8.3f} m in {now.elapsed_s:.0f} s")
    return grid


def _sonars(now: Snapshot) -> Table:
    grid = _grid()
    for name in ("left", "front", "right"):
        value = now.ranges.get(name, math.nan)
        share = 1.0 if value == math.inf else value / _FURTHEST_BAR_M if math.isfinite(value) else 0.0
        colour = "red" if value < _NEAR_M else "yellow" if value < 2 * _NEAR_M else "green"
        grid.add_row(name, _bar(share, colour).append(f" {range_text(value):>7}", style="default"))
    return grid


def _battery(now: Snapshot) -> Table:
    grid = _grid()
    if math.isfinite(now.battery_v):
        colour = "red" if now.battery_share < 0.1 else "green"
        grid.add_row(
            "charge", _bar(now.battery_share, colour).append(f" {now.battery_v:5.1f} V", style="default")
        )
    else:
        grid.add_row("charge", "--")
    return grid


def _link(now: Snapshot) -> Table:
    grid = _grid()
    if now.age_s > STALE_S:
        silent = "waiting for odometry" if not now.frames else f"silent for {now.age_s:.1f} s"
        grid.add_row("odometry", Text(silent, style="bold red"))
    else:
        grid.add_row("odometry", f"{now.rate_hz:.0f} Hz, {now.frames} frames")
    grid.add_row("errors", Text(str(now.errors), style="red" if now.errors else "green"))
    if now.link:
        grid.add_row("age", f"{now.link['Telemetry Age']}, {now.link['Lost Frames']} frames lost")
        grid.add_row("board", f"robot {now.link['Device ID']}, firmware {now.link['Firmware Version']}")
    return grid


def _bar(share: float, colour: str) -> Text:
    full = round(min(1.0, max(0.0, share)) * _BAR)
    return Text("━" * full, style=colour).append("━" * (_BAR - full), style="grey23")


def _trail(now: Snapshot, width: int, height: int) -> Panel:
    lines: List[Text] = []
    for row in draw(now.trail, now.pose, max(4, width - 4), max(2, height - 2)):
        text = Text(row, style="green", no_wrap=True)
        text.highlight_regex(GRID, "grey37")
        text.highlight_regex(f"[{ARROWS}]", "bold white")
        lines.append(text)
    return _panel(Group(*lines), f"path [dim]({GRID} every {GRID_M:g} m)[/]", "blue")


def _footer() -> Columns:
    parts = [
        Text(f" {keys} ", style="reverse").append(f" {what}", style="not reverse dim") for keys, what in KEYS
    ]
    return Columns(parts, padding=(0, 2))
