"""A kit with exchanged wires and one wheel 4 % larger closes a square of 0.5 m once its calibration is known.

The real image drives the calibrated kit; `test_own_robot` has the way to the calibration, and the Python board.
"""

import math

from mrl_driver.calibration import manoeuvres
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from mrl_driver.robot.models import load
from sim_arduino.serve import factory

WIRING = 107
"""Motors swapped, right motor and both encoders reversed, and the bit that says that it is known."""
WHEEL_OFFSET = 0.0392
"""What `mrl calibrate straight --distance 1` finds for this kit: 0.04 / 1.02."""
SIDE_M, CLOSED_M, OPEN_M = 0.5, 0.015, 0.15
"""The driver stops a lap within 10 mm by odometry."""


def end_error_m(engine, wheel_offset):
    """Distance of the true end of a lap from its start [m]."""
    model = load("duo")
    options = factory.Options(
        "duo", engine=engine, error="wheel_ratio=1.04,phase=0.2", wiring=WIRING, footprint="none"
    )
    robot = factory.make(options)
    believed = model._replace(drive=model.differential._replace(wheel_offset=wheel_offset))
    try:
        with SteppedDriver(robot.board, believed) as driver:
            driver.ask(BY_NAME["write_config"].code, PARAMETER_BY_NAME["wiring"].number, WIRING)
            start = robot.plant.true_pose
            manoeuvres.square(driver, SIDE_M, True, manoeuvres.Speeds())
            end = robot.plant.true_pose
    finally:
        robot.close()
    return math.hypot(end.x_m - start.x_m, end.y_m - start.y_m)


def test_a_calibrated_kit_closes_a_square():
    assert end_error_m("avr", WHEEL_OFFSET) < CLOSED_M


def test_without_its_calibration_the_square_stays_open():
    assert end_error_m("python", 0.0) > OPEN_M
