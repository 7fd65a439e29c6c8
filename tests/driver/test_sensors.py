"""The sensors of the table, from the board's answers to the driver's readings."""

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import SENSOR_BY_NAME, SENSORS, Field, Sensor
from mrl_driver.session.events import SensorRead
from mrl_driver.session.sensor_polling import ABSENT_S, Reading, SensorPoll, of_board, reading, text
from mrl_driver.view.shown_state import line
from sim_arduino.serve import factory

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
    assert list(of_board(frozenset({"sonars"}), 2)) == []


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
