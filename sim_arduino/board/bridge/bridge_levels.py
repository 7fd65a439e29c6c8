"""The firmware's truth table of the bridge chips: a drive as levels of its three pins."""

from functools import lru_cache
from typing import Dict, NamedTuple, Tuple

LOW, HIGH = 0, 255


class Levels(NamedTuple):
    """Levels of a motor's pins: 0 is low, 255 is high, and all between is the duty of a PWM output."""

    pwm_a: int
    pwm_b: int
    logic: int


_FAST_PWM = ("vnh5019", "cytron", "bts7960")
_PINS: Dict[str, Tuple[str, str, str, str]] = {
    "vnh5019": ("D10", "D01", "111", "000"),
    "tb6612": ("D10", "D01", "111", "100"),
    "l298n": ("1D0", "1R1", "111", "000"),
    "cytron": ("D00", "D01", "", ""),
    "drv8833": ("1R0", "R10", "110", "000"),
    "bts7960": ("1R0", "R10", "110", "110"),
}
"""Pins while a motor is driven forward, driven backward, brakes and coasts: low, high, duty D or the rest R to 255.

PWM is on pins where the motor brakes between the pulses if the chip can, so that its speed is proportional to the duty.
An empty entry stands for a drive with duty 0."""


@lru_cache(maxsize=None)
def levels(chip: str, backward: bool, duty: int, coast: bool) -> Levels:
    """A drive with a duty of 0 to 255; 0 brakes, or lets the motor coast if the chip can."""
    if chip not in _PINS:
        return Levels(LOW, LOW, LOW)
    ahead, back, brake, free = _PINS[chip]
    pins = back if backward else ahead
    if not duty:
        pins = (free if coast else brake) or pins
    return Levels(*({"0": LOW, "1": HIGH, "D": duty, "R": HIGH - duty}[pin] for pin in pins))


def share(chip: str, level: int) -> float:
    """Share of time for which a pin with this level is high; fast PWM has 256 steps, phase-correct PWM 255."""
    steps = HIGH + 1 if chip in _FAST_PWM and level < HIGH else HIGH
    return level / steps
