"""The panels of the live view, built from a driver's state.  No I/O; needs only the terminal library."""

import itertools
import math
import textwrap
from typing import List, NamedTuple, Optional, Sequence, Tuple

from rich.console import Group, RenderableType
from rich.layout import Layout
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from mrl_driver.driver.readout import Readout
from mrl_driver.protocol.table import SENSOR_BY_NAME
from mrl_driver.robot.models import OmniDrive

from .canvas import Point
from .frame_log import Line
from .live_map import draw
from .text import range_text

LEFT_COLUMNS = 39
NARROW, LOW = 72, 18
"""A terminal with fewer columns shows no map; a terminal with fewer rows shows no frames."""
_NAME = 10
_ROOM = LEFT_COLUMNS - _NAME - 5
"""Characters for a value on the left: the width without the name, the panel's frame and the gaps."""
_NOTICE_ROWS = 3
_BAR = 10
_FARTHEST_BAR_M = 3.0
_NEAR_M = 0.3
_STALE_S = 0.3
_FRESH_S, _OLD_S = 0.3, 3.0
_BATTERY_STYLES = {"ok": "green", "low": "yellow"}


class Shown(NamedTuple):
    """State of the view at one moment."""

    driver: Readout
    port: str
    record: str
    incomplete: bool
    """The recording is incomplete."""
    elapsed_s: float
    rate_hz: float
    trail: Sequence[Point]
    distance_m: float
    log: Optional[List[Line]]
    """None while the frames are hidden."""
    keys_drive: bool
    notice: str
    """Message for the user; empty if there is none."""
    now_s: float


def sideways(driver: Readout) -> bool:
    """Tell whether the robot can move sideways."""
    return driver.model is not None and isinstance(driver.model.drive, OmniDrive)


def render(now: Shown, width: int, height: int) -> RenderableType:
    """Return the whole screen of `width` x `height` characters."""
    screen = Layout()
    footer = _footer(now, width, height)
    rows = [
        Layout(_header(now, width), size=1),
        Layout(name="body"),
        Layout(Group(*footer), size=len(footer)),
    ]
    screen.split_column(*rows)
    inner = height - 1 - len(footer)
    if width < NARROW:
        screen["body"].update(_left(now, inner))
        return screen
    columns = width - LEFT_COLUMNS
    log_rows = 0 if now.log is None or height < LOW else max(5, min(len(now.log), inner // 3)) + 2
    right = Layout()
    parts = [Layout(_map(now, columns, inner - log_rows), name="map")]
    if log_rows:
        parts.append(Layout(_frames(now, columns, log_rows - 2), size=log_rows))
    right.split_column(*parts)
    screen["body"].split_row(Layout(_left(now, inner), size=LEFT_COLUMNS), right)
    return screen


def _header(now: Shown, width: int) -> Text:
    """Return the line with robot, link and time; the names of port and recording share the remaining width."""
    driver = now.driver
    model = driver.model.name if driver.model else "robot"
    silent = driver.age_s > _STALE_S or not driver.ready
    state = f"NO TELEMETRY for {driver.age_s:.1f} s" if silent else f"{now.rate_hz:.0f} Hz"
    minutes, seconds = divmod(int(now.elapsed_s), 60)
    name, clock = f" {model} {driver.board.robot_id} ", f"  {minutes:02d}:{seconds:02d} "
    room = width - len(name) - len(state) - len(clock) - 3
    kept = "INCOMPLETE" if now.incomplete else "recording"
    record = f"{kept} {_tail(now.record, room // 2 - 10)}" if now.record and room > 30 else ""
    port = f" {_tail(now.port, room - len(record) - 1)}  " if room > 8 else ""
    text = Text(no_wrap=True, overflow="crop", style="reverse")
    text.append(name, style="bold").append(port).append(state, style="bold")
    return text.append(" " * max(1, width - len(text.plain) - len(record) - len(clock)) + record + clock)


def _tail(text: str, room: int) -> str:
    """Return the end of a name, because names of files and devices differ there."""
    return text if len(text) <= room else "…" + text[1 - room :]


def _footer(now: Shown, width: int, height: int) -> List[Text]:
    """Return the message for the user and the keys below it; a low terminal shows only the message."""
    most = _NOTICE_ROWS if height >= LOW else 1
    lines = textwrap.wrap(now.notice, max(1, width - 1), max_lines=most, placeholder=" …")
    notice = [Text(f" {line}", style="bold red", no_wrap=True, overflow="ellipsis") for line in lines]
    return notice if notice and height < LOW else [*notice, _keys(now)]


def _keys(now: Shown) -> Text:
    keys = (
        [("arrows wasd", "drive"), ("space", "stop"), ("Enter", "lock")]
        if now.keys_drive
        else [("Enter", "drive with keys"), ("space", "stop")]
    )
    if now.keys_drive and sideways(now.driver):
        keys.insert(1, (", .", "sideways"))
    text = Text(no_wrap=True, overflow="crop")
    for key, what in [*keys, ("f", "frames"), ("c", "clear"), ("q", "quit")]:
        text.append(f" {key} ", style="reverse").append(f" {what}  ", style="dim")
    return text


def _panel(content: RenderableType, title: str, style: str = "blue") -> Panel:
    return Panel(content, title=f"[bold]{title}[/]", title_align="left", border_style=style, padding=(0, 1))


def _grid() -> Table:
    grid = Table.grid(padding=(0, 1))
    grid.add_column(style="dim", min_width=_NAME, max_width=_NAME, no_wrap=True)
    grid.add_column(no_wrap=True)
    return grid


def _add(grid: Table, name: str, value: str, style: str = "") -> None:
    """Add a name and its value, in as many rows as they need."""
    names = textwrap.wrap(name.replace("_", " "), _NAME)
    for title, line in itertools.zip_longest(names, textwrap.wrap(value, _ROOM), fillvalue=""):
        grid.add_row(title, Text(line, style=style))


def _left(now: Shown, height: int) -> RenderableType:
    """Return the panels of numbers; on a low terminal as one panel, or without a frame."""
    silent = now.driver.age_s > _STALE_S or not now.driver.ready
    parts: List[Tuple[Table, str, str]] = [
        (_motion(now), "motion", "green" if now.driver.command else "blue"),
        (_ranges(now.driver), "sonars", "blue"),
        (_sensors(now.driver), "sensors", "blue"),
        (_supply(now.driver), "board", "blue"),
        (_link(now), "link", "red" if silent else "blue"),
    ]
    parts = [part for part in parts if part[0].row_count]
    rows = sum(part.row_count for part, _, _ in parts)
    if height >= rows + 2 * len(parts):
        return Group(*(_panel(*part) for part in parts))
    together = Group(*(part for part, _, _ in parts))
    return _panel(together, "robot", "red" if silent else "blue") if height >= rows + 2 else together


def _motion(now: Shown) -> Table:
    driver, grid = now.driver, _grid()
    pose, twist, asked = driver.pose, driver.twist, driver.command
    _add(grid, "pose", f"x {pose.x_m:+.3f}  y {pose.y_m:+.3f} m")
    grid.add_row("heading", f"{math.degrees(pose.yaw_rad):+.1f} deg")
    aside = f"  {twist.lateral_m_s:+.3f} m/s to the left" if len(twist) == 3 else ""
    _add(grid, "speed", f"{twist.linear_m_s:+.3f} m/s  {twist.angular_rad_s:+.2f} rad/s{aside}")
    if asked is None:
        reason = driver.stop_reason.replace("_", " ")
        _add(grid, "asked", "stopped" if reason in ("none", "user") else f"stopped: {reason}", "yellow")
    else:
        aside = f"  {asked.lateral_m_s:+.3f} m/s to the left" if len(asked) == 3 else ""
        _add(grid, "asked", f"{asked[0]:+.3f} m/s  {asked[1]:+.2f} rad/s{aside}", "green")
    grid.add_row("way", f"{now.distance_m:.2f} m")
    return grid


def _ranges(driver: Readout) -> Table:
    grid, ranges = _grid(), driver.ranges
    order = [name for name in ("left", "front", "right") if name in ranges]
    for name in [*order, *(name for name in ranges if name not in order)]:
        value = ranges[name]
        share = 0.0 if math.isnan(value) else max(0.0, min(1.0, value / _FARTHEST_BAR_M))
        text = _bar(share, "red" if value < _NEAR_M else "yellow" if value < 2 * _NEAR_M else "cyan")
        grid.add_row(name, text.append(f" {range_text(value)}", style="default"))
    return grid


def _sensors(driver: Readout) -> Table:
    grid = _grid()
    for name, reading in driver.sensors.items():
        unit = SENSOR_BY_NAME[name].fields[0].base_unit
        _add(grid, name, " ".join(f"{value:g}" for value in reading.values) + f" {unit}")
    return grid


def _supply(driver: Readout) -> Table:
    grid, status, style = _grid(), driver.status, _BATTERY_STYLES.get(driver.battery_state, "red")
    volts, share = driver.battery_v, 0.0
    if driver.model is not None:
        levels = driver.model.battery
        share = (volts - levels.empty_v) / (levels.full_v - levels.empty_v)
    words = "" if driver.battery_state == "ok" else f" {driver.battery_state}"
    grid.add_row("battery", _bar(share, style).append(f" {volts:.1f} V{words}", style=style))
    heat = f"{driver.temperature_c:.0f} degC"
    if status is None:
        grid.add_row("firmware", "1 (2013), no watchdog")
        return grid
    _add(grid, "firmware", f"{driver.board.version}, up {_span(status.uptime_s)}, {heat}")
    _add(grid, "last stop", f"by {status.stop_reason.replace('_', ' ')}")
    faults = ", ".join(status.faults).replace("_", " ")
    _add(grid, "faults", faults or "none", "bold red" if faults else "")
    return grid


def _span(seconds: int) -> str:
    if seconds < 600:
        return f"{seconds} s"
    return f"{seconds // 60} min" if seconds < 36000 else f"{seconds // 3600} h"


def _link(now: Shown) -> Table:
    grid, seen = _grid(), now.driver.statistics
    if not now.driver.ready:
        _add(grid, "state", f"silent for {now.driver.age_s:.1f} s", "bold red")
    else:
        _add(grid, "state", f"{now.rate_hz:.0f} Hz, newest {now.driver.age_s * 1000:.0f} ms ago")
    damage = sum(seen.garbage.values())
    bad = f"{seen.lost} lost, {damage} bad" + (f", {seen.restarts} resets" if seen.restarts else "")
    _add(grid, "errors", bad, "yellow" if seen.lost or damage or seen.restarts else "")
    return grid


def _bar(share: float, style: str) -> Text:
    full = round(min(1.0, max(0.0, share)) * _BAR)
    return Text("━" * full, style=style).append("╌" * (_BAR - full), style="grey37")


def _map(now: Shown, columns: int, rows: int) -> Panel:
    canvas, step_m = draw(now.driver, now.trail, max(4, columns - 4), max(2, rows - 2))
    lines = []
    for runs in canvas.lines():
        text = Text(no_wrap=True)
        for run in runs:
            text.append(run.text, style=run.style)
        lines.append(text)
    return _panel(Group(*lines), f"path and sonars[/] [dim]· each {step_m:g} m")


def _frames(now: Shown, columns: int, rows: int) -> Panel:
    """Return the panel of the latest kinds of frames, in the order of the first frame of each kind."""
    lines = sorted(now.log or [], key=lambda line: line.time_s)[-rows:]
    shown = [line for line in now.log or [] if line in lines]
    room = columns - 4
    return _panel(
        Group(*(_frame(line, now.now_s, room) for line in shown)), "frames[/] [dim]> to the board  < from it"
    )


def _frame(line: Line, now_s: float, room: int) -> Text:
    """Return the line of one kind of frame, with its name if there is room."""
    age_s = now_s - line.time_s
    style = "yellow" if line.name == "text" else "bold" if age_s < _FRESH_S and line.times < 20 else ""
    text = Text(no_wrap=True, overflow="ellipsis", style="dim" if age_s > _OLD_S else "")
    text.append(line.direction, style="magenta" if line.direction == ">" else "green")
    text.append(f"{line.times:>6}x ", style="dim")
    text.append(line.text, style=style)
    name = line.name.replace("_", " ")
    space = room - len(text.plain) - len(name)
    return text.append(" " * space + name, style="dim") if space > 1 else text
