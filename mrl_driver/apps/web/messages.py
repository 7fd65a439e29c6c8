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
from mrl_driver.robot.models import Limits, OmniDrive, RobotModel
from mrl_driver.robot.sonar import FIELD_OF_VIEW_RAD
from mrl_driver.view.live_model import Shown
from mrl_driver.view.rows import sections

from .helm import STOP_S, Control, Goal, HelmState
from .robot import PhoneReading, Recorded

MOST_BYTES = 4096
"""Longest message of a page [byte]."""
MOST_REFUSALS = 5
"""A connection with this many malformed messages in a row is closed."""
HELLO_S = 3.0
"""A page introduces itself within this time [s]."""
PERIOD_MS = 50
"""Time between two messages of a page whose control is held [ms]."""
MOST_SPEED, FARTHEST_M, MOST_TURN = 100.0, 10_000.0, 100.0
"""Largest speed [m/s, rad/s], coordinate of a goal [m], and yaw of a goal [rad]."""
_MOST_NAME, _MOST_TOKEN = 40, 200
_LATEST_MS = 1e13
_LARGEST_WHOLE = 2**53 - 1
"""The largest whole number of a page's language."""


class Malformed(MrlError):
    """A message of a page cannot be read; the text says why in one line."""


class Hello(NamedTuple):
    """The first message."""

    token: str
    name: str


class Ping(NamedTuple):
    """The page is there; times as in `Control`."""

    t_s: float
    heard_s: Optional[float]
    heard_t_s: Optional[float]


class Take(NamedTuple):
    """The person wants to drive."""


class Yield(NamedTuple):
    """The person does not want to drive any more."""


class Stop(NamedTuple):
    """The emergency stop was pressed."""


class Release(NamedTuple):
    """The emergency stop is to end."""


class Record(NamedTuple):
    """A recording is to begin or to end."""

    on: bool


class Phone(NamedTuple):
    """The phone's sensors."""

    reading: PhoneReading


Message = Union[Hello, Control, Ping, Take, Yield, Stop, Release, Record, Phone]
Check = Callable[[str, Any], Any]


# -- messages of pages: for each type its fields with their checks, and those that may be missing


def _refuse(name: str, value: Any, expected: str) -> Malformed:
    return Malformed(f"{name} is {reprlib.repr(value)}, expected {expected}")


def _number(low: float, high: float) -> Check:
    def check(name: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise _refuse(name, value, f"a number from {low:g} to {high:g}")
        return float(value)

    return check


def _whole(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _LARGEST_WHOLE:
        raise _refuse(name, value, f"a whole number from 0 to {_LARGEST_WHOLE}")
    return value


def _flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise _refuse(name, value, "true or false")
    return value


def _text(most: int) -> Check:
    def check(name: str, value: Any) -> str:
        if not isinstance(value, str) or len(value) > most or not value.isprintable():
            raise _refuse(name, value, f"at most {most} printable characters")
        return value

    return check


def _time(name: str, value: Any) -> float:
    return _MILLISECONDS(name, value) / 1000


def _or_none(check: Check) -> Check:
    return lambda name, value: None if value is None else check(name, value)


def _list(check: Check, *sizes: int) -> Check:
    def each(name: str, value: Any) -> List[Any]:
        if not isinstance(value, list) or len(value) not in sizes:
            raise _refuse(name, value, f"a list of {' or '.join(map(str, sizes))}")
        return [check(name, part) for part in value]

    return each


def _goal(name: str, value: Any) -> Goal:
    place = _GOAL(name, value)
    if len(place) == 3 and abs(place[2]) > MOST_TURN:
        raise _refuse(name, value, f"a yaw of at most {MOST_TURN:g} rad")
    return Goal(*place)


_MILLISECONDS = _number(-_LATEST_MS, _LATEST_MS)
_GOAL = _list(_number(-FARTHEST_M, FARTHEST_M), 2, 3)
_SPEED = _number(-MOST_SPEED, MOST_SPEED)
_ANGLE = _or_none(_number(-360.0, 360.0))
_VECTOR = _or_none(_list(_number(-1e4, 1e4), 3))
_SPEEDS = {"linear": _SPEED, "angular": _SPEED, "lateral": _SPEED}
_ECHO = {"t": _time, "heard": _or_none(_time), "heard_t": _or_none(_time)}

_FIELDS: Dict[str, Dict[str, Check]] = {
    "hello": {"token": _text(_MOST_TOKEN), "name": _text(_MOST_NAME)},
    "control": {"seq": _whole, "press": _whole, "held": _flag, **_ECHO},
    "ping": _ECHO,
    "take": {},
    "yield": {},
    "stop": {},
    "release": {},
    "record": {"on": _flag},
    "phone": {
        "t": _time,
        "alpha": _ANGLE,
        "beta": _ANGLE,
        "gamma": _ANGLE,
        "absolute": _flag,
        "acceleration": _VECTOR,
        "rotation": _VECTOR,
    },
}
"""The fields of each type."""
_GOES: Dict[str, Check] = {"goal": _goal}


def parse(data: Union[str, bytes]) -> Message:
    """Return the message of a page.

    Raises:
        Malformed: it cannot be read.
    """
    fields = _object(data)
    kind = fields.pop("type", None)
    checks = _FIELDS.get(kind) if isinstance(kind, str) else None
    if checks is None:
        raise _refuse("type", kind, "one of " + ", ".join(_FIELDS))
    if kind == "control" and fields.get("held") is True:
        checks = {**checks, **(_GOES if "goal" in fields else _SPEEDS)}
    for name in fields:
        if name not in checks:
            raise Malformed(
                f"{kind} has a field {reprlib.repr(name)}, expected {', '.join(checks) or 'none'}"
            )
    for name in checks:
        if name not in fields:
            raise Malformed(f"{kind} has no {name}, expected {', '.join(checks)}")
    return _MAKE[kind]({name: check(f"{kind}: {name}", fields[name]) for name, check in checks.items()})


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


def _echo(fields: Mapping[str, Any]) -> Tuple[float, Optional[float], Optional[float]]:
    return fields["t"], fields["heard"], fields["heard_t"]


def _control(fields: Mapping[str, Any]) -> Control:
    linear_m_s, angular_rad_s, lateral_m_s = (fields.get(name, 0.0) for name in _SPEEDS)
    return Control(
        fields["seq"],
        *_echo(fields),
        press=fields["press"],
        held=fields["held"],
        linear_m_s=linear_m_s,
        angular_rad_s=angular_rad_s,
        lateral_m_s=lateral_m_s,
        goal=fields.get("goal"),
    )


def _phone(fields: Mapping[str, Any]) -> Phone:
    alpha_deg, beta_deg, gamma_deg = (
        math.nan if fields[name] is None else fields[name] for name in ("alpha", "beta", "gamma")
    )
    acceleration, rotation = (fields[name] and tuple(fields[name]) for name in ("acceleration", "rotation"))
    return Phone(
        PhoneReading(fields["t"], alpha_deg, beta_deg, gamma_deg, fields["absolute"], acceleration, rotation)
    )


_MAKE: Dict[str, Callable[[Dict[str, Any]], Message]] = {
    "hello": lambda fields: Hello(**fields),
    "control": _control,
    "ping": lambda fields: Ping(*_echo(fields)),
    "take": lambda fields: Take(),
    "yield": lambda fields: Yield(),
    "stop": lambda fields: Stop(),
    "release": lambda fields: Release(),
    "record": lambda fields: Record(**fields),
    "phone": _phone,
}


# -- our messages


def encode(kind: str, now_s: float, **fields: Any) -> str:
    """Return a message as JSON; `now_s` is the time at which it is made."""
    return json_text({"type": kind, "at": round(now_s * 1000, 3), **fields}, compact=True)


def robot_facts(name: str, model: Optional[RobotModel], limits: Optional[Limits]) -> Dict[str, Any]:
    """Return what `welcome` says of a robot [m, rad, m/s, rad/s]."""
    facts: Dict[str, Any] = {"name": name, "body": None, "drive": "none", "sonars": {}, "limits": None}
    if model is None:
        return facts
    sideways = isinstance(model.drive, OmniDrive)
    if model.drives:
        facts["drive"] = "omni" if sideways else "differential"
    facts["body"] = [model.body.length_m, model.body.width_m]
    facts["sonars"] = {sonar: [*mount.pose, FIELD_OF_VIEW_RAD] for sonar, mount in model.sonars.items()}
    if limits is not None:
        lateral_m_s = (limits.lateral_m_s or limits.linear_m_s) if sideways else 0.0
        facts["limits"] = {
            "linear": limits.linear_m_s,
            "angular": limits.angular_rad_s,
            "lateral": lateral_m_s,
        }
    return facts


def welcome(
    now_s: float,
    role: str,
    you: int,
    version: str,
    robot: Mapping[str, Any],
    series: Sequence[Tuple[str, str]],
    can_record: bool,
    recording: Optional[str],
    recordings: Sequence[Recorded],
    phone: bool,
) -> str:
    """Our first message, and again if the robot or its series are others.

    `role` is `drive` or `watch`, `you` the client's number, `robot` as from `robot_facts`, `recording` the name of the
    recording that is being written; `phone`: the phone's sensors are wanted.
    """
    return encode(
        "welcome",
        now_s,
        role=role,
        you=you,
        version=version,
        robot=robot,
        series=series,
        period_ms=PERIOD_MS,
        stop_ms=round(STOP_S * 1000),
        can_record=can_record,
        recording=recording,
        recordings=[_file(each) for each in recordings],
        phone=phone,
    )


def _file(recorded: Recorded) -> Dict[str, Any]:
    return {"name": recorded.name, "size": recorded.size, "on": recorded.on}


def sample(now_s: float, values: Iterable[float]) -> str:
    """The numbers of the series now, with six digits."""
    return encode("sample", now_s, v=[float(f"{value:.6g}") for value in values])


def view_facts(shown: Shown) -> Dict[str, Any]:
    """Return the fields of `view`, rounded so that they stay the same while the robot rests.

    A row is name, value and style, and if it has a bar, the bar's share and style.
    """
    state = shown.state
    return {
        "name": state.name,
        "sections": [
            {
                "title": section.title,
                "style": section.style,
                "rows": [
                    [row.name, row.value, row.style, *([list(row.bar)] if row.bar else [])]
                    for row in section.rows
                ],
            }
            for section in sections(shown)
        ],
        "notice": shown.notice,
        "silent": state.silent,
        "stopped": state.stopped,
        "command": None if state.command is None else [round(speed, 3) for speed in state.command],
        "rate_hz": round(shown.rate_hz, 1),
        "battery": {
            "v": round(state.battery_v, 2),
            "share": round(state.battery_share, 2),
            "state": state.battery_state,
        },
        "ranges": {name: round(range_m, 3) for name, range_m in state.ranges.items()},
    }


def view(now_s: float, **facts: Any) -> str:
    """What a live view shows, in the words of the terminal's; `facts` are those of `view_facts`."""
    return encode("view", now_s, **facts)


def path(now_s: float, poses: Iterable[Pose]) -> str:
    """The way that the robot has gone [m m rad]."""
    return encode("path", now_s, poses=[[round(part, 3) for part in pose] for pose in poses])


def cells(now_s: float, size_m: float, taken: Iterable[Tuple[int, int]]) -> str:
    """The occupied cells of the floor; cell (i, j) begins at (i, j) times its size [m]."""
    return encode("cells", now_s, size=size_m, taken=[list(cell) for cell in taken])


def helm(now_s: float, state: HelmState, names: Mapping[int, str], viewers: int) -> str:
    """Which page drives, and why the robot stands; `names` are those of all clients by number."""
    other = state.latched_by_other if state.latched_by is None else names.get(state.latched_by, "")
    return encode(
        "helm",
        now_s,
        driver=state.driver,
        names={str(number): name for number, name in names.items()},
        wants=state.wants,
        driving=state.driving,
        latched=state.latched,
        latched_by=state.latched_by,
        latched_by_name=other,
        spent={str(number): press for number, press in state.spent.items()},
        why=state.why,
        age_ms=round(state.age_s * 1000, 1),
        viewers=viewers,
        late=state.late,
        repeated=state.repeated,
        malformed=state.malformed,
    )


def refused(now_s: float, why: str) -> str:
    """What the page asked for does not happen."""
    return encode("refused", now_s, why=why)


def recording(now_s: float, on: bool, name: str, seconds: float, loss: str, files: Sequence[Recorded]) -> str:
    """The recording that is being written, how long already, what it lacks in words; and what can be downloaded."""
    return encode(
        "recording",
        now_s,
        on=on,
        name=name,
        seconds=round(seconds, 1),
        loss=loss,
        files=[_file(each) for each in files],
    )


def closed(now_s: float, why: str, again: bool = True) -> str:
    """Our last message; `again`: the page may connect again, because the reason may pass."""
    return encode("closed", now_s, why=why, again=again)
