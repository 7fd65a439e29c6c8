"""Motors that a calibration turns by itself, past the driver's own watch."""

import pytest

from mrl_driver.calibration import driving
from mrl_driver.errors import BoardTimeout
from mrl_driver.stepped import SteppedDriver
from sim_arduino import boards

SILENT_S, STOPPED_S = 1.0, 0.6


class Muted:
    """A board whose bytes stop arriving."""

    def __init__(self, engine, at_s):
        self._engine, self._at_s = engine, at_s

    @property
    def next_event_s(self):
        return self._engine.next_event_s

    def receive(self, data):
        self._engine.receive(data)

    def advance(self, to_s):
        data = self._engine.advance(to_s)
        return data if to_s < self._at_s else b""


def test_motors_are_not_turned_on_without_telemetry():
    emulated = boards.make(boards.Options(robot="traxbot", world="square"))
    robot = SteppedDriver(Muted(emulated.engine, SILENT_S))
    robot.connect()
    driving.settle(robot)
    assert robot.now_s < SILENT_S
    with pytest.raises(BoardTimeout, match="telemetry ended"):
        driving.spin_motors(robot, driving.MOVE_PID, -40, 40, 5.0)
    assert robot.now_s < SILENT_S + STOPPED_S
    robot.wait(0.5)
    assert all(motor.at_rest for motor in emulated.plant.robot.motors)
    emulated.close()
