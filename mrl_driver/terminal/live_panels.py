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
from mrl_driver.robot.models import SonarMount
from mrl_driver.view.rows import range_style, sections
from mrl_driver.view.shown_state import Row, Shown, has_motors, has_odometry, moves_sideways

from .canvas import Canvas, Point, fit
from .frame_log import Line

LEFT_COLUMNS = 39
NARROW, LOW = 72, 18  # a terminal with fewer columns shows no map; a terminal with fewer rows shows no frames
_NAME = 10
_ROOM = LEFT_COLUMNS - _NAME - 5
"""Characters for a value on the left: the width without the name, the panel's frame and the gaps."""
_NOTICE_ROWS = 3
_BAR = 10
_FRESH_S, _OLD_S = 0.3, 3.0
_GRIDS_M = (0.5, 1.0, 2.0, 5.0, 10.0)
_LEAST_GRID_COLUMNS = 5
_ARC = tuple(i / 8 - 0.5 for i in range(9))
"""Directions of the points of an arc, from the axis of its sonar [field of view]."""
LONGEST_CONE_M = 2.5
"""A cone without an echo within this range is drawn with this length and without an arc [m]."""


class Content(NamedTuple):
    """Content of the screen at one moment."""

    shown: Shown
    port: str
    log: Optional[List[Line]]  # None while the frames are hidden
    keys_drive: bool
    keys: Sequence[Tuple[str, str]]  # further keys, and what they do


def render(now: Content, width: int, height: int) -> RenderableType:
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
    mapped, logged = has_odometry(now.shown.model), now.log is not None and height >= LOW
    if width < NARROW or not (mapped or logged):
        screen["body"].update(_left(now, inner, f"[/] [dim]· map from {NARROW} columns" if mapped else ""))
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


def _header(now: Content, width: int) -> Text:
    """Return the line with robot, link and time; the names of port and recording share the remaining width."""
    shown = now.shown
    state = shown.silence if shown.silent else f"{shown.rate_hz:.0f} Hz"
    minutes, seconds = divmod(int(shown.elapsed_s), 60)
    name, clock = f" {shown.name} ", f"  {minutes:02d}:{seconds:02d} "
    room = width - len(name) - len(state) - len(clock) - 3
    kept = "INCOMPLETE" if shown.incomplete else "recording"
    record = f"{kept} {_tail(shown.record, room // 2 - 10)}" if shown.record and room > 30 else ""
    port = f" {_tail(now.port, room - len(record) - 1)}  " if room > 8 else ""
    text = Text(no_wrap=True, overflow="crop", style="reverse")
    text.append(name, style="bold").append(port).append(state, style="bold")
    return text.append(" " * max(1, width - len(text.plain) - len(record) - len(clock)) + record + clock)


def _tail(text: str, room: int) -> str:
    """Return the end of a name, because names of files and devices differ there."""
    return text if len(text) <= room else "…" + text[1 - room :]


def _footer(now: Content, width: int, height: int) -> List[Text]:
    """Return the message for the user and the keys below it; a low terminal shows only the message."""
    most = _NOTICE_ROWS if height >= LOW else 1
    lines = textwrap.wrap(now.shown.notice, max(1, width - 1), max_lines=most, placeholder=" …")
    notice = [Text(f" {line}", style="bold red", no_wrap=True, overflow="ellipsis") for line in lines]
    return notice if notice and height < LOW else [*notice, _keys(now)]


def _keys(now: Content) -> Text:
    """Return the keys and what they do; a narrow terminal cuts the last."""
    model, drives = now.shown.model, now.keys_drive
    keys = [("arrows wasd", "drive") if drives else ("Enter", "drive with keys"), ("space", "stop")]
    keys = [*(keys if has_motors(model) else []), ("q", "quit")]
    if drives and moves_sideways(model):
        keys.append((", .", "sideways"))
    if drives and has_motors(model):
        keys.append(("Enter", "lock"))
    text = Text(no_wrap=True, overflow="crop")
    for key, what in [*keys, *now.keys, ("c", "clear")]:
        text.append(f" {key} ", style="reverse").append(f" {what}  ", style="dim")
    return text


def _panel(content: RenderableType, title: str, style: str = "blue") -> Panel:
    return Panel(content, title=f"[bold]{title}[/]", title_align="left", border_style=style, padding=(0, 1))


def _table(rows: Sequence[Row]) -> Table:
    """Return names and values, each in as many lines as they need."""
    grid = Table.grid(padding=(0, 1))
    grid.add_column(style="dim", min_width=_NAME, max_width=_NAME, no_wrap=True)
    grid.add_column(no_wrap=True)
    for row in rows:
        names = textwrap.wrap(row.name.replace("_", " "), _NAME)
        for name, line in itertools.zip_longest(names, _lines(row), fillvalue=""):
            grid.add_row(name, line)
    return grid


def _lines(row: Row) -> List[Text]:
    """Return the lines of a value; one with a bar has one line."""
    if row.bar is not None:
        full = round(min(1.0, max(0.0, row.bar.share)) * _BAR)
        bar = Text("━" * full, style=row.bar.style).append("╌" * (_BAR - full), style="grey37")
        return [bar.append(f" {row.value}", style=row.style or "default")]
    lines = textwrap.wrap(row.value, _ROOM, break_long_words=False, break_on_hyphens=False)
    return [Text(_tail(line, _ROOM), style=row.style) for line in lines]


def _left(now: Content, height: int, note: str = "") -> RenderableType:
    """Return the panels of numbers, a note in the title of the first; on a low terminal one panel, or no frame."""
    parts = [(_table(section.rows), section.title, section.style) for section in sections(now.shown)]
    rows = sum(part.row_count for part, _, _ in parts)
    if height >= rows + 2 * len(parts):
        (first, title, style), *others = parts
        return Group(_panel(first, title + note, style), *(_panel(*part) for part in others))
    together = Group(*(part for part, _, _ in parts))
    silent = now.shown.silent
    return _panel(together, f"robot{note}", "red" if silent else "blue") if height >= rows + 2 else together


def _map(now: Content, columns: int, rows: int) -> Panel:
    model = now.shown.model
    canvas, step_m = _drawn(now.shown, max(4, columns - 4), max(2, rows - 2))
    shown = "path" if model is not None and not model.sonars else "path and sonars"
    return _panel(canvas.text(), f"{shown}[/] [dim]· each {step_m:g} m")


def _drawn(now: Shown, columns: int, rows: int) -> Tuple[Canvas, float]:
    """Return the drawing, scaled to the path and the sonars' cones, and the step of its grid [m]."""
    pose, model = now.pose, now.model
    mounts = model.sonars if model else {}
    seen = [(name, m) for name, m in now.ranges.items() if name in mounts and not math.isnan(m)]
    cones = [(range_m, *_cone(pose, mounts[name], range_m)) for name, range_m in seen]
    path = [each[:2] for each in (*now.trail, pose)]
    corners = [corner for _, _, arc in cones for corner in (arc[0], arc[-1])]
    canvas = Canvas(columns, rows, fit([*path, *corners], columns, rows))
    for range_m, origin, arc in cones:
        for corner in (arc[0], arc[-1]):
            canvas.line((origin, corner), "blue", every=2)
        if range_m <= LONGEST_CONE_M:
            canvas.line(arc, range_style(range_m))
    canvas.line(path, "green")
    if model is not None:
        x_m, y_m = model.body.length_m / 2, model.body.width_m / 2
        sides = ((1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1))
        canvas.line([pose.compose(x * x_m, y * y_m)[:2] for x, y in sides], "bold")
    canvas.arrow(pose)
    step_m = next(
        (each for each in _GRIDS_M if each * canvas.view.scale >= 2 * _LEAST_GRID_COLUMNS), _GRIDS_M[-1]
    )
    canvas.grid(step_m, "grey37")
    return canvas, step_m


def _cone(pose: Pose, mount: SonarMount, range_m: float) -> Tuple[Point, List[Point]]:
    """Return the place of a sonar, and points of the far end of its cone [m]."""
    origin = pose.compose(*mount.pose)
    length_m = max(mount.kind.nearest_m, min(LONGEST_CONE_M, range_m))
    turns = (mount.kind.field_of_view_rad * each for each in _ARC)
    return origin[:2], [origin.compose(0.0, 0.0, turn).compose(length_m, 0.0)[:2] for turn in turns]


def _frames(now: Content, columns: int, rows: int) -> Panel:
    """Return the panel of the latest kinds of frames, in the order of the first frame of each kind."""
    lines = sorted(now.log or [], key=lambda line: line.time_s)[-rows:]
    shown = [line for line in now.log or [] if line in lines]
    room = columns - 4
    return _panel(
        Group(*(_frame(line, now.shown.now_s, room) for line in shown)),
        "frames[/] [dim]> to the board  < from it",
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
