"""The page of a review: one HTML file that needs no other, and makes no request.

Its words are HTML, complete without JavaScript; path and charts are drawn from the data in it.  Palette, map and
charts are the files of the page of `mrl web`.  Texts of a recording are escaped, and the page's policy allows only its
own scripts and styles, by their hash.
"""

import codecs
import pathlib
import re
from datetime import datetime
from typing import Any, Dict, Iterator, List, Sequence

import numpy as np

from mrl_driver.json_text import json_text
from mrl_driver.protocol import REPLIES, REQUESTS_TO_ANY, Frame, FrameDecoder
from mrl_driver.protocol.stop_reason import STOP_REASONS, StopReason
from mrl_driver.protocol.table import BY_CODE, FAULTS, RESET_CAUSES, Field
from mrl_driver.recording.recording import FROM_BOARD, OWN_REMARKS, PHONE, TO_BOARD
from mrl_driver.view.words import STOPS

from .charts import reduced
from .drive_data import DriveData, Stop
from .findings import Finding
from .page_file import COMMON_STYLE, SHARED, Pair, escaped, filled, policy, read, row, tile

_OWN = pathlib.Path(__file__).resolve().parent / "page"
_UPLOT = SHARED / "vendor" / "uplot"
_SCRIPTS = (SHARED / "text.js", SHARED / "chart_options.js", SHARED / "map.js", _OWN / "review.js")
"""Modules of the page, each after those that it imports."""
_STYLES = (_UPLOT / "uPlot.min.css", COMMON_STYLE, _OWN / "review.css")
MOST_LISTED = 200  # stops that are listed one by one; further ones are counted
MOST_REMARKS = 50
_MOST_TEXT = 160
_ENDS = (StopReason.CLOSED, StopReason.CHECK_ENDED)  # reasons of a stop at the end of a program
_DIRECTIONS = {FROM_BOARD: "From the board", TO_BOARD: "To the board"}
_WORDS = {"stop_reason": STOP_REASONS, "reset_cause": RESET_CAUSES}


def render(drive: DriveData, findings: Sequence[Finding]) -> str:
    """Return the page of a drive, whose findings come with the most important first."""
    stops = drive.stops[:MOST_LISTED]
    style, script, uplot = "\n".join(map(read, _STYLES)), _script(), read(_UPLOT / "uPlot.iife.min.js")
    data = reduced(drive, [each.time_s for each in findings] + [each.time_s for each in stops])
    data["robot"] = _robot(drive)
    more = len(drive.stops) - MOST_LISTED
    further = f"<p>{more} further stops are not listed.</p>" if more > 0 else ""
    parts = {
        "policy": policy(style, uplot, script),
        "style": style,
        "licence": read(_UPLOT / "LICENSE"),
        "uplot": uplot,
        "script": script,
        "data": json_text(data, compact=True).replace("<", "\\u003c"),  # ends no element
        "title": escaped(f"Review of {pathlib.Path(drive.path).name}"),
        "subtitle": escaped(", ".join(filter(None, (drive.robot_name, _started(drive))))),
        "mark": "caution" if findings else "good",
        "verdict": escaped(_verdict(findings)),
        "tiles": "".join(_tiles(drive)),
        "findings": "".join(_finding(i + 1, each) for i, each in enumerate(findings))
        or "<p>No fault was found in this drive.</p>",
        "stops": "".join(map(_stop, stops)) + further or "<p>The robot was not stopped.</p>",
        "link": "".join(map(row, _link(drive))),
        "recording": "".join(map(row, _recording(drive))),
    }
    return filled(_OWN / "review.html", parts)


def _script() -> str:
    """The modules as one: without their imports and exports, names of all modules are in one scope."""
    modules = "\n".join(map(read, _SCRIPTS))
    return re.sub(r"^export ", "", re.sub(r"^import .*\n", "", modules, flags=re.M), flags=re.M)


def _seconds(time_s: float) -> str:
    return f"{time_s:.2f} s"


def _robot(drive: DriveData) -> Dict[str, Any]:
    """Body and sonars, as the map reads them."""
    body = drive.model.body
    sonars = {name: [*mount.pose, mount.kind.field_of_view_rad] for name, mount in drive.model.sonars.items()}
    return {"body": [body.length_m, body.width_m] if body else [0.2, 0.2], "sonars": sonars}


def _started(drive: DriveData) -> str:
    """Return when the recording began, in the zone that it was written in."""
    try:
        return datetime.fromisoformat(drive.started).strftime("%Y-%m-%d %H:%M:%S %Z").strip()
    except ValueError:
        return drive.started


def _verdict(findings: Sequence[Finding]) -> str:
    if not findings:
        return "No fault was found."
    first = findings[0]
    more = f", and {len(findings) - 1} more" if len(findings) > 1 else ""
    return f"{first.title} (at {_seconds(first.time_s)}){more}"


# -- the drive in numbers


def _tiles(drive: DriveData) -> Iterator[str]:
    yield tile("Duration", f"{drive.duration_s:.1f}", "s")
    if len(drive.poses.time_s) and drive.model.has_odometry:
        yield tile("Distance", f"{drive.path_length_m:.2f}", "m")
        yield tile("Top speed", f"{np.max(np.abs(drive.speeds.values[:, 0])):.2f}", "m/s")
    ranges = {name: column.values[np.isfinite(column.values)] for name, column in drive.ranges.items()}
    least = {name: float(np.min(values)) for name, values in ranges.items() if len(values)}
    if least:
        nearest = min(least, key=lambda name: least[name])
        yield tile("Nearest", f"{least[nearest]:.2f}", "m", nearest)
    volts = drive.battery.values[:, 0] if len(drive.battery.time_s) else np.array([])
    volts = volts[np.isfinite(volts)]
    if len(volts):
        yield tile("Battery", f"{volts[-1]:.1f}", "V", f"least {np.min(volts):.1f} V")
    own = sum(map(_is_unwanted, drive.stops))
    yield tile("Stops", str(len(drive.stops)), "", f"{own} not by the user" if own else "")
    if len(drive.delays.time_s):
        worst_s = float(np.max(drive.delays.values))
        median_s = float(np.median(drive.delays.values))
        yield tile("Worst delay", f"{1000 * worst_s:.0f}", "ms", f"median {1000 * median_s:.0f} ms")


# -- findings and stops


def _finding(number: int, found: Finding) -> str:
    remedy = f'<p class="remedy">{escaped(found.remedy)} <code>[{escaped(found.kind)}]</code></p>'
    text = f"<p>{escaped(found.text)}</p>{remedy}"
    return _article("bad", found.time_s, str(number), found.title, text + _proof(found.direction, found.data))


def _stop(stop: Stop) -> str:
    mark, remedy = "caution" if _is_unwanted(stop) else "", STOPS[stop.reason].remedy
    text = f"<p>To drive on: {escaped(remedy)}.</p>" if remedy else ""
    return _article(
        mark, stop.time_s, "", stop.text[:1].upper() + stop.text[1:], text + _proof(stop.direction, stop.data)
    )


def _article(mark: str, time_s: float, number: str, title: str, content: str) -> str:
    """What happened at one moment; the page's script reads the attributes `data-`."""
    badge = f"<span>{number}</span>" if number else ""
    return (
        f'<article class="found" data-mark="{mark}" data-time="{time_s:.6f}" data-text="{number}">'
        f"<h3>{badge}{escaped(title)}</h3>"
        f'<button type="button" class="goto">At {_seconds(time_s)}</button>{content}</article>'
    )


def _is_unwanted(stop: Stop) -> bool:
    """Neither the user stopped the robot, nor did the program end."""
    return bool(STOPS[stop.reason].why) and stop.reason not in _ENDS


def _proof(direction: str, data: bytes) -> str:
    """The frame as it is in the recording, and what it says."""
    if not data:
        return ""
    return (
        f'<p class="proof">{_DIRECTIONS.get(direction, "Data")}: <code>{escaped(_cut(raw_text(data)))}</code>'
        f" {escaped(frame_text(direction, data))}</p>"
    )


def raw_text(data: bytes) -> str:
    """Return bytes as they are written in the recording."""
    return codecs.escape_encode(data)[0].decode("ascii")


def frame_text(direction: str, data: bytes) -> str:
    """Return what a frame says, such as `move_differential: linear 250 mm/s, angular 0 mrad/s`."""
    for checked in (True, False):
        decoder = FrameDecoder(REQUESTS_TO_ANY if direction == TO_BOARD else REPLIES, checked)
        for event in decoder.feed(data):
            if isinstance(event, Frame):
                return _fields(direction, event)
    return "not a valid frame"


def _fields(direction: str, frame: Frame) -> str:
    row = BY_CODE[frame.code]
    fields = row.request if direction == TO_BOARD else row.reply
    values = [f"{field.name} {_value(field, value)}".rstrip() for field, value in zip(fields, frame.args)]
    return f"{row.name}: {', '.join(values)}" if values else row.name


def _value(field: Field, value: int) -> str:
    """A number with its unit, or the word that stands for it in the table."""
    if field.name in _WORDS:
        return _WORDS[field.name][value]
    if field.name == "faults":
        return " ".join(name for bit, (name, _) in enumerate(FAULTS) if value >> bit & 1) or "none"
    return f"{value * field.scale:g} {field.base_unit}"


def _cut(text: str) -> str:
    return text if len(text) <= _MOST_TEXT else f"{text[:_MOST_TEXT]} ..."


# -- link and recording


def _link(drive: DriveData) -> List[Pair]:
    frames = len(drive.heard)
    lost = int(drive.lost.values[-1]) if len(drive.lost.time_s) else 0
    reasons: Dict[str, int] = {}
    for _, _, reason, _ in drive.garbage:
        reasons[reason] = reasons.get(reason, 0) + 1
    damaged = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in sorted(reasons.items()))
    rows = [
        ("Frames", f"{frames} from the board"),
        ("Lost", _share(lost, frames)),
        ("Damaged", damaged or "none"),
    ]
    for name, column in (("Delays", drive.delays), ("Answers", drive.round_trips)):
        if len(column.time_s):
            values = (1000 * float(each) for each in np.percentile(column.values, (50, 99, 100)))
            rows.append((name, "median {:.1f} ms, 99 % within {:.1f} ms, worst {:.1f} ms".format(*values)))
    openings = [f"{_seconds(time_s)} {port}" for time_s, port in drive.opened[:MOST_REMARKS]]
    if len(drive.opened) > 1:
        rows.append(("Opened", "; ".join(map(_cut, openings))))
    return rows


def _share(lost: int, frames: int) -> str:
    return f"{lost} ({100 * lost / (lost + frames):.2g} %)" if lost else "none"


def _recording(drive: DriveData) -> List[Pair]:
    board = drive.board
    rows = [
        ("File", drive.path),
        ("Started", _started(drive)),
        ("Port", drive.port),
        ("Robot", drive.robot_name),
        ("Firmware", str(board.version) if board else ""),
        ("Damaged", f"{drive.skipped_lines} lines are damaged or missing" if drive.skipped_lines else ""),
    ]
    own = tuple(each.decode() for each in (*OWN_REMARKS, PHONE.strip()))
    remarks = [each for each in drive.remarks if each[1].partition(" ")[0] not in own]
    rows += [(_seconds(time_s), text) for time_s, text in remarks[:MOST_REMARKS]]
    return [(name, _cut(value)) for name, value in rows if value]
