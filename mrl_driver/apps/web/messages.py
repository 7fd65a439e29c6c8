"""The messages of page and server: JSON objects with a `type`.  No I/O.

Messages of pages are read strictly: a field that is missing, unknown, of another type or out of range refuses the
message.  Ours have the time `at`; in them NaN is null, and the infinities are the strings "inf" and "-inf".
"""

import json
import math
import reprlib
from typing import Any, Callable, Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

from mrl_driver.errors import MrlError
from mrl_driver.geometry import Pose
from mrl_driver.json_text import json_text
from mrl_driver.robot.models import Limits, RobotModel
from mrl_driver.robot.models.drives import moves_sideways
from mrl_driver.view.rows import sections
from mrl_driver.view.shown_state import Shown
from mrl_driver.view.words import STOPS

from .helm import Control, Goal, HelmState
from .robot import PhoneReading, Recorded

MOST_BYTES = 4096  # longest message of a page [byte]
MOST_REFUSALS = 5  # a connection with this many malformed messages in a row is closed
HELLO_S = 3.0  # a page introduces itself within this time [s]
MOST_SPEED, FARTHEST_M, MOST_TURN = 100.0, 10_000.0, 100.0
"""Largest speed [m/s, rad/s], coordinate of a goal [m], and yaw of a goal [rad]."""
_MOST_NAME, _MOST_TOKEN = 40, 200
_LATEST_MS = 1e13
_LARGEST_WHOLE = 2**53 - 1  # the largest whole number of a page's language


class Malformed(MrlError):
    """A message of a page cannot be read; the text says why in one line."""


class Message(NamedTuple):
    """A message of a page."""

    kind: str  # its type
    value: Any  # a `Control` or a `PhoneReading`; of other kinds, its fields by name


# -- messages of pages: for each type its fields with their checks.  Types are exact: to Python, True is an int, too.


Check = Callable[[str, Any], Any]


def _check(
    expected: str, fits: Callable[[Any], bool], read: Callable[[Any], Any] = lambda value: value
) -> Check:
    """Return what reads a field: what it may be, in words and as a function, and what it is read as."""

    def check(name: str, value: Any) -> Any:
        if not fits(value):
            raise _refuse(name, value, expected)
        return read(value)

    return check


def _refuse(name: str, value: Any, expected: str) -> Malformed:
    return Malformed(f"{name} is {reprlib.repr(value)}, expected {expected}")


def _number(low: float, high: float, scale: float = 1.0) -> Check:
    return _check(
        f"a number from {low:g} to {high:g}",
        lambda value: type(value) in (int, float) and low <= value <= high,
        lambda value: float(value) / scale,
    )


def _text(most: int) -> Check:
    return _check(
        f"at most {most} printable characters",
        lambda value: type(value) is str and len(value) <= most and value.isprintable(),
    )


def _or_none(check: Check, none: Any = None) -> Check:
    return lambda name, value: none if value is None else check(name, value)


def _tuple(check: Check, *sizes: int) -> Check:
    fits = _check(
        f"a list of {' or '.join(map(str, sizes))}", lambda value: type(value) is list and len(value) in sizes
    )
    return lambda name, value: tuple(check(name, part) for part in fits(name, value))


def _goal(name: str, value: Any) -> Goal:
    goal = Goal(*_PLACE(name, value))
    if abs(goal.yaw_rad or 0.0) > MOST_TURN:
        raise _refuse(name, value, f"a yaw of at most {MOST_TURN:g} rad")
    return goal


_WHOLE = _check(
    f"a whole number from 0 to {_LARGEST_WHOLE}",
    lambda value: type(value) is int and 0 <= value <= _LARGEST_WHOLE,
)
_FLAG = _check("true or false", lambda value: type(value) is bool)
_TIME = _number(-_LATEST_MS, _LATEST_MS, scale=1000.0)
_PLACE = _tuple(_number(-FARTHEST_M, FARTHEST_M), 2, 3)
_SPEED = _number(-MOST_SPEED, MOST_SPEED)
_ANGLE = _or_none(_number(-360.0, 360.0), math.nan)
_VECTOR = _or_none(_tuple(_number(-1e4, 1e4), 3))
_SPEEDS: Dict[str, Check] = {"linear": _SPEED, "angular": _SPEED, "lateral": _SPEED}
_ECHO: Dict[str, Check] = {"t": _TIME, "heard": _or_none(_TIME), "heard_t": _or_none(_TIME)}
_FIELDS: Dict[str, Mapping[str, Check]] = {
    "hello": {"token": _text(_MOST_TOKEN), "name": _text(_MOST_NAME)},
    "control": {"seq": _WHOLE, **_ECHO, "press": _WHOLE, "held": _FLAG},
    "ping": _ECHO,
    "take": {},
    "yield": {},
    "stop": {},
    "release": {"heard": _ECHO["heard"]},
    "record": {"on": _FLAG},
    "phone": {
        **{"t": _TIME, "alpha": _ANGLE, "beta": _ANGLE, "gamma": _ANGLE, "absolute": _FLAG},
        **{"acceleration": _VECTOR, "rotation": _VECTOR},
    },
}
"""The fields of each type; those of a held control are followed by its speeds or its goal."""


def parse(data: Union[str, bytes]) -> Message:
    """Return the message of a page; raise Malformed if it cannot be read."""
    fields = _object(data)
    kind = fields.pop("type", None)
    checks = _FIELDS.get(kind) if isinstance(kind, str) else None
    if checks is None:
        raise _refuse("type", kind, "one of " + ", ".join(_FIELDS))
    if kind == "control" and fields.get("held") is True:
        checks = {**checks, **({"goal": _goal} if "goal" in fields else _SPEEDS)}
    wrong = sorted(fields.keys() ^ checks.keys())
    if wrong:
        expected = ", ".join(checks) or "none"
        raise Malformed(f"{kind}: {reprlib.repr(wrong)} missing or unknown, expected the fields {expected}")
    read = {name: check(f"{kind}: {name}", fields[name]) for name, check in checks.items()}
    if kind == "control":
        goal = read.pop("goal", None)
        return Message(kind, Control(*read.values())._replace(goal=goal))
    return Message(kind, PhoneReading(*read.values()) if kind == "phone" else read)


def _object(data: Union[str, bytes]) -> Dict[str, Any]:
    """Return the fields of a JSON object."""
    try:
        text = data if isinstance(data, str) else bytes(data).decode()
        size = len(text.encode())
        if size > MOST_BYTES:
            raise Malformed(f"the message has {size} bytes, expected at most {MOST_BYTES}")
        found = json.loads(text, object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        raise Malformed(f"the message is not JSON: {error}") from None
    if not isinstance(found, dict):
        raise _refuse("the message", found, "an object")
    return found


def _once(pairs: List[Tuple[str, Any]]) -> Dict[str, Any]:
    fields = dict(pairs)
    if len(fields) != len(pairs):
        raise ValueError("a field is there twice")
    return fields


# -- our messages


def encode(kind: str, now_s: float, **fields: Any) -> str:
    """Return a message as JSON; `now_s` is the time at which it is made."""
    return json_text({"type": kind, "at": round(now_s * 1000, 3), **fields}, compact=True)


def robot_facts(name: str, model: Optional[RobotModel], limits: Optional[Limits]) -> Dict[str, Any]:
    """Return what `welcome` says of a robot [m, rad, m/s, rad/s]."""
    facts: Dict[str, Any] = {"name": name, "body": None, "drive": "none", "sonars": {}, "limits": None}
    if model is None:
        return facts
    sideways = moves_sideways(model.drive)
    if model.drives:
        facts["drive"] = "omni" if sideways else "differential"
    facts["body"] = [model.body.length_m, model.body.width_m]
    facts["sonars"] = {
        sonar: [*mount.pose, mount.kind.field_of_view_rad] for sonar, mount in model.sonars.items()
    }
    if limits is not None:
        lateral_m_s = (limits.lateral_m_s or limits.linear_m_s) if sideways else 0.0
        speeds = limits.linear_m_s, limits.angular_rad_s, lateral_m_s
        facts["limits"] = dict(zip(_SPEEDS, speeds))
    return facts


def sample(now_s: float, values: Iterable[float]) -> str:
    """The numbers of the series now, with six digits."""
    return encode("sample", now_s, v=[float(f"{value:.6g}") for value in values])


def view_facts(shown: Shown) -> Dict[str, Any]:
    """Return the fields of `view`: what a live view shows, in the words of the terminal's.

    Numbers are rounded so that they stay the same while the robot rests.  A row is name, value, style, and the share
    and style of its bar, or null.
    """
    stopped = shown.stopped
    return {
        "name": shown.name,
        "sections": [section._asdict() for section in sections(shown)],
        "notice": shown.notice,
        "silent": shown.silent,
        "stopped": stopped,
        "reason": shown.stop_reason if stopped and STOPS[shown.stop_reason].why else "",
        "command": None if shown.command is None else [round(speed, 3) for speed in shown.command],
        "battery": {
            "v": round(shown.battery_v, 2),
            "share": round(shown.battery_share, 2),
            "state": shown.battery_state,
        },
        "ranges": {name: round(range_m, 3) for name, range_m in shown.ranges.items()},
    }


def path(now_s: float, poses: Iterable[Pose]) -> str:
    """The way that the robot has gone [m m rad]."""
    return encode("path", now_s, poses=[[round(part, 3) for part in pose] for pose in poses])


def cells(now_s: float, size_m: float, taken: Iterable[Tuple[int, int]]) -> str:
    """The occupied cells of the floor; cell (i, j) begins at (i, j) times its size [m]."""
    return encode("cells", now_s, size=size_m, taken=list(taken))


def helm(now_s: float, state: HelmState, names: Mapping[int, str]) -> str:
    """Which page drives, and why the robot stands; `names` are those of all clients by number."""
    other = state.latched_by_other if state.latched_by is None else names.get(state.latched_by, "")
    facts = {**vars(state), "why": state.why.words, "reason": state.why.reason}
    return encode("helm", now_s, latched_by_name=other, names=names, **facts)


def recording(now_s: float, on: bool, name: str, seconds: float, loss: str, files: Sequence[Recorded]) -> str:
    """The recording that is being written, how long already, what it lacks in words; and what can be downloaded."""
    listed = [each._asdict() for each in files]
    return encode("recording", now_s, on=on, name=name, seconds=round(seconds, 1), loss=loss, files=listed)


def closed(now_s: float, why: str, again: bool = True) -> str:
    """Our last message; `again`: the page may connect again, because the reason may pass."""
    return encode("closed", now_s, why=why, again=again)
