"""Sensors, from the board's answers to the driver's readings."""

import math
import re

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import SENSOR_BY_NAME, SENSORS, Field, Sensor
from mrl_driver.robot.sonar import AGREE_CM, NAMES, NOTHING_2013_CM, NewReadings, RepeatedReadings, range_m
from mrl_driver.session.events import SensorRead
from mrl_driver.session.sensor_polling import ABSENT_S, Reading, SensorPoll, of_board, reading, text
from mrl_driver.view.shown_state import line
from sim_arduino.serve import factory
from sim_arduino.serve.factory import Options, make
from tests.scripted_line import ScriptedLine

ENVIRONMENT = frozenset({"environment"})
TENTHS = Sensor(99, "tenths", "Read it.", (Field("it", -100, 100, "0.1 degC", "It."),), 20)


def test_all_sensors_of_the_board_are_read_beside_the_odometry():
    """The compass ten times a second, the others twice; one that falls silent is left out."""
    emulated, told = factory.make(factory.Options(environment=True)), []
    emulated.plant.environment.light_count = 321
    with SteppedDriver(emulated.engine) as robot:
        robot.on(SensorRead, told.append)
        robot.wait(2.0)
        values = {name: found.values for name, found in robot.sensors.items()}
        expected = {
            "alcohol": (123,),
            "dust": (300,),
            "light": (321,),
            "thermopile": (22,) * 8,
            "compass": (90,),
        }
        assert {name: values[name] for name in expected} == expected
        assert set(values) == {row.name for row in SENSORS}
        assert (robot.link.statistics.lost, robot.ready) == (0, True)
        names = [name for name, _ in told]
        assert names.count("compass") > 4 * names.count("light") > 4
        assert "light 321 count" in line(robot)
        emulated.plant.i2c[0x60].present = False
        robot.wait(4.0)
        assert set(robot.sensors) == {row.name for row in SENSORS} - {"compass"}
    emulated.close()
    assert not [row for row in of_board(frozenset({"sonars"}), 2) if row.capability]


def test_readings_are_in_the_base_unit():
    found = reading(TENTHS, (-55,), 1.0)
    assert (found, text(TENTHS, found)) == (Reading((-5.5,), 1.0), "-5.5 degC")
    fields = (TENTHS.fields[0], SENSOR_BY_NAME["compass"].fields[0])
    assert [(each.scale, each.base_unit) for each in fields] == [(0.1, "degC"), (1.0, "deg")]


def test_one_that_may_be_absent_is_asked_rarely_until_it_answers(monkeypatch):
    monkeypatch.setattr("mrl_driver.session.sensor_polling.SENSORS", (TENTHS,))
    monkeypatch.setattr("mrl_driver.session.sensor_polling.BY_CODE", {99: TENTHS})
    poll, now, asked = SensorPoll(), 0.0, []
    poll.begin(ENVIRONMENT, 2, now)
    while now < 13.0:
        now = poll.next_s
        asked += [now for _ in poll.take(now)]
    assert asked == [0.5, 1.0, 1.5, 1.5 + ABSENT_S, 1.5 + 2 * ABSENT_S]
    poll.heard(Frame(99, (7,)), now)
    assert poll.next_s == now + TENTHS.period_ms / 1000


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
