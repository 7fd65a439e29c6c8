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


@pytest.mark.parametrize(
    "wire, version, expected_m",
    [
        (120, 2, 1.2),
        (-1, 2, math.nan),
        (645, 2, math.inf),
        (14, 2, -math.inf),
        *((int(1.767 * count**0.94657 - 0.3759), 1, math.inf) for count in (640, 645, 1023)),
        (NOTHING_2013_CM - 1, 1, 5.32),
        (0, 1, math.nan),
        (-1, 1, math.nan),
    ],
)
def test_centimetres_become_metres(wire, version, expected_m):
    """NaN is no reading, or no sonar; infinity is nothing in range, and minus infinity something too near."""
    assert range_m(wire, version) == pytest.approx(expected_m, abs=0.01, nan_ok=True)


@pytest.mark.parametrize("true_cm", [20, 50, 100, 200, 400])
def test_the_curve_of_2013_boards_is_undone(true_cm):
    """They send 1.767 s^b - 0.3759 where 1.1767 s^b - 0.3759 is right."""
    raw = ((true_cm + 0.3759) / 1.1767) ** (1 / 0.94657)
    wire = round(1.767 * raw**0.94657 - 0.3759)
    assert range_m(wire, version=1) == pytest.approx(true_cm / 100, abs=0.005)


def test_a_value_is_new_when_it_changes_and_once_per_cycle():
    readings = NewReadings()
    assert readings.update((1, 2, 3), 0.0) == NAMES
    assert readings.update((1, 5, 3), 0.02) == ("left",)
    news = [readings.update((1, 5, 3), 0.02 * i) for i in range(2, 31)]
    assert sum("front" in new for new in news) == 2


# -- boards without checksums

FRONT = re.compile(rb"(\d+),\d+,\d+e")
SETTLED_S = 6.0  # The board has started, and its sonars too


@pytest.mark.parametrize(
    "fronts, believed",
    [((100,), 100), ((100, 10, 100), 100), ((100, 10, 10), 10), ((100, 100 + AGREE_CM), 100 + AGREE_CM)],
    ids=["first", "not repeated", "repeated", "changes a little"],
)
def test_a_value_is_believed_that_is_repeated_or_changes_a_little(fronts, believed):
    readings = RepeatedReadings()
    assert [readings.update((front, 200, 300)) for front in fronts][-1] == (believed, 200, 300)


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
