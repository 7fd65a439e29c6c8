import math
import re

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.robot.sonar import (
    AGREE_CM,
    NAMES,
    NOTHING_2013_CM,
    NewReadings,
    RepeatedReadings,
    range_m,
)
from sim_arduino.serve.factory import Options, make
from tests.scripted_line import ScriptedLine


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


# -- boards without checksums

FRONT = re.compile(rb"(\d+),\d+,\d+e")
SETTLED_S = 6.0
"""The board has started, and its sonars too."""


def believed(*frames):
    readings = RepeatedReadings()
    return [readings.update(frame) for frame in frames][-1]


def test_a_value_that_is_not_repeated_is_not_believed():
    assert believed((100, 200, 300), (10, 200, 300), (100, 200, 300)) == (100, 200, 300)


def test_a_value_that_is_repeated_is_believed():
    assert believed((100, 200, 300), (10, 200, 300), (10, 200, 300)) == (10, 200, 300)


def test_a_value_that_changes_a_little_is_believed_at_once():
    assert believed((100, 200, 300), (100 + AGREE_CM, 200, 300)) == (100 + AGREE_CM, 200, 300)


def test_the_first_frame_is_believed():
    assert believed((100, 200, 300)) == (100, 200, 300)


def test_a_damaged_range_of_a_2013_stream_is_not_told():
    spoiled, ranges = [], set()

    def spoil(data):
        found = FRONT.search(data)
        if not ranges or not found or spoiled:
            return data
        spoiled.append(data)
        return data[: found.start(1)] + b"8" + data[found.end(1) :]

    line = ScriptedLine(make(Options(robot="traxbot", profile="2013-august")).board, to_host=spoil)
    with SteppedDriver(line) as robot:
        robot.wait(SETTLED_S)
        robot.on_telemetry(lambda telemetry: ranges.add(telemetry.ranges["front"]))
        robot.wait(1.0)
    assert spoiled and len(ranges) == 1
