"""Finds swapped or reversed wires, without I/O: each motor alone is driven forward, and motion and counts are checked.

With a motor board, the result is the faults.  With an H-bridge board, it is the sum that its parameter `wiring` stores.
Then the board corrected nothing meanwhile, and it must have been seen which wheel turned, and in which direction: the
encoders alone cannot tell swapped motors and encoders from none.
"""

from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import WheelFault
from mrl_driver.protocol.table import WHEELS, WIRING
from mrl_driver.robot.wiring import ENCODERS, OUTPUTS

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


class Trial(NamedTuple):
    """A trial in which one motor was driven forward.

    `counts` are those by encoder.  `seen` is the wheel that was seen to turn (None: not observed).  `direction` is +1
    forward, -1 backward, and 0 if no wheel turned.
    """

    motor: str
    counts: Mapping[str, int]
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
    still = [trial for trial in trials if max(map(abs, trial.counts.values())) < LEAST_COUNTS]
    if len(still) == len(trials) > 1 and all(trial.seen is None or trial.direction == 0 for trial in trials):
        return ["no wheel moved and no encoder counted: check the motor power and the motor board's plugs"]
    return list(dict.fromkeys(found))


# -- H-bridge boards


def wiring_of(
    places: Mapping[str, str], trials: Sequence[Trial], counts_per_turn: float, single_channel: bool = False
) -> int:
    """Return the sum to store, from one trial of each motor output, of the left one first.

    `places` are the pins of each encoder input, in words.  The trials have `seen` and `direction`, and the counters of
    the encoder inputs; `counts_per_turn` is 0 without encoders.  Encoders with a `single_channel` cannot count
    backward.  WheelFault, which says what to check, if a wheel or an encoder did not do its part.
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
            f"{places[inputs[0]]}"
        )
    wiring = SET | (SINGLE_CHANNEL if single_channel else 0)
    for trial, counted in zip(trials, inputs):
        wiring |= BITS["motors_swapped"] * (trial.seen != trial.motor)
        wiring |= BITS["encoders_swapped"] * (trial.seen != counted)
        wiring |= _reversed(trial, counted, single_channel)
    return wiring


def _reversed(trial: Trial, counted: str, single_channel: bool) -> int:
    """Return the bits of a motor and an encoder that run backward."""
    motor = BITS[f"{trial.seen}_motor_reversed"] * (trial.direction < 0)
    backward = trial.counts[counted] * trial.direction < 0
    return motor | BITS[f"{trial.seen}_encoder_reversed"] * (backward and not single_channel)


def in_words(wiring: int) -> List[str]:
    """Return what differs from the wiring in the robot's file, such as `motors swapped`; empty if nothing does."""
    return [name.replace("_", " ") for name, bit in BITS.items() if wiring & bit and bit != SET]


def _input_of(trial: Trial, counts_per_turn: float) -> str:
    """Return the encoder input that counted the wheel that turned; without encoders, that of the wheel."""
    wheel = str(trial.seen)
    if not counts_per_turn:
        return wheel
    sizes = {name: abs(count) for name, count in trial.counts.items()}
    listed = ", ".join(f"{words(name)} {count}" for name, count in trial.counts.items())
    *others, counted = sorted(sizes, key=lambda name: sizes[name])
    if sizes[counted] < max(1.0, counts_per_turn * LEAST_TURN):
        raise WheelFault(
            f"the {words(wheel)} wheel turned, but no encoder counted ({listed}): check their supply and channels A "
            "and B; if they have channel A only, give --single-channel"
        )
    if max(sizes[name] for name in others) > OTHER_SHARE * sizes[counted]:
        raise WheelFault(
            f"the {words(wheel)} wheel turned alone, but other encoders counted too ({listed}): check their wires, and "
            "keep them away from the motors' wires"
        )
    return counted


# -- four wheels


def parameters_of(
    pins: Mapping[str, int], trials: Sequence[Trial], counts_per_turn: float, single_channel: bool = False
) -> Dict[str, int]:
    """Return the wiring to store: parameter 20, and the pins, exchanged where wheels are.

    The board knows `pins`, and corrects nothing; the rest is as in `wiring_of`.
    """
    outputs = {str(trial.seen): trial.motor for trial in trials}
    inputs = {str(trial.seen): _input_of(trial, counts_per_turn) for trial in trials}
    for part, places in (("motor outputs turned", outputs), ("encoder inputs counted", inputs)):
        if len(set(places)) < len(WHEELS) or len(set(places.values())) < len(WHEELS):
            raise WheelFault(f"two {part} the same wheel, expected one wheel each: check their wires")
    sums = SET | (SINGLE_CHANNEL if single_channel else 0)
    for trial in trials:
        sums |= _reversed(trial, inputs[str(trial.seen)], single_channel)
    moved = {
        names[place]: pins[rows[WHEELS.index(places[wheel])][place]]
        for rows, places in ((OUTPUTS, outputs), (ENCODERS, inputs))
        for wheel, names in zip(WHEELS, rows)
        for place in range(len(names))
    }
    return {"wiring": sums, **moved}


def require_right_turn(counts: Mapping[str, int], counts_per_turn: float) -> None:
    """Raise WheelFault unless the counters of the wheels fit a slow turn to the right."""
    least = counts_per_turn * LEAST_TURN
    for name, count in counts.items():
        if (-count if RIGHT in name else count) < least:
            raise WheelFault(
                f"the wiring that was found does not hold: in a slow turn to the right the {words(name)} encoder "
                f"counted {count}, expected {'less than -' if RIGHT in name else 'more than '}{least:.0f}; check for "
                "loose wires, and run mrl calibrate wiring again"
            )


def words(name: str) -> str:
    """Return the name of a wheel in words, such as `rear left`."""
    return name.replace("_", " ")
