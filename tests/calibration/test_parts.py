"""Sonar curve, gains, wires: the pure parts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.calibration import gains, sonar_curve
from mrl_driver.calibration.gains import MotorModel
from mrl_driver.calibration.sonar_curve import THESIS, Curve
from mrl_driver.calibration.wiring_check import LEFT, RIGHT, Trial, diagnose, seen_in
from mrl_driver.errors import ConfigError

DISTANCES_M = np.arange(0.20, 2.001, 0.05)
NOISE_M, MOST_ERROR_M, LEAST_R2 = 0.01, 0.01, 0.999


def readings(curve, rng, each=3, noise_m=NOISE_M):
    truth = np.repeat(DISTANCES_M, each)
    return np.round(curve.counts(truth + rng.normal(0, noise_m, len(truth)))), truth


@settings(max_examples=25, deadline=None)
@given(st.floats(0.9, 1.5), st.floats(0.9, 1.03), st.floats(-2.0, 2.0))
def test_curve_of_noisy_readings_is_within_a_centimetre(a, b, c):
    """1 cm of noise, whole counts, three readings at each distance from 20 to 200 cm; as a rule: noise has no bound."""
    true, worst_m = Curve(a, b, c), []
    for seed in range(5):
        counts, truth = readings(true, np.random.default_rng(seed))
        found = sonar_curve.fit(counts, truth)
        assert found.r2 >= LEAST_R2
        errors_m = found.curve.on_wire().range_m(true.counts(DISTANCES_M)) - DISTANCES_M
        worst_m.append(np.abs(errors_m).max())
    assert np.median(worst_m) < MOST_ERROR_M


def test_readings_that_missed_the_wall_are_left_out():
    counts, truth = readings(THESIS, np.random.default_rng(1), noise_m=0.0)
    counts[[5, 40]] = [400.0, np.nan]
    found = sonar_curve.fit(counts, truth)
    assert list(np.flatnonzero(~found.used)) == [5, 40]
    assert found.curve == pytest.approx(THESIS, abs=0.2)


def test_a_missing_wall_is_named_with_its_distance():
    counts, truth = readings(THESIS, np.random.default_rng(1))
    counts[truth > 1.72] = np.nan
    words = r"missed the wall 18 of 111 times, always at 1.75, 1.80, 1.85, 1.90 m"
    with pytest.raises(ConfigError, match=words):
        sonar_curve.fit(counts, truth)


@settings(max_examples=15, deadline=None)
@given(st.floats(3000, 20000), st.floats(0.03, 0.4), st.floats(0.0, 0.1))
def test_a_motor_is_found_in_its_step(full, tau, delay):
    times = np.arange(0, 1.5, 0.02)
    since = np.maximum(0, times - delay)
    way = np.floor(0.4 * full * (since - tau * (1 - np.exp(-since / tau))))
    found = gains.identify(times, way, 0.4)
    assert found.full_counts_s == pytest.approx(full, rel=0.03)
    assert found.time_constant_s + found.delay_s == pytest.approx(tau + delay, abs=0.03)


@pytest.mark.parametrize("tau", [0.05, 0.2])
def test_suggested_gains_reach_the_speed_without_much_overshoot(tau):
    plants = (MotorModel(12000.0, tau, 0.02), MotorModel(9000.0, 1.2 * tau, 0.02))
    speed = gains.simulate(plants, np.array([gains.suggest(plants)]), 0.4, 0.05)[0]
    assert speed.max() < 1 + gains.OVERSHOOT
    assert np.abs(speed[:, 20:] - 1).max() < 0.02


@pytest.mark.parametrize(
    "left, right, finding",
    [
        ((0, 900, LEFT, 1), (900, 0, RIGHT, 1), None),
        ((0, 900, RIGHT, 1), (900, 0, LEFT, 1), "motors swapped"),
        ((900, 0, LEFT, 1), (0, 900, RIGHT, 1), "encoders swapped"),
        ((0, -900, LEFT, 1), (900, 0, RIGHT, 1), "left encoder reversed"),
        ((0, -900, LEFT, -1), (900, 0, RIGHT, 1), "left motor runs backward"),
        ((0, 0, LEFT, 1), (900, 0, RIGHT, 1), "left encoder does not count"),
        ((0, 0, LEFT, 0), (900, 0, RIGHT, 1), "left motor does not turn"),
        ((0, 0), (0, 0), "no wheel moved"),
        ((900, 0), (0, 900), "encoders or motors swapped"),
        ((0, 900), (-900, 0), "right encoder or motors reversed"),
    ],
)
def test_wires_are_told_from_what_turned_and_what_counted(left, right, finding):
    found = diagnose([Trial(LEFT, *left), Trial(RIGHT, *right)])
    assert (found == []) if finding is None else any(line.startswith(finding) for line in found)


@pytest.mark.parametrize(
    "x_m, yaw_rad, seen",
    [
        (0.05, -0.5, (LEFT, 1)),
        (0.05, 0.5, (RIGHT, 1)),
        (-0.05, 0.5, (LEFT, -1)),
        (-0.05, -0.5, (RIGHT, -1)),
        (0, 0, (LEFT, 0)),
    ],
)
def test_the_wheel_that_turned_is_seen_in_the_true_pose(x_m, yaw_rad, seen):
    assert seen_in(x_m, yaw_rad) == seen
