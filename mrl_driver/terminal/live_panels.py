"""The panels of the live view, built from a robot's state.  No I/O; needs only the terminal library."""

import itertools
import math
import textwrap
from typing import List, NamedTuple, Optional, Sequence, Tuple

from rich.console import Group, RenderableType
from rich.layout import Layout
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from mrl_driver.geometry import Pose
from mrl_driver.safety.operator_delay import delay_text
from mrl_driver.view.shown_state import ShownState, has_motors, moves_sideways, range_text

from .frame_log import Line
from .live_map import draw

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
    """ShownState of the view at one moment."""

    state: ShownState
    port: str
    record: str
    incomplete: bool
    """The recording is incomplete."""
    elapsed_s: float
    rate_hz: float
    trail: Sequence[Pose]
    distance_m: float
    log: Optional[List[Line]]
    """None while the frames are hidden."""
    keys_drive: bool
    notice: str
    """Message for the user; empty if there is none."""
    keys: Sequence[Tuple[str, str]]
    """Further keys, and what they do."""
    now_s: float
    delays_s: Tuple[float, float, float] = (math.nan, math.nan, math.nan)
    """From a key press to the board, and its parts: to the written command, and the link; NaN if unknown."""


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
    mapped, logged = has_motors(now.state.model), now.log is not None and height >= LOW
    if width < NARROW or not (mapped or logged):
        screen["body"].update(_left(now, inner))
        return screen
    columns = width - LEFT_COLUMNS
    log_rows = max(5, min(len(now.log or ()), inner // 3)) + 2 if logged else 0
    log_rows = log_rows if mapped else inner
    right = Layout()
    parts = [Layout(_map(now, columns, inner - log_rows), name="map")] if mapped else []
    if log_rows:
        parts.append(Layout(_frames(now, columns, log_rows - 2), size=log_rows))
    right.split_column(*parts)
    screen["body"].split_row(Layout(_left(now, inner), size=LEFT_COLUMNS), right)
    return screen


def _header(now: Shown, width: int) -> Text:
    """Return the line with robot, link and time; the names of port and recording share the remaining width."""
    silent = _is_silent(now.state)
    state = _silence(now.state) if silent else f"{now.rate_hz:.0f} Hz"
    minutes, seconds = divmod(int(now.elapsed_s), 60)
    name, clock = f" {now.state.name} ", f"  {minutes:02d}:{seconds:02d} "
    room = width - len(name) - len(state) - len(clock) - 3
    kept = "INCOMPLETE" if now.incomplete else "recording"
    record = f"{kept} {_tail(now.record, room // 2 - 10)}" if now.record and room > 30 else ""
    port = f" {_tail(now.port, room - len(record) - 1)}  " if room > 8 else ""
    text = Text(no_wrap=True, overflow="crop", style="reverse")
    text.append(name, style="bold").append(port).append(state, style="bold")
    return text.append(" " * max(1, width - len(text.plain) - len(record) - len(clock)) + record + clock)


def _is_silent(state: ShownState) -> bool:
    return state.age_s > _STALE_S or not state.ready


def _silence(state: ShownState) -> str:
    return f"NO TELEMETRY for {state.age_s:.1f} s" if state.age_s < math.inf else "NO TELEMETRY yet"


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
    keys: List[Tuple[str, str]] = (
        []
        if not has_motors(now.state.model)
        else [("arrows wasd", "drive"), ("space", "stop"), ("Enter", "lock")]
        if now.keys_drive
        else [("Enter", "drive with keys"), ("space", "stop")]
    )
    if now.keys_drive and moves_sideways(now.state.model):
        keys.insert(1, (", .", "sideways"))
    text = Text(no_wrap=True, overflow="crop")
    for key, what in [*keys, *now.keys, ("c", "clear"), ("q", "quit")]:
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
    silent = _is_silent(now.state)
    parts: List[Tuple[Table, str, str]] = [
        (_motion(now), "motion", "green" if now.state.command else "blue"),
        (_ranges(now.state), "sonars", "blue"),
        (_sensors(now.state), "sensors", "blue"),
        (_supply(now.state), "board", "blue"),
        (_link(now), "link", "red" if silent else "blue"),
    ]
    parts = [part for part in parts if part[0].row_count]
    rows = sum(part.row_count for part, _, _ in parts)
    if height >= rows + 2 * len(parts):
        return Group(*(_panel(*part) for part in parts))
    together = Group(*(part for part, _, _ in parts))
    return _panel(together, "robot", "red" if silent else "blue") if height >= rows + 2 else together


def _motion(now: Shown) -> Table:
    state, grid = now.state, _grid()
    if not has_motors(state.model):
        return grid
    pose, twist, asked = state.pose, state.twist, state.command
    _add(grid, "pose", f"x {pose.x_m:+.3f}  y {pose.y_m:+.3f} m")
    grid.add_row("heading", f"{math.degrees(pose.yaw_rad):+.1f} deg")
    aside = f"  {twist.lateral_m_s:+.3f} m/s to the left" if len(twist) == 3 else ""
    _add(grid, "speed", f"{twist.linear_m_s:+.3f} m/s  {twist.angular_rad_s:+.2f} rad/s{aside}")
    if asked is None:
        reason = state.stop_reason.replace("_", " ")
        _add(grid, "asked", "stopped" if reason in ("none", "user") else f"stopped: {reason}", "yellow")
    else:
        aside = f"  {asked.lateral_m_s:+.3f} m/s to the left" if len(asked) == 3 else ""
        _add(grid, "asked", f"{asked[0]:+.3f} m/s  {asked[1]:+.2f} rad/s{aside}", "green")
    grid.add_row("path", f"{now.distance_m:.2f} m")
    return grid


def _ranges(state: ShownState) -> Table:
    grid, ranges = _grid(), state.ranges
    order = [name for name in ("left", "front", "right") if name in ranges]
    for name in [*order, *(name for name in ranges if name not in order)]:
        value = ranges[name]
        share = 0.0 if math.isnan(value) else max(0.0, min(1.0, value / _FARTHEST_BAR_M))
        text = _bar(share, "red" if value < _NEAR_M else "yellow" if value < 2 * _NEAR_M else "cyan")
        grid.add_row(name, text.append(f" {range_text(value)}", style="default"))
    return grid


def _sensors(state: ShownState) -> Table:
    grid = _grid()
    for name, value in state.sensors.items():
        _add(grid, name, value)
    return grid


def _supply(state: ShownState) -> Table:
    grid, style = _grid(), _BATTERY_STYLES.get(state.battery_state, "red")
    words = "" if state.battery_state == "ok" else f" {state.battery_state}"
    if not math.isnan(state.battery_v):
        bar = _bar(state.battery_share, style)
        grid.add_row("battery", bar.append(f" {state.battery_v:.1f} V{words}", style=style))
    for row in state.board:
        _add(grid, *row)
    return grid


def _link(now: Shown) -> Table:
    grid, state = _grid(), now.state
    if not state.ready:
        _add(grid, "state", _silence(state).lower(), "bold red")
    else:
        _add(grid, "state", f"{now.rate_hz:.0f} Hz, newest {state.age_s * 1000:.0f} ms ago")
    _add(grid, *state.errors)
    delay_s, *parts_s = now.delays_s
    key, link = ("?" if math.isnan(part_s) else f"{part_s * 1000:.0f}" for part_s in parts_s)
    _add(grid, "delay", f"{delay_text(delay_s)}: key {key}, link {link}")
    return grid


def _bar(share: float, style: str) -> Text:
    full = round(min(1.0, max(0.0, share)) * _BAR)
    return Text("━" * full, style=style).append("╌" * (_BAR - full), style="grey37")


def _map(now: Shown, columns: int, rows: int) -> Panel:
    canvas, step_m = draw(now.state, now.trail, max(4, columns - 4), max(2, rows - 2))
    model = now.state.model
    shown = "path" if model is not None and not model.sonars else "path and sonars"
    return _panel(canvas.text(), f"{shown}[/] [dim]· each {step_m:g} m")


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
