"""The rows of a measurement: what was expected, how far a sound board may be off, the verdict, and the likely cause."""

import json
import math
import pathlib
from functools import lru_cache
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.problems import PROBLEMS
from mrl_driver.session.handshake import Board

AGREES, BETTER, WORSE, REPORTED, ABSENT = "agrees", "better", "worse", "reported", "not measured"
LINE, HOST, COURSE = "The line", "This computer", "The manoeuvres"
OLD = "firmware of 2013 cannot show it: upload the current one with mrl flash"


class Kind(NamedTuple):
    """One kind of row."""

    section: str
    text: str
    unit: str
    tolerance: float  # a sound board may be worse than expected by this much; infinity: it is only reported
    cause: str = ""  # likely cause if it is worse, a code of `problems`
    figure: str = (
        ""  # the emulated figure, see `emulated`; the firmware's have another one for H-bridge boards
    )
    more_is_better: bool = False
    command: str = ""  # mends the cause; by default the remedy of `problems`


USB_US = 4000.0
"""A USB adapter polls every millisecond in each direction, and this computer must wake up [us]."""
_REQUESTS = {
    "info": "robot_info",
    "encoders": "read_encoders",
    "encoders_sonars": "read_encoders_and_sonars",
    "status": "read_status",
    "protocol": "read_protocol",
    "counters": "read_counters",
}
_WITH_FIGURE = ("info", "encoders", "encoders_sonars")
TURNAROUNDS = {f"turnaround_{name}_us": row for name, row in _REQUESTS.items()}
"""Requests whose turnaround is measured, by the key of their row: none of them changes the board."""
OLD_TURNAROUNDS = {f"turnaround_{name}_us": _REQUESTS[name] for name in _WITH_FIGURE[:2]}
"""Those of boards of 2013; sonars took ten times as long in January as in August."""
_SHARE = "share of the error that the model allows"
_GAINS = "check that both wheels turn freely, then run: mrl calibrate gains --port PORT"

KINDS: Dict[str, Kind] = {
    "first_answer_s": Kind(LINE, "port opened to the first answer", "s", 5.0, "board_timeout"),
    **{
        f"turnaround_{name}_us": Kind(
            LINE, f"request {row} to the end of its answer, median", "us", USB_US, "usb_latency",
            f"firmware/{name}_turnaround_us_median" * (name in _WITH_FIGURE),
        )
        for name, row in _REQUESTS.items()
    },
    "stream_hz": Kind(LINE, "stream at its highest rate, in frames of 27 bytes", "Hz", 15.0, "slow_telemetry",
                      "firmware/stream_typical_hz", True),
    "checked_share": Kind(LINE, "share of the line that the stream with checksum and time uses", "", 0.03,
                          "slow_telemetry", "firmware/stream_checked_wire_use", True),
    "frames_damaged": Kind(LINE, "pieces of data that the decoder refuses", "", 0.0, "bad_cable",
                           "firmware/stream_checked_frames_bad"),
    "frames_lost": Kind(LINE, "frames missing by their sequence numbers", "", 0.0, "bad_cable"),
    "stream_jitter_us": Kind(LINE, "largest minus smallest gap at a period of 20 ms, by board time", "us", 250.0,
                             "board_stalled", "firmware/stream_jitter_us"),
    "clock_percent": Kind(LINE, "board time against this computer's clock", "%", 0.5, "board_stalled"),
    "delay_ms": Kind(LINE, "delay of a frame beyond the shortest one, p99", "ms", 50.0, "slow_line"),
    "watchdog_ms": Kind(LINE, "last byte to the watchdog's stop, watchdog 250 ms, by board time", "ms", 15.0,
                        "no_watchdog", "firmware/watchdog_stop_ms_max"),
    "host_late_ms": Kind(HOST, "a wait of 20 ms ends late, p99", "ms", 50.0, "late_host"),
    "telemetry_hz": Kind(HOST, "telemetry of the driver", "Hz", 5.0, "slow_telemetry", more_is_better=True),
    "driver_delay_ms": Kind(HOST, "request to answer through the driver, median", "ms", 50.0, "slow_line"),
    "driver_cpu_percent": Kind(HOST, "driver at 50 frames a second, of a core", "%", float("inf"),
                               figure="host/cpu_percent_driver_50hz"),
    "stop_confirmed_ms": Kind(HOST, "stop to its confirmation", "ms", 600.0, "requests_late"),
    "lost_ms": Kind(HOST, "cable pulled to the error", "ms", 300.0, "link_lost",
                    "reliability/link_loss_noticed_ms_max"),
    "return_s": Kind(HOST, "cable plugged in to working again", "s", 5.0, "board_timeout",
                     "reliability/reconnect_s_max"),
    "sonar_wall": Kind(COURSE, "error of the front sonar, 0.4 m closer to a wall", "mm", 0.0, "wheel_size"),
    "slowest_mm_s": Kind(COURSE, "slowest speed at which both wheels turn smoothly", "mm/s", 0.0, "wheel_slow",
                         command=_GAINS),
    "full_speed": Kind(COURSE, "full speed, reached within 3 s", "mm/s", 0.0, "wheel_slow", more_is_better=True,
                       command=f"charge the battery; {_GAINS}"),
    "wheels_alike": Kind(COURSE, "both wheels at the same speed, difference", "%", 0.0, "wheel_slow", command=_GAINS),
    "full_stop": Kind(COURSE, "stop from full speed", "mm", 0.0, "parameters",
                      command="compare the board's parameters with the model: mrl doctor --port PORT; let the wheels "
                      "brake: mrl config set stop_mode 0 --port PORT"),
    "straight": Kind(COURSE, f"straight line of 1 m, {_SHARE}", "", 1.0, "wheel_ratio"),
    "turn": Kind(COURSE, f"two turns, {_SHARE}", "", 1.0, "track_width"),
    "sonars_alike": Kind(COURSE, "share of the turns in which the worst sonar saw something", "%", 0.0, "sonar_deaf",
                         more_is_better=True),
    "arc": Kind(COURSE, f"circle 0.5 m wide, {_SHARE}", "", 1.0, "slip"),
    "sideways": Kind(COURSE, f"0.5 m to the left, {_SHARE}", "", 1.0, "slip",
                     command="run mrl calibrate sideways --port PORT"),
    "square": Kind(COURSE, f"square of 0.5 m, {_SHARE}", "", 1.0, "slip"),
}  # fmt: skip


class Row(NamedTuple):
    """One measured row.  `measure.json` holds these fields, and the verdict."""

    key: str
    value: Optional[float]  # None: not measured
    expected: float = 0.0  # the emulated value, or what the model and the line say
    number: int = 1  # values that it is made of
    p99: Optional[float] = None
    note: str = ""
    emulated: Optional[float] = None
    cause: str = ""  # if it is not that of the kind
    allowed: Optional[float] = None  # if the tolerance is not that of the kind
    command: str = ""  # mends the cause, if it is not that of the kind

    @property
    def kind(self) -> Kind:
        """The row's kind."""
        return KINDS[self.key]

    @property
    def tolerance(self) -> float:
        """Deviation from what is expected that a sound board may have, in the row's unit."""
        return self.kind.tolerance if self.allowed is None else self.allowed

    @property
    def verdict(self) -> str:
        """One of the words above."""
        if self.value is None:
            return ABSENT
        if self.tolerance == float("inf"):
            return REPORTED
        worse = (self.value - self.expected) * (-1 if self.kind.more_is_better else 1)
        return BETTER if worse < -self.tolerance else AGREES if worse <= self.tolerance else WORSE  # also NaN

    @property
    def likely(self) -> str:
        """The code of the likely cause; empty unless the row is worse."""
        return (self.cause or self.kind.cause) if self.verdict == WORSE else ""

    def as_json(self) -> Dict[str, Any]:
        """The row for a file, with all that a reader needs."""
        kind = self.kind
        by = None if self.value is None else self.value - self.expected
        about = {"section": kind.section, "text": kind.text, "unit": kind.unit}
        end = {"tolerance": self.tolerance, "verdict": self.verdict, "by": by, "cause": self.likely}
        return {"key": self.key, **about, **self._asdict(), **end}


_HBRIDGE, _VIRTUAL = "_hbridge", "_virtual"
_ALLOWED_VIRTUAL = {"stream_jitter_us": 600.0}
"""A pass of a virtual board takes up to 0.3 ms, which either end of a gap may have to wait for."""


@lru_cache(maxsize=None)
def emulated() -> Dict[str, float]:
    """The figures of emulated boards that rows are compared with; `make figures` renders them from docs/figures."""
    path = pathlib.Path(__file__).with_name("emulated.json")
    found: Dict[str, float] = json.loads(path.read_text(encoding="utf-8"))
    return found


def keys_of(*sections: str) -> List[str]:
    """Return the keys of all rows of these sections."""
    return [key for key, kind in KINDS.items() if kind.section in sections]


def absent(key: str, why: str) -> Row:
    """Return a row that was not measured."""
    return Row(key, None, note=why)


def failed(key: str, why: str, cause: str = "") -> Row:
    """Return the row of a figure that the board or the robot did not reach."""
    return Row(key, -math.inf if KINDS[key].more_is_better else math.inf, note=why, cause=cause)


def compared(row: Row, kind: str) -> Row:
    """Return the row with the emulated figure of this `kind_of` board as what is expected, if there is one."""
    figure = row.kind.figure
    if kind == _VIRTUAL:
        kind, row = _HBRIDGE, row._replace(allowed=_ALLOWED_VIRTUAL.get(row.key, row.allowed))
    found = emulated().get(figure + kind, emulated().get(figure))
    return row if found is None else row._replace(emulated=found, expected=found)


def kind_of(board: Board) -> str:
    """Return the end of the names of figures that are of another kind of board than one with an OMNI-3MD.

    Those of a virtual board are those of an H-bridge.
    """
    driven = _HBRIDGE if "bridge" in board.capabilities else ""
    return "_2013" if board.protocol < 2 else _VIRTUAL if board.virtual else driven


# -- causes

_ORDER = (
    *("late_host", "bad_cable", "usb_latency", "slow_line", "board_stalled", "slow_telemetry"),
    *("battery_off", "battery_empty", "no_watchdog"),
    *("wheels_powerless", "wheel_blocked", "encoder_dead", "wheel_reversed", "wheel_dead"),
    *("wheel_slow", "wheel_ratio", "wheel_size", "track_width", "slip"),
)
"""Causes that explain others come first: a busy computer delays answers, and damage costs frames, or without checksums
makes counts jump."""
_FOLLOWS = {
    "late_host": {
        *("usb_latency", "slow_line", "slow_telemetry", "requests_late"),
        *("no_telemetry", "board_timeout", "command_timeout"),
    },
    "bad_cable": {"slow_telemetry", "requests_late", "board_timeout", "encoder_noise"},
    "usb_latency": {"requests_late"},
    "wheel_ratio": {"wheel_size", "track_width", "slip"},
    "wheel_size": {"track_width", "slip"},
    "track_width": {"slip"},
}


class Cause(NamedTuple):
    """A likely cause, and the rows that it makes worse."""

    code: str
    rows: Tuple[str, ...]
    remedy: str


def causes(rows: Iterable[Row]) -> List[Cause]:
    """Return the likely causes of the rows that are worse, the first one first; those that follow are left out."""
    found: Dict[str, List[Row]] = {}
    for row in rows:
        if row.likely:
            found.setdefault(row.likely, []).append(row)
    follow = {each for code in found for each in _FOLLOWS.get(code, ())}
    ordered = sorted(found, key=lambda code: _ORDER.index(code) if code in _ORDER else len(_ORDER))
    return [_cause(code, found[code]) for code in ordered if code not in follow]


def _cause(code: str, rows: Sequence[Row]) -> Cause:
    own = (row.command or (row.kind.command if code == row.kind.cause else "") for row in rows)
    return Cause(code, tuple(row.key for row in rows), next(filter(None, own), PROBLEMS[code].remedy))
