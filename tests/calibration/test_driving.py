"""Motors that a calibration turns by itself, past the driver's own watch."""

import pytest

from mrl_driver.calibration import manoeuvres
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout
from sim_arduino.serve import factory

SILENT_S, STOPPED_S = 1.0, 0.6


def test_motors_are_not_turned_on_without_telemetry():
    mute = f"loss:rate=1,at={SILENT_S},direction=to_host"
    emulated = factory.make(factory.Options(robot="traxbot", world="square", faults=(mute,)))
    robot = SteppedDriver(emulated.engine)
    robot.connect()
    manoeuvres.settle(robot)
    assert robot.now_s < SILENT_S
    with pytest.raises(BoardTimeout, match="telemetry ended"):
        manoeuvres.spin_motors(robot, manoeuvres.MOVE_PID, -40, 40, 5.0)
    assert robot.now_s < SILENT_S + STOPPED_S
    robot.wait(0.5)
    assert all(motor.at_rest for motor in emulated.plant.robot.motors)
    emulated.close()
