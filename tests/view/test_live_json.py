"""The numbers of a robot as JSON for other programs, read as PlotJuggler's UDP server reads them."""

import contextlib
import json
import math
import xml.etree.ElementTree
from pathlib import Path

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.session.events import SensorRead
from mrl_driver.view.live_json import LONGEST, LiveJson, texts
from sim_arduino.serve import factory

AHEAD_S = 1.7e9
LAYOUT = Path(__file__).parents[2] / "docs" / "layouts" / "plotjuggler_udp.xml"


def read(text):
    """The curves of one datagram by name, and its time; a number that JSON does not have is an error."""

    def refuse(name):
        raise ValueError(f"{name} is not JSON")

    found = json.loads(text, parse_constant=refuse)
    numbers = {f"/{name}": value for name, value in found.items() if value is not None}
    assert len(text) <= LONGEST and all(type(value) in (int, float) for value in numbers.values())
    return numbers.pop("/timestamp"), numbers


class Streamed:
    """A stream of a robot in simulated time: the texts, and the telemetry."""

    def __init__(self, **options):
        self.emulated = factory.make(factory.Options(**options))
        self.driver = SteppedDriver(self.emulated.board)
        self.sent, self.telemetry = [], []

    def __enter__(self):
        self.driver.connect()
        LiveJson(self.driver, self.sent.append, AHEAD_S)
        self.driver.on_telemetry(self.telemetry.append)
        return self

    def __exit__(self, *_):
        with contextlib.closing(self.emulated):
            self.driver.close()


@pytest.fixture(scope="module")
def drive():
    """A drive of a robot with sonars and an IMU, and a pause of the host in it."""
    with Streamed(imu=True) as streamed:
        streamed.driver.wait(1.0)
        for _ in range(5):
            streamed.driver.drive(0.2, 0.3)
            streamed.driver.wait(0.1)
        streamed.driver.pause(0.09)
        yield streamed


def test_each_telemetry_has_an_object_with_its_own_values(drive):
    """Also if several frames are read at once, as after a pause."""
    assert len(drive.sent) == len(drive.telemetry) > 70
    for text, telemetry in zip(drive.sent, drive.telemetry):
        time_s, seen = read(text)
        assert time_s == pytest.approx(AHEAD_S + telemetry.stamp_s, abs=1e-6)
        assert [seen["/x_m"], seen["/y_m"], seen["/yaw_rad"]] == pytest.approx(
            tuple(telemetry.pose), abs=1e-6
        )
        assert seen["/speed_m_s"] == pytest.approx(telemetry.twist.linear_m_s, abs=1e-6)


def test_the_layout_for_plotjuggler_shows_values_of_the_stream(drive):
    _, seen = read(drive.sent[-1])
    shown = {
        curve.get(name)
        for curve in xml.etree.ElementTree.parse(LAYOUT).iter("curve")
        for name in (("curve_x", "curve_y") if curve.get("curve_x") else ("name",))
    }
    assert len(shown) > 10 and shown <= set(seen)


def test_a_value_that_is_not_known_or_infinite_is_null():
    (text,) = texts(1.5, ['"a"', '"b"', '"c"', '"d"'], [math.nan, math.inf, -math.inf, 1.0])
    assert text == b'{"timestamp":1.5,"a":null,"b":null,"c":null,"d":1.0}'


@pytest.mark.parametrize("count", [0, 1, 70, 71, 500])
def test_values_that_do_not_fit_into_one_datagram_get_more(count):
    names = [f"value_{number:03}" for number in range(count)]
    found = texts(AHEAD_S, [json.dumps(name) for name in names], [0.123456] * count)
    seen = [read(text) for text in found]
    assert {time_s for time_s, _ in seen} == {AHEAD_S}
    assert [name for _, numbers in seen for name in numbers] == [f"/{name}" for name in names]
    assert len(found) == max(1, -(-count // 65))


def test_a_board_without_motors_has_an_object_for_each_answer_of_a_sensor():
    with Streamed(robot="pioneer") as streamed:
        answers = []
        streamed.driver.on(SensorRead, answers.append)
        streamed.driver.wait(2.0)
    seen = [read(text) for text in streamed.sent]
    assert [time_s for time_s, _ in seen] == pytest.approx(
        [AHEAD_S + each.reading.stamp_s for each in answers], abs=1e-6
    )
    assert seen[-1][1]["/light_count"] == 500 and "/x_m" not in seen[-1][1]
