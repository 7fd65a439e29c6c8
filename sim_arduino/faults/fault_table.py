"""The table of faults, one row each, and the parser of their command line form: `loss:rate=0.001,burst=3`."""

from typing import Any, Callable, Dict, NamedTuple, Optional, Tuple, Union

from mrl_driver.errors import ConfigError
from mrl_driver.robot.sonar import NAMES as SONARS
from mrl_driver.yaml_file import short
from sim_arduino.hardware import sonars

from . import datagrams, hardware_faults, line_faults
from .key_values import Key, check_value
from .schedule import LineFault

FOREVER_S = 1e9
TO_BOARD, TO_HOST, BOTH = "to_board", "to_host", "both"


class FaultKind(NamedTuple):
    """A kind of fault.

    `make` of a fault of the serial link is called with a random generator and the parameters.  `switch` of a fault of
    the hardware is called with the plant, whether the fault is on, and the parameters; it needs the hardware `needs`:
    "motors", "omni3md", "bridge", "imu", "sonars", "radio", or "" for that of all robots.
    """

    name: str
    text: str
    parameters: Tuple[Key, ...] = ()
    make: Optional[Callable[..., LineFault]] = None
    at_s: float = 0.0
    lasts_s: float = FOREVER_S
    switch: Optional[Callable[..., None]] = None
    needs: str = ""


class Fault(NamedTuple):
    """A fault to inject."""

    kind: FaultKind
    values: Dict[str, Union[float, str]]
    direction: str
    window: Tuple[float, float, float]


def _rate(text: str) -> Tuple[Key, ...]:
    return (Key("rate", 0.001, 0.0, 1.0, text),)


def _junk(bytes_per_s: float) -> Tuple[Key, ...]:
    return (Key("rate", bytes_per_s, 0.1, 100000.0, "bytes per second", "byte/s"),)


_WHEEL = Key("wheel", "left", None, 0.0, "left or right", choices=hardware_faults.WHEELS)
_CHANNEL = Key("channel", "a", None, 0.0, "channel of the encoder, a or b", choices=hardware_faults.CHANNELS)


def _wheel(
    name: str, text: str, switch: Callable[..., None], *parameters: Key, needs: str = "motors"
) -> FaultKind:
    """A fault of one wheel, its motor or its encoder."""
    return FaultKind(name, text, (_WHEEL, *parameters), switch=switch, needs=needs)


def _imu(name: str, text: str, switch: Callable[..., None], *parameters: Key) -> FaultKind:
    """A fault of the IMU."""
    return FaultKind(name, text, parameters, switch=switch, needs="imu")


_TEXT = "[INFO] the wheel e turned, @13e and @6,1,2e are not frames here"
_KINDS = (
    FaultKind(
        "loss",
        "bytes are lost",
        (
            *_rate("share of bytes at which a loss begins"),
            Key("burst", 1, 1, 1024, "bytes lost in a row", "byte"),
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
        (*_rate("share of frames"), Key("delay", 0.05, 0.0, 60.0, "longest delay", "s")),
        datagrams.Overtake,
    ),
    FaultKind(
        "delay",
        "bytes arrive late, in their order",
        (
            Key("delay", 0.0, 0.0, 60.0, "delay of every piece", "s"),
            Key("jitter", 0.016, 0.0, 60.0, "largest random addition", "s"),
        ),
        line_faults.Delay,
    ),
    FaultKind(
        "split",
        "bytes arrive in small pieces",
        (
            Key("size", 3, 1, 1024, "largest size of a piece", "byte"),
            Key("gap", 0.003, 0.0, 1.0, "time between pieces", "s"),
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
            Key("period", 1.0, 0.001, 3600.0, "time between lines", "s"),
            Key("text", _TEXT, None, 0.0, "the text, without commas"),
        ),
        line_faults.Text,
    ),
    FaultKind(
        "baud",
        "the host's port has another baud rate than the board",
        (Key("rate", 57600, 300, 1000000, "rate of the host's port", "Bd"),),
        line_faults.Baud,
    ),
    FaultKind("unplug", "the port disappears, and returns with another name", (), None, 1.0, 1.0),
    FaultKind("freeze", "the board stops running, its motor board does not", (), None, 1.0, 1.0),
    FaultKind("reset", "the board is reset", (), None, 1.0, 0.01),
    FaultKind("brown_out", "the board is reset, because its supply voltage dropped", (), None, 1.0, 0.01),
    FaultKind(
        "battery_sag",
        "the battery's voltage drops",
        (Key("volts", 3.0, 0.0, 15.0, "voltage lost", "V"),),
        switch=hardware_faults.battery_sag,
    ),
    _wheel("encoder_open", "a wire of an encoder is broken", hardware_faults.encoder_open, _CHANNEL),
    _wheel(
        "encoder_oscillation",
        "a broken wire of an encoder picks up the pulses of the motor",
        hardware_faults.encoder_oscillation,
        _CHANNEL,
        Key("rate", 62500.0, 1.0, 1e6, "edges per second: two for each pulse", "1/s"),
        needs="bridge",
    ),
    _wheel(
        "encoder_swapped", "channels A and B of an encoder are exchanged", hardware_faults.encoder_swapped
    ),
    _wheel(
        "encoder_bounce",
        "short pulses follow each edge of an encoder",
        hardware_faults.encoder_bounce,
        Key("pulses", 1, 1, 100, "number of pulses"),
        Key("spacing", 20e-6, 1e-6, 0.01, "time between their edges", "s"),
        needs="bridge",
    ),
    _wheel("wheel_blocked", "something holds a wheel", hardware_faults.wheel_blocked),
    _wheel(
        "wheel_slips",
        "a wheel turns further than it moves the robot",
        hardware_faults.wheel_slips,
        Key("grip", 0.5, 0.0, 1.0, "share of its distance that moves the robot"),
    ),
    _wheel(
        "motor_reversed",
        "the wires of a motor are exchanged",
        hardware_faults.motor_reversed,
        needs="omni3md",
    ),
    FaultKind(
        "motor_board_absent",
        "the motor board does not answer",
        switch=hardware_faults.motor_board_absent,
        needs="omni3md",
    ),
    FaultKind(
        "sonar_failed",
        "a sonar gives no reading, or always the same one",
        (
            Key("sonar", "front", None, 0.0, "front, left or right", choices=SONARS),
            Key(
                "state",
                sonars.DEAD,
                None,
                0.0,
                "dead: no reading; stuck: always the same one; deaf: nothing in range",
                choices=sonars.STATES,
            ),
        ),
        switch=hardware_faults.sonar_failed,
        needs="sonars",
    ),
    _imu("imu_absent", "the IMU does not answer", hardware_faults.imu_absent),
    _imu("imu_power", "the IMU has no power, and comes back asleep", hardware_faults.imu_power),
    _imu("imu_frozen", "the IMU's readings do not change", hardware_faults.imu_frozen),
    _imu(
        "imu_other",
        "another chip is at the IMU's address",
        hardware_faults.imu_other,
        Key("identity", 0x12, 0, 255, "its WHO_AM_I"),
    ),
    FaultKind(
        "radio_cut",
        "the radio neither sends nor receives",
        switch=hardware_faults.radio_cut,
        needs="radio",
    ),
)
FAULTS: Dict[str, FaultKind] = {kind.name: kind for kind in _KINDS}
_SHARED = (
    Key("at", 0.0, 0.0, FOREVER_S, "start", "s"),
    Key("lasts", FOREVER_S, 0.001, FOREVER_S, "duration", "s"),
    Key("every", 0.0, 0.001, FOREVER_S, "repeat after this time; default: once", "s"),
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


def _unit(parameter: Key) -> str:
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
        raise ConfigError(f"fault {short(name)} is unknown, expected {', '.join(FAULTS)}")
    shared = (_SHARED[0]._replace(default=kind.at_s), _SHARED[1]._replace(default=kind.lasts_s), _SHARED[2])
    known = {p.name: p for p in (*kind.parameters, *shared)}
    values: Dict[str, Any] = {p.name: p.default for p in known.values()}
    direction = BOTH
    for part in filter(None, rest.split(",")):
        key, _, text = part.partition("=")
        if key == "direction" and kind.make:
            direction = _direction(spec, text)
        elif key in known:
            values[key] = check_value(f"fault {short(spec)}", known[key], text)
        else:
            expected = ", ".join([*known, *(["direction"] if kind.make else [])])
            raise ConfigError(f"fault {short(spec)}: key {short(key)} is unknown, expected {expected}")
    window = values.pop("at"), values.pop("lasts"), values.pop("every")
    return Fault(kind, values, direction, window)


def _direction(spec: str, text: str) -> str:
    if text not in (BOTH, TO_BOARD, TO_HOST):
        raise ConfigError(
            f"fault {short(spec)}: direction is {short(text)}, expected {BOTH}, {TO_BOARD} or {TO_HOST}"
        )
    return text
