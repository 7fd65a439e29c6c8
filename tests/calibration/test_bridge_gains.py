"""Gains of H-bridge boards: the pure parts."""

import numpy as np
import pytest

from mrl_driver.calibration import bridge_gains
from mrl_driver.calibration.bridge_gains import BridgeGains, DutyStep, MotorFit
from mrl_driver.errors import ConfigError

DUTIES = (0.3, 0.5, 0.8)
COUNTS_A_TURN = 1496.0

MOST_SHARE, MOST_TAU_SHARE = 0.005, 0.03
"""Largest errors of the fit: gain, full speed and dead band; time constant."""


def travelled(times_s, speed_counts_s, tau_s, delay_s):
    since = np.maximum(0.0, times_s - delay_s)
    return speed_counts_s * (since + tau_s * np.expm1(-since / tau_s))


def steps_of(motor, rng, duties=DUTIES):
    """Steps of 1 s, read every 20 ms with a jitter of 0.5 ms, in whole counts; the host is up to 10 ms late."""
    made = []
    for duty in duties:
        times_s = np.arange(0, 1, 0.02) + rng.normal(0, 5e-4, 50)
        speed = max(0.0, motor.gain_counts_s * (duty - motor.dead_band))
        exact = travelled(times_s, speed, motor.time_constant_s, motor.delay_s + rng.uniform(0, 0.01))
        made.append(DutyStep(duty, times_s, np.floor(exact + rng.uniform())))
    return made


def some_motor(rng):
    return MotorFit(
        rng.uniform(0, 0.2), rng.uniform(2000, 12000), rng.uniform(0.02, 0.2), rng.uniform(0, 0.03), 0.0
    )


@pytest.mark.parametrize("seed", range(20))
def test_a_motor_is_found_in_its_noisy_steps(seed):
    rng = np.random.default_rng(seed)
    true = some_motor(rng)
    found = bridge_gains.identify(steps_of(true, rng))
    assert found.full_counts_s == pytest.approx(true.full_counts_s, rel=MOST_SHARE)
    assert found.dead_band == pytest.approx(true.dead_band, abs=MOST_SHARE)
    assert found.time_constant_s == pytest.approx(true.time_constant_s, rel=MOST_TAU_SHARE)
    assert found.off_line < MOST_SHARE


def test_a_curve_is_told_from_a_line_and_full_speed_is_found():
    """A bridge that lets the motor coast between pulses: speed is a - b / duty; at full duty 5400 count/s."""
    rng = np.random.default_rng(3)
    steps = [
        steps_of(MotorFit(0.0, 6000 * (1 - 0.1 / duty) / duty, 0.1, 0.0, 0.0), rng, (duty,))[0]
        for duty in DUTIES
    ]
    found = bridge_gains.identify(steps)
    assert found.off_line > bridge_gains.LINEAR_WITHIN
    assert found.full_counts_s == pytest.approx(5400, rel=0.06)


def steps_with(dead_band, rng):
    return steps_of(MotorFit(dead_band, 8000.0, 0.1, 0.0, 0.0), rng)


def test_a_step_in_the_dead_band_does_not_count_and_a_dead_band_is_never_negative():
    """Noise of a motor without friction may put the line's root below zero."""
    rng = np.random.default_rng(1)
    assert bridge_gains.identify(steps_with(0.4, rng)).dead_band == pytest.approx(0.4, abs=MOST_SHARE)
    steps = [
        step._replace(travel=step.travel * (1.02 if step.duty < 0.4 else 1.0))
        for step in steps_with(0.0, rng)
    ]
    assert bridge_gains.identify(steps).dead_band == 0.0


@pytest.mark.parametrize(
    "dead_band, damage, words",
    [
        (0.1, lambda step: step._replace(travel=-step.travel), "a positive number: run mrl calibrate wiring"),
        (0.6, lambda step: step, "the wheel turned at 1 of 3 duties, expected at least 2"),
    ],
    ids=["backward", "one duty only"],
)
def test_steps_that_tell_nothing_are_refused(dead_band, damage, words):
    with pytest.raises(ConfigError, match=words):
        bridge_gains.identify([damage(step) for step in steps_with(dead_band, np.random)])


def test_gains_follow_the_rule_of_lambda_tuning():
    """tau 0.12 s gives lambda 0.04 s: kp = 0.12 / (1 / 0.9 x 0.05), ki = kp / 0.12."""
    motor = MotorFit(0.1, 4000.0, 0.12, 0.0, 0.0)
    assert bridge_gains.design([motor], COUNTS_A_TURN) == BridgeGains(2160, 18000, 100, 144)
    with pytest.raises(ConfigError, match=r"friction_duty 550 \[0.1 %\], expected 0 to 500"):
        bridge_gains.design([MotorFit(0.55, 4000.0, 0.1, 0.0, 0.0)], COUNTS_A_TURN)


def test_both_wheels_bear_the_gains():
    """Full speed is that of the slower wheel, friction the smaller one; no wheel gets more than its own gains."""
    right, left = MotorFit(0.10, 4000.0, 0.10, 0.0, 0.0), MotorFit(0.06, 5000.0, 0.15, 0.0, 0.0)
    both = bridge_gains.design([right, left], COUNTS_A_TURN)
    alone = [bridge_gains.design([motor], COUNTS_A_TURN) for motor in (right, left)]
    assert (both.full_speed, both.friction_duty) == (alone[0].full_speed, alone[1].friction_duty)
    assert both.kp <= min(one.kp for one in alone) and both.ki <= min(one.ki for one in alone)
