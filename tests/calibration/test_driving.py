"""Motors that a calibration turns by itself, past the driver's own watch."""

import pytest

from mrl_driver.calibration import manoeuvres
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout
from sim_arduino.serve import factory

SILENT_S, STOPPED_S = 1.0, 0.6


def driven(fault):
    """An emulated robot and its driver, at rest; the line has a fault from one second on."""
    emulated = factory.make(factory.Options(robot="traxbot", footprint="none", faults=(fault,)))
    robot = SteppedDriver(emulated.engine)
    robot.connect()
    manoeuvres.settle(robot)
    assert robot.now_s < SILENT_S
    return emulated, robot


def test_a_short_silence_does_not_end_a_course():
    emulated, robot = driven(f"loss:rate=1,at={SILENT_S},lasts=0.8,direction=to_host")
    manoeuvres.straight(robot, 0.5, manoeuvres.Speeds())
    assert emulated.plant.true_pose.x_m == pytest.approx(0.5, abs=0.02)
    emulated.close()


def test_a_silence_ends_a_course_and_the_robot_stands():
    emulated, robot = driven(f"loss:rate=1,at={SILENT_S},direction=to_host")
    with pytest.raises(BoardTimeout, match="accepted no command"):
        manoeuvres.straight(robot, 0.5, manoeuvres.Speeds())
    robot.wait(0.5)
    assert all(motor.at_rest for motor in emulated.plant.robot.motors)
    emulated.close()


def test_a_restart_of_the_board_ends_a_course():
    """Its counters have lost a part of the way."""
    emulated, robot = driven(f"reset:at={SILENT_S}")
    with pytest.raises(BoardTimeout, match="accepted no command"):
        manoeuvres.straight(robot, 0.5, manoeuvres.Speeds())
    emulated.close()


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
