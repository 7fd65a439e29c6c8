"""An emulated servo: its angle by its pulses."""

import math

import pytest

from sim_arduino.hardware.servo import LIMP_S, SPEED_RAD_S, Servo

PERIOD_S = 0.02


def after_pulses(servo, length_us, seconds):
    """Gives pulses, and returns the time behind the last one [s]."""
    for number in range(round(seconds / PERIOD_S)):
        rise_s = number * PERIOD_S
        servo.changed(1, rise_s)
        servo.changed(0, rise_s + length_us * 1e-6)
    return seconds


@pytest.mark.parametrize(("length_us", "angle_deg"), [(1500, 0), (1000, -45), (2500, 90)])
def test_it_turns_to_the_angle_of_its_pulses(length_us, angle_deg):
    servo = Servo()
    end_s = after_pulses(servo, length_us, 1.0)
    assert math.degrees(servo.angle_rad(end_s)) == pytest.approx(angle_deg, abs=0.1)
    assert servo.pulse_us(end_s) == pytest.approx(length_us)


def test_it_turns_as_fast_as_it_can():
    servo = Servo()
    end_s = after_pulses(servo, 2500, 0.1)
    assert servo.angle_rad(end_s) == pytest.approx(SPEED_RAD_S * 0.1, rel=0.05)


def test_without_pulses_it_stays_where_it_is():
    servo = Servo()
    end_s = after_pulses(servo, 2500, 0.1)
    limp_rad = servo.angle_rad(end_s + LIMP_S)
    assert servo.pulse_us(end_s + LIMP_S) == 0 and servo.angle_rad(end_s + 1.0) == limp_rad
