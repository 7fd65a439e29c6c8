"""The table of faults, one row each, and the parser of their command line form: `loss:rate=0.001,burst=3`."""

import math
from typing import Any, Callable, Dict, NamedTuple, Optional, Tuple, Union

from mrl_driver.errors import ConfigError

from . import datagrams, line_faults
from .schedule import LineFault

FOREVER_S = 1e9
TO_BOARD, TO_HOST, BOTH = "to_board", "to_host", "both"


class FaultParameter(NamedTuple):
    """A parameter of a fault: a number, or text if `low` is None."""

    name: str
    default: Union[float, str]
    low: Optional[float]
    high: float
    unit: str
    text: str


class FaultKind(NamedTuple):
    """A kind of fault; `make` of a fault of the serial link is called with a random generator and the parameters."""

    name: str
    text: str
    parameters: Tuple[FaultParameter, ...] = ()
    make: Optional[Callable[..., LineFault]] = None
    at_s: float = 0.0
    lasts_s: float = FOREVER_S


class Fault(NamedTuple):
    """A fault to inject."""

    kind: FaultKind
    values: Dict[str, Union[float, str]]
    direction: str
    window: Tuple[float, float, float]


def _rate(text: str) -> Tuple[FaultParameter, ...]:
    return (FaultParameter("rate", 0.001, 0.0, 1.0, "", text),)


def _junk(bytes_per_s: float) -> Tuple[FaultParameter, ...]:
    return (FaultParameter("rate", bytes_per_s, 0.1, 100000.0, "byte/s", "bytes per second"),)


_TEXT = "[INFO] the wheel e turned, @13e and @6,1,2e are not frames here"
_KINDS = (
    FaultKind(
        "loss",
        "bytes are lost",
        (
            *_rate("share of bytes at which a loss begins"),
            FaultParameter("burst", 1, 1, 1024, "byte", "bytes lost in a row"),
        ),
        line_faults.Loss,
    ),
    FaultKind("flip", "one bit of a byte is flipped", _rate("share of bytes"), line_faults.Flip),
    FaultKind("change", "a byte is replaced by another one", _rate("share of bytes"), line_faults.Change),
    FaultKind("swap", "a byte and the next one are exchanged", _rate("share of bytes"), line_faults.Swap),
    FaultKind("drop", "a whole frame is lost, as a datagram is", _rate("share of frames"), datagrams.Drop),
    FaultKind("repeat", "a frame arrives twice", _rate("share of frames"), datagrams.Repeat),
    FaultKind(
        "overtake",
        "a frame arrives after later ones",
        (*_rate("share of frames"), FaultParameter("delay", 0.05, 0.0, 60.0, "s", "longest delay")),
        datagrams.Overtake,
    ),
    FaultKind(
        "delay",
        "bytes arrive late, in their order",
        (
            FaultParameter("delay", 0.0, 0.0, 60.0, "s", "delay of every piece"),
            FaultParameter("jitter", 0.016, 0.0, 60.0, "s", "largest random addition"),
        ),
        line_faults.Delay,
    ),
    FaultKind(
        "split",
        "bytes arrive in small pieces",
        (
            FaultParameter("size", 3, 1, 1024, "byte", "largest size of a piece"),
            FaultParameter("gap", 0.003, 0.0, 1.0, "s", "time between pieces"),
        ),
        line_faults.Split,
    ),
    FaultKind("stall", "all bytes are held back, then delivered at once", (), line_faults.Hold, 1.0, 1.0),
    FaultKind("junk", "random bytes are inserted", _junk(20.0), line_faults.Junk),
    FaultKind("flood", "random bytes at the full rate of the serial link", _junk(11520.0), line_faults.Junk),
    FaultKind(
        "text",
        "lines of text are inserted, as 2013 boards send them",
        (
            FaultParameter("period", 1.0, 0.001, 3600.0, "s", "time between lines"),
            FaultParameter("text", _TEXT, None, 0.0, "", "the text, without commas"),
        ),
        line_faults.Text,
    ),
    FaultKind(
        "baud",
        "the host's port has another baud rate than the board",
        (FaultParameter("rate", 57600, 300, 1000000, "Bd", "rate of the host's port"),),
        line_faults.Baud,
    ),
    FaultKind("unplug", "the port disappears, and returns with another name", (), None, 1.0, 1.0),
    FaultKind("freeze", "the board stops running, its motor board does not", (), None, 1.0, 1.0),
    FaultKind("reset", "the board is reset", (), None, 1.0, 0.01),
)
FAULTS: Dict[str, FaultKind] = {kind.name: kind for kind in _KINDS}
_SHARED = (
    FaultParameter("at", 0.0, 0.0, FOREVER_S, "s", "start"),
    FaultParameter("lasts", FOREVER_S, 0.001, FOREVER_S, "s", "duration"),
    FaultParameter("every", 0.0, 0.001, FOREVER_S, "s", "repeat after this time; default: once"),
)


def usage() -> str:
    """All faults with their parameters, one per line, as `mrl-sim --help` prints them."""
    lines = []
    for kind in FAULTS.values():
        lines.append(f"{kind.name}: {kind.text}")
        lines += [f"    {p.name}={_show(p.default)}  {p.text}{_unit(p)}" for p in kind.parameters]
    lines.append(
        "All faults take at (start), lasts (duration) and every (repeat after) [s].\n"
        "Faults of the serial link take direction=both, to_board or to_host."
    )
    return "\n".join(lines)


def _unit(parameter: FaultParameter) -> str:
    return f" [{parameter.unit}]" if parameter.unit else ""


def _show(value: Union[float, str]) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def parse(spec: str) -> Fault:
    """The fault in `name:key=value,key=value`; absent keys have their defaults.

    Raises:
        ConfigError: fault or key is unknown, or a value is out of its range.
    """
    name, _, rest = spec.partition(":")
    kind = FAULTS.get(name.strip())
    if kind is None:
        raise ConfigError(f"fault {name!r} is unknown, expected {', '.join(FAULTS)}")
    shared = (_SHARED[0]._replace(default=kind.at_s), _SHARED[1]._replace(default=kind.lasts_s), _SHARED[2])
    known = {p.name: p for p in (*kind.parameters, *shared)}
    values: Dict[str, Any] = {p.name: p.default for p in known.values()}
    direction = BOTH
    for part in filter(None, rest.split(",")):
        key, _, text = part.partition("=")
        if key == "direction" and kind.make:
            direction = _direction(spec, text)
        elif key in known:
            values[key] = _value(spec, known[key], text)
        else:
            expected = ", ".join([*known, *(["direction"] if kind.make else [])])
            raise ConfigError(f"fault {spec!r}: key {key!r} is unknown, expected {expected}")
    window = values.pop("at"), values.pop("lasts"), values.pop("every")
    return Fault(kind, values, direction, window)


def _direction(spec: str, text: str) -> str:
    if text not in (BOTH, TO_BOARD, TO_HOST):
        raise ConfigError(f"fault {spec!r}: direction is {text!r}, expected {BOTH}, {TO_BOARD} or {TO_HOST}")
    return text


def _value(spec: str, parameter: FaultParameter, text: str) -> Union[float, str]:
    if parameter.low is None:
        return text
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    whole = isinstance(parameter.default, int)
    if not parameter.low <= value <= parameter.high or (whole and value % 1.0):
        raise ConfigError(
            f"fault {spec!r}: {parameter.name} is {text!r}, expected {'a whole number, ' if whole else ''}"
            f"{parameter.low:g} to {parameter.high:g} {parameter.unit}".rstrip()
        )
    return value
