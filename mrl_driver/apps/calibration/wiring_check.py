"""Finds swapped or reversed wires, without I/O: each motor alone is driven forward, and motion and counts are checked.

With a motor board, the result is the faults.  With an H-bridge board, it is the sum that its parameter `wiring` stores.
Then the board corrected nothing meanwhile, and it must have been seen which wheel turned, and in which direction: the
encoders alone cannot tell swapped motors and encoders from none.
"""

from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import WheelFault
from mrl_driver.protocol.table import WIRING

LEFT, RIGHT = "left", "right"
OTHER = {LEFT: RIGHT, RIGHT: LEFT}
LEAST_COUNTS = 50  # less than this counts as standing still [count]; 4 mm on a TraxBot

LEAST_M, LEAST_RAD = 0.003, 0.02
"""Less than this counts as standing still, for a robot with a known true pose."""
BITS: Dict[str, int] = {name: 1 << place for place, (name, _) in enumerate(WIRING)}
SET, SINGLE_CHANNEL = BITS["set"], BITS["single_channel"]
LEAST_TURN = 0.01  # less than this share of a wheel turn counts as standing still
OTHER_SHARE = 0.3
"""While one wheel turns, the encoder of the other may count this share: vibration moves it by a count or two."""
_PINS = {LEFT: "D2 and D4", RIGHT: "D8 and D10"}


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

    @property
    def counts(self) -> Dict[str, int]:
        """Counts by encoder."""
        return {LEFT: self.left, RIGHT: self.right}


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
    own, other = trial.counts[wheel], trial.counts[OTHER[wheel]]
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


# -- H-bridge boards


def wiring_of(trials: Sequence[Trial], counts_per_turn: float, single_channel: bool = False) -> int:
    """Return the sum to store, from one trial of each motor output, of the left one first.

    The trials have `seen` and `direction`, and the counters of the encoder inputs.  Encoders with a `single_channel`
    cannot count backward.  WheelFault, which says what to check, if a wheel or an encoder did not do its part.
    """
    if trials[0].seen == trials[1].seen:
        raise WheelFault(
            f"both motor outputs turned the {trials[0].seen} wheel, expected one wheel each: check the wires of the "
            "motors"
        )
    inputs = [_input_of(trial, counts_per_turn) for trial in trials]
    if inputs[0] == inputs[1]:
        raise WheelFault(
            f"the {inputs[0]} encoder input counted both wheels, expected one wheel each: check the encoders' wires on "
            f"{_PINS[inputs[0]]}"
        )
    wiring = SET | (SINGLE_CHANNEL if single_channel else 0)
    for trial, counted in zip(trials, inputs):
        wheel = str(trial.seen)
        wiring |= BITS["motors_swapped"] * (wheel != trial.motor)
        wiring |= BITS[f"{wheel}_motor_reversed"] * (trial.direction < 0)
        wiring |= BITS["encoders_swapped"] * (wheel != counted)
        backward = trial.counts[counted] * trial.direction < 0
        wiring |= BITS[f"{wheel}_encoder_reversed"] * (backward and not single_channel)
    return wiring


def require_proof(right: int, left: int, counts_per_turn: float) -> None:
    """Raise WheelFault unless the counters fit a slow turn to the right: left forward, right backward."""
    least = counts_per_turn * LEAST_TURN
    if left < least or right > -least:
        raise WheelFault(
            f"the wiring that was found does not hold: in a slow turn to the right the left encoder counted {left} and "
            f"the right one {right}, expected more than {least:.0f} and less than {-least:.0f}; check for loose wires, "
            "and run mrl calibrate wiring again"
        )


def in_words(wiring: int) -> List[str]:
    """Return what differs from the wiring in HARDWARE.md, such as `motors swapped`; empty if nothing does."""
    return [name.replace("_", " ") for name, bit in BITS.items() if wiring & bit and bit != SET]


def _input_of(trial: Trial, counts_per_turn: float) -> str:
    """Return the encoder input that counted the wheel that turned."""
    size = {name: abs(count) for name, count in trial.counts.items()}
    counted = LEFT if size[LEFT] > size[RIGHT] else RIGHT
    if size[counted] < max(1.0, counts_per_turn * LEAST_TURN):
        raise WheelFault(
            f"the {trial.seen} wheel turned, but no encoder counted (left {trial.left}, right {trial.right}): check "
            "their supply and channels A and B; if they have channel A only, give --single-channel"
        )
    if size[OTHER[counted]] > OTHER_SHARE * size[counted]:
        raise WheelFault(
            f"the {trial.seen} wheel turned alone, but both encoders counted (left {trial.left}, right {trial.right}): "
            "check their wires, and keep them away from the motors' wires"
        )
    return counted
