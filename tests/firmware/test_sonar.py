"""Sonars: the curve in integers, thresholds, the chain's timing."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.robot import models
from sim_arduino.hardware.wiring import Plant
from tests.firmware.pc_board import SONARS, load

POWER, TRIGGER = 13, 12
FRONT, LEFT, RIGHT = range(3)


@pytest.fixture(scope="module")
def native():
    return load(SONARS)


def formula(count, a, b, c):
    return max(0, min(1250, round(a * 1e-4 * count ** (b * 1e-4) + c * 1e-4)))


def test_thesis_curve_for_all_counts(native):
    """Within 1 cm of 1.1767 s^0.9466 - 0.3759; nearly all exact."""
    errors = [
        abs(native.pc_power_law(s, 11767, 9466, -3759) - formula(s, 11767, 9466, -3759))
        for s in range(1, 1024)
    ]
    assert max(errors) <= 1 and sum(errors) < 50


@settings(deadline=None)
@given(st.integers(10, 700), st.integers(1, 32767), st.integers(1, 20000), st.integers(-32768, 32767))
def test_any_curve(native, count, a, b, c):
    assert abs(native.pc_power_law(count, a, b, c) - formula(count, a, b, c)) <= 1


class Wired(Plant):
    """Sonar outputs with voltages of the test's; remembers pin changes."""

    def __init__(self, counts):
        super().__init__(models.load("traxbot"))
        self.counts, self.pins, self.reads = counts, [], []

    def adc_volts(self, channel, time_s):
        self.reads.append((channel, time_s))
        return (self.counts[channel] + 0.5) * 5 / 1024

    def pin_changed(self, pin, level, time_s):
        self.pins.append((pin, level, time_s))


@pytest.mark.parametrize(
    "count, wire",
    [(0, -1), (9, -1), (10, 10), (307, 266), (639, 532), (640, 645), (700, 645), (701, -1), (1023, -1)],
)
def test_thresholds(bench, count, wire):
    """Missing and saturated sensors have no reading; the end of the range is "nothing"."""
    board = bench(plant=Wired([count, 100, 100]))
    board.run(1.0)
    assert board.ask("read_sonars").args[FRONT] == wire


def test_not_ready_at_first(bench):
    """250 ms of power, then 100 ms for each sensor in its turn."""
    board = bench(plant=Wired([100, 200, 300]), boot=False)
    board.run(0.34)
    first = board.ask("read_sonars").args
    board.run(0.05)
    second = board.ask("read_sonars").args
    board.run(0.25)
    assert first == (-1, -1, -1) and second[1:] == (-1, -1) and -1 not in board.ask("read_sonars").args


def test_trigger_is_a_pulse(bench):
    """20 us at least, and over before the chain's end."""
    plant = Wired([100] * 3)
    board = bench(plant=plant)
    board.run(1.0)
    up, down = ([t for pin, level, t in plant.pins[2:] if (pin, level) == (TRIGGER, v)] for v in (1, 0))
    assert 20e-6 <= down[0] - up[0] < 0.02


def test_chain_starts_again_after_three_readings(bench):
    plant = Wired([100] * 3)
    board = bench(plant=plant)
    board.run(3.0)
    times = [t for pin, level, t in plant.pins if (pin, level) == (TRIGGER, 1)]
    gaps = [later - earlier for earlier, later in zip(times, times[1:])]
    assert 0.3 <= min(gaps) and max(gaps) < 0.33


def test_a_reading_is_never_older_than_one_cycle(bench):
    plant = Wired([100, 100, 100])
    board = bench(plant=plant)
    board.run(1.0)
    plant.counts = [0, 1023, 0]
    board.run(0.35)
    assert board.ask("read_sonars").args == (-1, -1, -1)
