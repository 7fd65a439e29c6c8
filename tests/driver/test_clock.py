"""Board time to host time under jitter, drift, wraps and gaps; all time is simulated."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.clock import MAX_DRIFT, BoardClock
from mrl_driver.table import TICK_S

USB_JITTER_S = 0.016
STAMP_ERROR_S = 1e-3


def int16(ticks: int) -> int:
    return (ticks + 0x8000) % 0x10000 - 0x8000


def run(seed, drift, seconds, jitter_s=USB_JITTER_S, period_s=0.02):
    """Yields (true host time, HostTime, clock) for each frame of a board whose clock is off by `drift`."""
    rng, clock = random.Random(seed), BoardClock()
    start_s, arrival_s = rng.uniform(0, 1e5), 0.0
    for n in range(int(seconds / period_s)):
        true_s = start_s + n * period_s
        arrival_s = max(arrival_s, true_s + rng.uniform(0, jitter_s))
        yield (
            true_s,
            clock.update(int16(int(n * period_s * (1 + drift) / TICK_S) + 777 * seed), arrival_s),
            clock,
        )


@pytest.mark.parametrize("seed", range(6))
def test_stamp_is_exact_to_a_millisecond_after_ten_seconds(seed):
    drift = random.Random(seed).uniform(-0.005, 0.005)
    errors = sorted(abs(host.stamp_s - true_s) for true_s, host, clock in list(run(seed, drift, 40))[500:])
    assert errors[int(0.99 * len(errors))] < STAMP_ERROR_S


@given(st.integers(0, 99), st.floats(-0.005, 0.005))
def test_stamps_strictly_increase(seed, drift):
    stamps = [host.stamp_s for _, host, _ in run(seed, drift, 5)]
    assert all(a < b for a, b in zip(stamps, stamps[1:]))


@given(st.integers(0, 99), st.floats(-0.005, 0.005))
def test_a_stamp_is_not_after_its_arrival(seed, drift):
    assert all(host.latency_s >= 0.0 for _, host, _ in run(seed, drift, 5))


@pytest.mark.parametrize("drift", [0.005, -0.005])
def test_a_quarter_of_an_hour_out_of_reach_is_told_by_the_drift_of_before(drift):
    """870 s are 4.35 s of drift, more than the board's time takes to wrap."""
    clock = BoardClock()
    times = [0.02 * n for n in range(1500)] + [900.0, 901.0, 910.0]
    *_, last = (clock.update(int16(int(time / (1 + drift) / TICK_S)), time) for time in times)
    assert last.stamp_s == pytest.approx(910.0, abs=STAMP_ERROR_S)


def test_drift_is_found():
    *_, (_, _, clock) = run(3, 0.004, 30)
    assert clock.drift == pytest.approx(-0.004, abs=1e-4)


def test_a_drift_that_changes_is_forgotten_with_its_window():
    """As a resonator's does when the board warms up."""
    clock, rng, ticks = BoardClock(), random.Random(2), 0.0
    for n in range(5000):
        ticks += 0.02 * (1 + (0.004 if n < 2500 else -0.004)) / TICK_S
        clock.update(int16(int(ticks)), 0.02 * n + rng.uniform(0, USB_JITTER_S))
    assert clock.drift == pytest.approx(0.004, abs=2e-4)


def test_latency_is_the_delay_beyond_the_least():
    *_, (true_s, host, _) = run(5, 0.0, 30)
    assert host.latency_s == pytest.approx(host.stamp_s + host.latency_s - true_s, abs=STAMP_ERROR_S)


@given(st.integers(0, 60), st.floats(0.0, 4.0))
def test_a_gap_of_many_wraps_is_bridged_by_the_host_clock(wraps, rest_s):
    clock, gap_s = BoardClock(), wraps * 65536 * TICK_S + rest_s
    clock.update(0, 100.0)
    host = clock.update(int16(int(gap_s / TICK_S)), 100.0 + gap_s)
    assert host.board_s == pytest.approx(gap_s, abs=2 * TICK_S)


def test_drift_beyond_belief_is_cut():
    *_, (_, _, clock) = run(1, 0.05, 10)
    assert clock.drift == -MAX_DRIFT


def test_a_late_burst_is_no_wrap():
    """Frames that waited three seconds follow each other in board time."""
    clock = BoardClock()
    clock.update(0, 100.0, next_one=True)
    host = clock.update(312, 103.0, next_one=True)
    assert host.board_s == pytest.approx(312 * TICK_S)
