import math

import pytest

from mrl_driver.robot.sonar import NAMES, NOTHING_2013_CM, NewReadings, range_m


def test_centimetres_become_metres():
    assert range_m(120) == 1.2


def test_no_reading_is_nan():
    assert math.isnan(range_m(-1))


def test_nothing_in_range_is_plus_infinity():
    assert range_m(645) == math.inf


def test_too_near_is_minus_infinity():
    assert range_m(14) == -math.inf


@pytest.mark.parametrize("true_cm", [20, 50, 100, 200, 400])
def test_the_curve_of_2013_boards_is_undone(true_cm):
    """They send 1.767 s^b - 0.3759 where 1.1767 s^b - 0.3759 is right."""
    raw = ((true_cm + 0.3759) / 1.1767) ** (1 / 0.94657)
    wire = round(1.767 * raw**0.94657 - 0.3759)
    assert range_m(wire, version=1) == pytest.approx(true_cm / 100, abs=0.005)


@pytest.mark.parametrize("count", [640, 645, 1023])
def test_a_2013_board_that_sees_nothing(count):
    assert range_m(int(1.767 * count**0.94657 - 0.3759), version=1) == math.inf


def test_the_farthest_echo_of_a_2013_board_is_a_range():
    assert range_m(NOTHING_2013_CM - 1, version=1) == pytest.approx(5.32, abs=0.01)


@pytest.mark.parametrize("wire", [0, -1])
def test_a_2013_board_without_a_sonar(wire):
    assert math.isnan(range_m(wire, version=1))


def test_every_first_reading_is_new():
    assert NewReadings().update((1, 2, 3), 0.0) == NAMES


def test_a_changed_value_is_new():
    readings = NewReadings()
    readings.update((1, 2, 3), 0.0)
    assert readings.update((1, 5, 3), 0.02) == ("left",)


def test_an_unchanged_value_is_new_once_per_cycle():
    readings = NewReadings(cycle_s=0.3)
    news = [readings.update((1, 2, 3), 0.02 * i) for i in range(31)]
    assert sum("front" in new for new in news) == 3
