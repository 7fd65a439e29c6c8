"""Compares the parameters of a board with the robot's model: what differs, what it causes, and what to do."""

import math
from typing import Iterator, List, Mapping, Tuple

from mrl_driver.driver.parameters import CABLES, SMALL, curve_share, curve_texts
from mrl_driver.driver.parameters import differing as differing_values
from mrl_driver.protocol.table import BRIDGES, PARAMETER_BY_NAME
from mrl_driver.robot.models import CURVE_KEYS, Drive, RobotModel
from mrl_driver.robot.wiring import NAMES, short

from .findings import FAULT, NOTE, WARNING, Finding, note, ok, problem, warning

LARGE = 0.1  # beyond this share, what is a warning beyond `SMALL` is a fault; assumed
CALIBRATED = 0.1
"""Share by which a calibration may move the geometry of odometry away from the board's.  Assumed: tyres give way by a
few percent, and a wheel separation was measured to the middle of tyres of a tenth of its width."""
_COUNTS = ("gearbox", "encoder_counts")
_RESTS = {
    **dict.fromkeys((*_COUNTS, "wheel_radius"), "metres_per_count"),
    "axis_radius": "wheel_separation_m",
}
"""Parameters of the geometry, and the key of odometry that rests on the same measure."""
_CEILINGS = {"linear_ceiling": ("linear_m_s", "m/s"), "angular_ceiling": ("angular_rad_s", "rad/s")}


def check(values: Mapping[str, int], model: RobotModel) -> Iterator[Finding]:
    """Compare parameters in force, by name, with those of a model with motors."""
    differing = differing_values(values, model)
    named = [name for name in differing if name in model.board and name not in CURVE_KEYS]
    found = [_finding(name, values, model) for name in named]
    if any(name in differing for name in CURVE_KEYS):
        share = curve_share(values, model)
        found.append(problem(_level(share), "parameters", "sonars", *curve_texts(share, model)))
    if values.get("bridge") and isinstance(model.drive, Drive) and not set(_RESTS) & set(named):
        found += _odometry(values, model)
    yield from found or [ok("parameters", f"as in the model {model.name}")]
    alone = [name for name in differing if name not in (*named, *CURVE_KEYS)]
    if alone:
        listed = ", ".join(f"{name} {values[name]}" for name in alone)
        text = f"set on this board, but not in the model {model.name}: {listed}"
        yield note("parameters", "parameters", text, "keep them in a file: mrl config dump FILE --port PORT")


def _finding(name: str, values: Mapping[str, int], model: RobotModel) -> Finding:
    if name in _RESTS:
        level, effect = _geometry(name, values, model)
    elif name in _CEILINGS:
        level, effect = _ceiling(name, values[name], model)
    elif name in CABLES:
        level, effect = FAULT, "wheels do not turn, turn backward, or count in the wrong direction"
    elif name == "battery_divider":
        share = values[name] / model.board[name] - 1 if model.board[name] else 0.0
        level, effect = WARNING, f"the battery reads {_percent(share, 'low', 'high')}"
    elif name == "undervoltage":
        level, effect = WARNING, f"the motors stop below {values[name] / 100:g} V"
    else:
        level, effect = NOTE, "the wheels follow a command in another way than with the model's value"
    unit = PARAMETER_BY_NAME[name].unit
    got, expected = (_spelled(name, value) for value in (values[name], model.board[name]))
    text = f"{got} on the board, {expected} in the model {model.name}" + (f" [{unit}]" if unit else "")
    section = f"wiring.{short(name)}" if name in NAMES else f"board.{name}"
    keys = section + (f" and drive.{_RESTS[name]}" if "odometry" in effect else "")
    right = f"if the model is right: mrl config set {name} {expected} --port PORT"
    advice = f"{right}; if the board is: correct {keys} in the robot's file"
    return problem(level, "parameters", name, f"{text}: {effect}", advice)


def _spelled(name: str, value: int) -> str:
    return BRIDGES[value] if name == "bridge" else str(value)


def _geometry(name: str, values: Mapping[str, int], model: RobotModel) -> Tuple[str, str]:
    """Return level and effect.  The board turns speeds into counts per second by its geometry."""
    share = values[name] / model.board[name]
    share = (1 / share if name == "wheel_radius" else share) - 1
    if not isinstance(model.drive, Drive):
        return NOTE, "the board applies its ceilings at other speeds"
    does, measures = ("turns", "turns") if name == "axis_radius" else ("drives", "distances")
    effect = f"the robot {does} {_percent(share, 'slower', 'faster')} than commanded"
    # the radii of a motor board are fitted, so they say nothing about the true ones
    if name in _COUNTS or values.get("bridge"):
        wrong = _percent(share, "too short", "too long")
        effect += f"; if the board is right, odometry gives {measures} {wrong}"
    return _level(share), effect


def _level(share: float) -> str:
    return FAULT if abs(share) > LARGE else WARNING if abs(share) > SMALL else NOTE


def _ceiling(name: str, value: int, model: RobotModel) -> Tuple[str, str]:
    limit, unit = _CEILINGS[name]
    most: float = getattr(model.limits, limit)
    if value / 1000 >= most:
        return NOTE, f"no effect: the driver commands at most {most:g} {unit}"
    board = f"the board drives at most {value / 1000:g} {unit}"
    return WARNING, f"the driver commands up to {most:g} {unit}, and {board}"


def _odometry(values: Mapping[str, int], model: RobotModel) -> List[Finding]:
    """Compare the geometry of a board with an H-bridge, which is the true one, with that of odometry."""
    drive = model.differential
    turn_counts = values["gearbox"] * values["encoder_counts"] / 100
    metres = 2 * math.pi * values["wheel_radius"] * 1e-5 / turn_counts
    separation_m = 2 * values["axis_radius"] * 1e-5
    rows = (
        ("metres_per_count", drive.metres_per_count / metres - 1, "drives", "straight"),
        ("wheel_separation_m", separation_m / drive.turning_separation_m - 1, "turns", "turn"),
    )
    return [
        warning(
            "parameters",
            "wheels",
            f"drive.{key} of the model {model.name} does not fit the board's geometry: the robot {does} "
            f"{_percent(share, 'slower', 'faster')} than commanded, or odometry is wrong by as much",
            f"measure it: mrl calibrate {procedure} --port PORT",
        )
        for key, share, does, procedure in rows
        if abs(share) > CALIBRATED
    ]


def _percent(share: float, less: str, more: str) -> str:
    return f"{abs(share) * 100:.3g} % {less if share < 0 else more}"
