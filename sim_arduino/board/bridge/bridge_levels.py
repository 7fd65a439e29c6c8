"""The firmware's truth table of the bridge chips: a drive as levels of its three pins."""

from typing import NamedTuple

LOW, HIGH = 0, 255


class Levels(NamedTuple):
    """Levels of a motor's pins: 0 is low, 255 is high, and all between is the duty of a PWM output."""

    pwm_a: int
    pwm_b: int
    logic: int


_OFF = Levels(LOW, LOW, LOW)
_FAST_PWM = ("vnh5019", "cytron", "bts7960")


def levels(chip: str, backward: bool, duty: int, coast: bool) -> Levels:
    """A drive with a duty of 0 to 255; 0 brakes, or lets the motor coast if the chip can."""
    if chip in ("vnh5019", "tb6612"):
        return _with_two_inputs(chip, backward, duty, coast)
    if chip == "l298n":
        return _with_enable(backward, duty, coast)
    if chip == "cytron":
        return Levels(duty, LOW, HIGH if backward else LOW)
    if chip in ("drv8833", "bts7960"):
        return _with_pwm_on_both(chip, backward, duty, coast)
    return _OFF


def _with_two_inputs(chip: str, backward: bool, duty: int, coast: bool) -> Levels:
    if duty:
        return Levels(duty, LOW, HIGH) if backward else Levels(duty, HIGH, LOW)
    if not coast:
        return Levels(HIGH, HIGH, HIGH)
    return Levels(HIGH if chip == "tb6612" else LOW, LOW, LOW)


def _with_enable(backward: bool, duty: int, coast: bool) -> Levels:
    """PWM is on IN1: the motor brakes between the pulses, so that its speed is proportional to the duty."""
    if not duty and coast:
        return _OFF
    if backward:
        return Levels(HIGH, HIGH - duty, HIGH)
    return Levels(HIGH, duty, LOW) if duty else Levels(HIGH, HIGH, HIGH)


def _with_pwm_on_both(chip: str, backward: bool, duty: int, coast: bool) -> Levels:
    """The motor brakes while both inputs are high, so that its speed is proportional to the duty."""
    if not duty and coast and chip == "drv8833":
        return _OFF
    rest = HIGH - duty
    return Levels(rest, HIGH, LOW) if backward else Levels(HIGH, rest, LOW)


def share(chip: str, level: int) -> float:
    """Share of time for which a pin with this level is high; fast PWM has 256 steps, phase-correct PWM 255."""
    steps = HIGH + 1 if chip in _FAST_PWM and level < HIGH else HIGH
    return level / steps
