"""Finds swapped or reversed wires: one motor at a time is driven forward, and the motion and the counts are checked."""

from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

LEFT, RIGHT = "left", "right"
OTHER = {LEFT: RIGHT, RIGHT: LEFT}
LEAST_COUNTS = 50  # less than this counts as standing still [count]; 4 mm on a TraxBot

LEAST_M, LEAST_RAD = 0.003, 0.02
"""Less than this counts as standing still, for a robot with a known true pose."""


class Trial(NamedTuple):
    """A trial in which one motor was driven forward.

    `seen` is the wheel that was seen to turn (None: not observed).  `direction` is +1 forward, -1 backward, and 0 if no
    wheel turned.
    """

    motor: str
    right: int
    left: int
    seen: Optional[str] = None
    direction: int = 0


def diagnose(trials: Sequence[Trial]) -> List[str]:
    """The faults, one line each with the remedy; empty if the wiring is correct."""
    found: List[str] = []
    for trial in trials:
        found += _motor(trial) + _encoder(trial)
    return _together(found, trials)


def seen_in(x_m: float, yaw_rad: float) -> Tuple[Optional[str], int]:
    """Wheel and direction that explain this motion, if one wheel turned; for robots with a known true pose."""
    if abs(x_m) < LEAST_M and abs(yaw_rad) < LEAST_RAD:
        return LEFT, 0
    direction = 1 if x_m > 0 else -1
    return (RIGHT if yaw_rad * direction > 0 else LEFT), direction


def _motor(trial: Trial) -> List[str]:
    """Faults of the motor's own wires; none if the wheels were not observed."""
    if trial.seen is None:
        return []
    if trial.direction == 0:
        return [f"{trial.motor} motor does not turn: check its plug and the motor power"]
    if trial.seen != trial.motor:
        return ["motors swapped: exchange the plugs of motor 1 and motor 3"]
    if trial.direction < 0:
        return [f"{trial.motor} motor runs backward: swap its two wires"]
    return []


def _encoder(trial: Trial) -> List[str]:
    """Faults of the encoder of the wheel that turned."""
    wheel, direction = trial.seen or trial.motor, trial.direction or 1
    if trial.seen is not None and trial.direction == 0:
        return []
    counts: Dict[str, int] = {LEFT: trial.left, RIGHT: trial.right}
    own, other = counts[wheel], counts[OTHER[wheel]]
    if abs(own) < LEAST_COUNTS and abs(other) < LEAST_COUNTS:
        return [f"{wheel} encoder does not count: check its plug"]
    who = "" if trial.seen else " or motors"
    if abs(own) < LEAST_COUNTS:
        backward = other * direction < 0
        also = [f"{wheel} encoder{who} reversed: swap its two signal wires"] if backward else []
        return [f"encoders{who} swapped: exchange the plugs of encoder 1 and encoder 3"] + also
    if own * direction < 0:
        return [f"{wheel} encoder{who} reversed: swap its two signal wires"]
    return []


def _together(found: List[str], trials: Sequence[Trial]) -> List[str]:
    """Each finding once; two wheels that do not move are one finding."""
    still = [trial for trial in trials if max(abs(trial.right), abs(trial.left)) < LEAST_COUNTS]
    if len(still) == len(trials) > 1 and all(trial.seen is None or trial.direction == 0 for trial in trials):
        return ["no wheel moved and no encoder counted: check the motor power and the motor board's plugs"]
    return list(dict.fromkeys(found))
