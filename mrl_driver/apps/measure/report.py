"""The result of a measurement: `measure.json`, lines for a terminal, one page, and the comparison of two results."""

import datetime
import json
import math
import pathlib
import platform
import textwrap
from typing import Any, Dict, Iterator, Mapping, Optional, Sequence

from mrl_driver.apps.review.page_file import COMMON_STYLE, escaped, filled, policy, read, row, tile
from mrl_driver.errors import ConfigError
from mrl_driver.files import read_plain
from mrl_driver.program import version

from .rows import ABSENT, AGREES, BETTER, KINDS, REPORTED, WORSE, Row, causes

FORMAT = 1
_LONGEST = 1 << 20  # longest file of a measurement that is read [byte]
_TEMPLATE = pathlib.Path(__file__).with_name("measure.html")
_REVIEW_STYLE = COMMON_STYLE.parent.parent.parent / "review" / "page" / "review.css"
_OWN_STYLE = pathlib.Path(__file__).with_name("measure.css")
_MARKS = {WORSE: "bad", AGREES: "good", BETTER: "good"}
Record = Mapping[str, Any]


def record(
    rows: Sequence[Row], board: Mapping[str, Any], findings: Sequence[Any], about: str
) -> Dict[str, Any]:
    """Return what `measure.json` holds.

    Args:
        board: facts of `mrl info`.
        findings: faults and warnings of `mrl doctor`.
        about: words of the user for the board, or the kind of its port.
    """
    return {
        "format": FORMAT,
        "made": datetime.datetime.now().astimezone().isoformat(timespec="seconds"),
        "about": about,
        "mrl_driver": version(),
        "computer": f"{platform.platform()}, Python {platform.python_version()}",
        "board": {name: value for name, value in board.items() if name != "port"},
        "findings": [each._asdict() for each in findings],
        "rows": [each.as_json() for each in sorted(rows, key=lambda row: list(KINDS).index(row.key))],
        "causes": [each._asdict() for each in causes(rows)],
    }


def load(path: str) -> Dict[str, Any]:
    """Return a measurement that was written before; raise ConfigError if the file holds none."""
    try:
        found: Dict[str, Any] = json.loads(read_plain(path, _LONGEST))
        if found["format"] != FORMAT:
            raise ConfigError(
                f"{path} has format {found['format']} of mrl-driver {found['mrl_driver']}, expected format {FORMAT}: "
                "measure again with this version"
            )
        for each in found["rows"]:
            _ = each["key"], each["text"], each["unit"], each["verdict"]
            each["tolerance"] = float(each["tolerance"])
            each["value"] = None if each["value"] is None else float(each["value"])
        _ = found["about"], found["made"][:16], found["mrl_driver"], {**found["board"]}
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror or error}") from None
    except ConfigError:
        raise
    except (ValueError, KeyError, TypeError, RecursionError):
        raise ConfigError(f"{path} is not a measurement, expected a file of mrl measure") from None
    return found


def number(value: Any, unit: str = "") -> str:
    """Return a value in three or four digits, with its unit; a dash for none."""
    if not _is_number(value):
        return "-"
    digits = ".0f" if abs(value) >= 1000 or value == round(value) else ".3g" if abs(value) >= 0.001 else ".3f"
    text = f"{value:{digits}}"
    return f"{text} {unit}".rstrip()


def judged(found: Record) -> str:
    """Return the verdict of a row in words, and by how much it differs."""
    verdict, by = found["verdict"], found["by"]
    if by is None or math.isinf(by):
        return f"{verdict}: {found['note']}"
    if verdict in (WORSE, BETTER):
        over = abs(by) - (found["tolerance"] if found["emulated"] is None else 0.0)
        return f"{verdict} by {number(over, found['unit'])}"
    return str(verdict)


def verdict(result: Record) -> str:
    """Return the whole result in one sentence."""
    verdicts = [each["verdict"] for each in result["rows"]]
    worse, missing = verdicts.count(WORSE), verdicts.count(ABSENT)
    judged, rest = len(verdicts) - missing - verdicts.count(REPORTED), f"; {missing} were not measured"
    if not worse:
        return f"All {judged} rows that were judged are as they should be{rest * (missing > 0)}."
    first = result["causes"][0]
    return f"{worse} of {judged} rows are worse; first likely cause: {first['code']}: {first['remedy']}"


WIDE = 100
"""Columns of a terminal on which each row is a line of a table."""


def lines(result: Record, columns: int = WIDE) -> Iterator[str]:
    """Yield the result for a terminal."""
    for line in _lines(result, columns >= WIDE):
        yield line if columns >= WIDE else textwrap.fill(line, columns, subsequent_indent="    ")


def _lines(result: Record, wide: bool) -> Iterator[str]:
    section = ""
    for each in result["rows"]:
        if each["section"] != section:
            section = each["section"]
            yield from ("", section)
        p99 = f", p99 {number(each['p99'], each['unit'])}" if each["p99"] is not None else ""
        text, value = each["text"], number(each["value"], each["unit"])
        shown = "" if value == "-" else f"{value}, "
        yield (f"  {text:<65} {value:>12}  " if wide else f"  {text}: {shown}") + judged(each) + p99
    yield ""
    yield from (f"{cause['code']}: {cause['remedy']}" for cause in result["causes"])
    yield verdict(result)


def render(result: Record) -> str:
    """Return the page of a measurement: one HTML file that makes no request."""
    style = "\n".join(map(read, (COMMON_STYLE, _REVIEW_STYLE, _OWN_STYLE)))
    facts = {**result["board"], **{name: result[name] for name in ("mrl_driver", "computer")}}
    return filled(
        _TEMPLATE,
        {
            "policy": policy(style),
            "style": style,
            "title": escaped(f"Measured: {result['about']}"),
            "subtitle": escaped(f"{_robot(result) or 'board'}, {result['made'].replace('T', ' ')}"),
            "mark": "bad" if result["causes"] else "good",
            "verdict": escaped(verdict(result)),
            "tiles": "".join(_tiles(result)),
            "causes": "".join(map(_cause, result["causes"])) or "<p>No row is worse than expected.</p>",
            "findings": "".join(map(_finding, result["findings"])) or "<p>The board reports no problem.</p>",
            "rows": "".join(_table(result["rows"])),
            "facts": "".join(row((name.replace("_", " "), _text(value))) for name, value in facts.items()),
        },
    )


def _text(value: Any) -> str:
    if value is None:
        return "not measured"
    return (", ".join(map(str, value)) or "none") if isinstance(value, (list, dict)) else str(value)


def _tiles(result: Record) -> Iterator[str]:
    titles = {
        "turnaround_encoders_us": "Turnaround",
        "stream_hz": "Stream",
        "frames_damaged": "Damaged",
        "watchdog_ms": "Watchdog",
        "stop_confirmed_ms": "Stop confirmed",
    }
    for each in result["rows"]:
        if each["key"] in titles and each["value"] is not None:
            yield tile(titles[each["key"]], number(each["value"]), each["unit"])


def _cause(cause: Record) -> str:
    texts = "; ".join(KINDS[key].text for key in cause["rows"])
    return _article("bad", cause["code"], f"Worse: {texts}.", cause["remedy"])


def _finding(found: Record) -> str:
    return _article("caution", found["subject"], found["text"], found["advice"])


def _article(mark: str, title: str, text: str, remedy: str) -> str:
    return (
        f'<article class="found" data-mark="{mark}"><h3>{escaped(title)}</h3><p>{escaped(text)}</p>'
        f'<p class="remedy">{escaped(remedy)}</p></article>'
    )


def _table(rows: Sequence[Record]) -> Iterator[str]:
    section = ""
    for each in rows:
        if each["section"] != section:
            section = each["section"]
            yield f'<tr><th colspan="4" scope="rowgroup">{escaped(section)}</th></tr>'
        mark, words = _MARKS.get(each["verdict"], ""), escaped(judged(each))
        limit = f'<td class="number">{escaped(_expected(each))}</td>'
        if not _is_number(each["value"]):
            yield f'<tr><td>{escaped(each["text"])}</td>{limit}<td colspan="2" data-mark="{mark}">{words}</td></tr>'
            continue
        p99 = f"p99 {number(each['p99'], each['unit'])}" if each["p99"] is not None else each["note"]
        note = f"<small>{escaped(p99)}</small>" if p99 else ""
        value = f'<td class="number">{escaped(number(each["value"], each["unit"]))}</td>'
        yield f'<tr><td>{escaped(each["text"])}{note}</td>{limit}{value}<td data-mark="{mark}">{words}</td></tr>'


def _is_number(value: Any) -> bool:
    return value is not None and math.isfinite(value)


def _expected(found: Record) -> str:
    """Return the emulated value, or without one what a sound board does not exceed."""
    if found["emulated"] is not None or not _is_number(found["value"]):
        return number(found["emulated"], found["unit"])
    sign, words = (-1, "at least") if KINDS[found["key"]].more_is_better else (1, "at most")
    return f"{words} {number(found['expected'] + sign * found['tolerance'], found['unit'])}"


# -- two measurements


def compared(first: Record, second: Record) -> Dict[str, Any]:
    """Return both boards, the rows that both have, whether these differ by more than a sound board may, and the
    texts of the rows that only one has.
    """
    mine, other = (
        {each["key"]: each for each in one["rows"] if each["value"] is not None} for one in (first, second)
    )
    return {
        "measured": [_who(first), _who(second)],
        "rows": [_pair(row, other[key]) for key, row in mine.items() if key in other],
        "only_first": [row["text"] for key, row in mine.items() if key not in other],
        "only_second": [row["text"] for key, row in other.items() if key not in mine],
    }


def _robot(result: Record) -> Optional[str]:
    """The robot's model, and whether it is virtual; None without one."""
    robot = result["board"].get("robot")
    return f"virtual {robot}" if robot and result["board"].get("virtual") else robot


def _who(result: Record) -> Dict[str, Any]:
    return {
        "about": result["about"],
        "robot": _robot(result),
        **{name: result[name] for name in ("made", "mrl_driver")},
    }


def _pair(one: Record, other: Record) -> Dict[str, Any]:
    by = other["value"] - one["value"]
    same = other["value"] == one["value"] or abs(by) <= one["tolerance"]
    names = {name: one[name] for name in ("key", "text", "unit")}
    return {**names, "first": one["value"], "second": other["value"], "by": by, "same": same}


def comparison(facts: Record) -> Iterator[str]:
    """Yield a comparison for a terminal."""
    for name, one in zip("AB", facts["measured"]):
        yield f"{name}: {one['about']}, {one['robot'] or 'board'}, {one['made'][:16]}, mrl-driver {one['mrl_driver']}"
    if len({one["robot"] for one in facts["measured"]}) > 1:
        yield "They are of different kinds: each manoeuvre is judged by its own model."
    for each in facts["rows"]:
        unit = each["unit"]
        by = f" by {number(each['by'], unit)}" if math.isfinite(each["by"]) else ""
        words = "the same" if each["same"] else f"differs{by}"
        yield f"{each['text']:<65} {number(each['first']):>9} {number(each['second'], unit):>12}  {words}"
    for name, texts in zip("AB", (facts["only_first"], facts["only_second"])):
        yield from (f"{text:<65} only in {name}" for text in texts)
