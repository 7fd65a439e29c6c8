"""Gains of H-bridge boards: the pure parts."""

import numpy as np
import pytest

from mrl_driver.calibration import bridge_gains
from mrl_driver.calibration.bridge_gains import BridgeGains, DutyStep, MotorFit
from mrl_driver.errors import ConfigError

DUTIES = (0.3, 0.5, 0.8)
COUNTS_A_TURN = 1496.0
SEEDS = range(20)
MOST_SHARE, MOST_TAU_SHARE = 0.005, 0.03
"""Largest errors of the fit: gain, full speed and dead band; time constant."""
OVERSHOOT, SETTLED_S = 0.05, 0.25
"""Limits of a step of the speed, as for the firmware."""


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


@pytest.mark.parametrize("seed", SEEDS)
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


def test_few_readings_are_refused():
    with pytest.raises(ConfigError, match="a step has 5 readings, expected at least 10"):
        bridge_gains.identify([DutyStep(0.5, np.arange(5) * 0.02, np.arange(5) * 60.0)])


def test_gains_follow_the_rule_of_lambda_tuning():
    """tau 0.12 s gives lambda 0.04 s: kp = 0.12 / (1 / 0.9 x 0.05), ki = kp / 0.12."""
    motor = MotorFit(0.1, 4000.0, 0.12, 0.0, 0.0)
    assert bridge_gains.design([motor], COUNTS_A_TURN) == BridgeGains(2160, 18000, 100, 144)


def test_both_wheels_bear_the_gains():
    """Full speed is that of the slower wheel, friction the smaller one; no wheel gets more than its own gains."""
    right, left = MotorFit(0.10, 4000.0, 0.10, 0.0, 0.0), MotorFit(0.06, 5000.0, 0.15, 0.0, 0.0)
    both = bridge_gains.design([right, left], COUNTS_A_TURN)
    alone = [bridge_gains.design([motor], COUNTS_A_TURN) for motor in (right, left)]
    assert (both.full_speed, both.friction_duty) == (alone[0].full_speed, alone[1].friction_duty)
    assert both.kp <= min(one.kp for one in alone) and both.ki <= min(one.ki for one in alone)


def test_a_value_beyond_its_parameter_is_refused():
    with pytest.raises(ConfigError, match=r"friction_duty 550 \[0.1 %\], expected 0 to 500"):
        bridge_gains.design([MotorFit(0.55, 4000.0, 0.1, 0.0, 0.0)], COUNTS_A_TURN)


def speeds_under_control(motor, gains, target_counts_s, seconds=1.0):
    """(N,) true speeds every 1 ms, as shares of the target, of the control law with whole counts at 200 Hz.

    The speed is measured over 10 ms, and a duty acts 1 ms after the counts.  A duty never drives against the target.
    """
    full, speed, way, integral, duty = gains.full_speed * COUNTS_A_TURN / 60, 0.0, 0.0, 0.0, 0.0
    counts, true = [0.0, 0.0, 0.0], []
    for _ in range(int(seconds / 0.005)):
        counts = [*counts[1:], float(np.floor(way))]
        error = (target_counts_s - (counts[-1] - counts[0]) / 0.010) / full
        ask = gains.friction_duty / 1000 + gains.kp / 1000 * error + integral
        if 0 < ask < 1 or ask * error < 0:
            integral += gains.ki / 1000 * error * 0.005
        before, duty = duty, float(np.clip(ask, 0, 1))
        for millisecond in range(5):
            applied = duty if millisecond else before
            bound = motor.gain_counts_s * max(0.0, applied - motor.dead_band)
            speed = bound + (speed - bound) * np.exp(-0.001 / motor.time_constant_s)
            way += speed * 0.001
            true.append(speed / target_counts_s)
    return np.array(true)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_gains_of_a_noisy_fit_keep_a_step_within_its_limits(seed):
    rng = np.random.default_rng(seed)
    true = some_motor(rng)
    gains = bridge_gains.design([bridge_gains.identify(steps_of(true, rng))], COUNTS_A_TURN)
    speeds = speeds_under_control(true, gains, 0.4 * true.full_counts_s)
    assert speeds.max() < 1 + OVERSHOOT
    assert np.abs(speeds[int(SETTLED_S * 1000) :] - 1).max() < 0.05
