"""Finds how motors and encoders are wired to an H-bridge board, as the sum that its parameter `wiring` stores.  Pure.

One motor output after the other was driven forward alone, while the board corrected nothing.  Which wheel turned, and
in which direction, must have been seen: the encoders alone cannot tell swapped motors and encoders from none.
"""

from typing import Dict, List, Sequence

from mrl_driver.errors import WheelFault
from mrl_driver.protocol.table import WIRING

from .wiring_check import LEFT, OTHER, RIGHT, Trial

BITS: Dict[str, int] = {name: 1 << place for place, (name, _) in enumerate(WIRING)}
SET, SINGLE_CHANNEL = BITS["set"], BITS["single_channel"]
LEAST_TURN = 0.01  # less than this share of a wheel turn counts as standing still
OTHER_SHARE = 0.3
"""While one wheel turns, the encoder of the other may count this share: vibration moves it by a count or two."""
_PINS = {LEFT: "D2 and D4", RIGHT: "D8 and D10"}


def wiring_of(trials: Sequence[Trial], counts_per_turn: float, single_channel: bool = False) -> int:
    """Return the sum to store, from one trial of each motor output, of the left one first.

    Args:
        trials: `seen` and `direction` are set; the counters are those of the encoder inputs.
        counts_per_turn: encoder counts of a wheel turn.
        single_channel: the encoders have one channel; then they cannot count backward.

    Raises:
        WheelFault: a wheel or an encoder did not do its part; the error says what to check.
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
        backward = _counts(trial)[counted] * trial.direction < 0
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
    size = {name: abs(count) for name, count in _counts(trial).items()}
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


def _counts(trial: Trial) -> Dict[str, int]:
    return {LEFT: trial.left, RIGHT: trial.right}
