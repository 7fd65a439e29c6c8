"""The sensors of the table, from the board's answers to the driver's readings."""

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol import Frame, encode_reply
from mrl_driver.protocol.table import SENSOR_BY_NAME, SENSORS, Field, Sensor
from mrl_driver.recording.recording import Recording
from mrl_driver.recording.summary import summarise
from mrl_driver.session.sensor_polling import ABSENT_S, Reading, SensorPoll, of_board, reading, text
from mrl_driver.view.shown_state import line
from sim_arduino.serve import factory

ENVIRONMENT = frozenset({"environment"})
TENTHS = Sensor(99, "tenths", "Read it.", (Field("it", -100, 100, "0.1 degC", "It."),), 20)


@pytest.fixture(scope="module")
def robot():
    emulated = factory.make(factory.Options(environment=True))
    emulated.plant.environment.light_count = 321
    with SteppedDriver(emulated.engine) as driver:
        driver.told = []
        driver.on_sensor(driver.told.append)
        driver.wait(2.0)
        driver.plant = emulated.plant
        yield driver
    emulated.close()


def test_all_sensors_of_the_board_are_read_beside_the_odometry(robot):
    """The compass ten times a second, the others twice."""
    values = {name: found.values for name, found in robot.sensors.items()}
    expected = {"alcohol": (123,), "dust": (300,), "light": (321,), "thermopile": (22,) * 8, "compass": (90,)}
    assert {name: values[name] for name in expected} == expected
    assert set(values) == {row.name for row in SENSORS}
    assert (robot.statistics.lost, robot.ready) == (0, True)
    names = [name for name, _ in robot.told]
    assert names.count("compass") > 4 * names.count("light") > 4
    assert "light 321 count" in line(robot)
    assert list(of_board(frozenset({"sonars"}), 2)) == []


def test_one_that_falls_silent_is_left_out():
    emulated = factory.make(factory.Options(environment=True))
    with SteppedDriver(emulated.engine) as robot:
        robot.wait(1.0)
        assert "compass" in robot.sensors
        emulated.plant.i2c[0x60].present = False
        robot.wait(4.0)
        assert set(robot.sensors) == {row.name for row in SENSORS} - {"compass"}
    emulated.close()


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


def test_the_summary_of_a_recording_has_their_range(tmp_path):
    lines = [
        f"{i}.0 < {encode_reply(41, value).decode().strip()}\\r\\n\n" for i, value in enumerate((321, 77))
    ]
    (tmp_path / "light.log").write_text("#mrl-recording 1 {}\n" + "".join(lines))
    figures = summarise(Recording(str(tmp_path / "light.log")))
    assert figures["sensors"] == {"light": {"least": 77.0, "most": 321.0, "unit": "count"}}
