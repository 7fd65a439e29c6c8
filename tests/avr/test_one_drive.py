"""One drive of the firmware's image on the simulated chip; the other tests of the image have the details."""

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from sim_arduino.serve import factory

WATCHDOG_S, BRAKING_S = 0.25, 0.3


def after(emulated, seconds):
    """The true pose when the host has been silent for so long."""
    emulated.engine.advance(emulated.engine.machine.time_s + seconds)
    return emulated.plant.true_pose


def test_the_image_drives_and_its_watchdog_stops_it():
    emulated = factory.make(factory.Options(robot="traxbot", engine="avr"))
    with SteppedDriver(emulated.engine) as robot:
        for _ in range(20):
            robot.drive(0.2, 0.0)
            robot.wait(0.1)
        assert robot.pose.x_m == pytest.approx(emulated.plant.true_pose.x_m, abs=0.01)
        assert robot.pose.x_m > 0.1
        stands = after(emulated, WATCHDOG_S + BRAKING_S)
        assert after(emulated, 1.0) == stands
    emulated.close()
