"""Motors that a calibration turns by itself, past the driver's own watch."""

import pytest

from mrl_driver.calibration import driving
from mrl_driver.errors import BoardTimeout
from mrl_driver.stepped import SteppedDriver
from sim_arduino import boards

SILENT_S, STOPPED_S = 1.0, 0.6


def test_motors_are_not_turned_on_without_telemetry():
    mute = f"loss:rate=1,at={SILENT_S},direction=to_host"
    emulated = boards.make(boards.Options(robot="traxbot", world="square", faults=(mute,)))
    robot = SteppedDriver(emulated.engine)
    robot.connect()
    driving.settle(robot)
    assert robot.now_s < SILENT_S
    with pytest.raises(BoardTimeout, match="telemetry ended"):
        driving.spin_motors(robot, driving.MOVE_PID, -40, 40, 5.0)
    assert robot.now_s < SILENT_S + STOPPED_S
    robot.wait(0.5)
    assert all(motor.at_rest for motor in emulated.plant.robot.motors)
    emulated.close()
