"""A robot that may tip over brakes gently for a command of zero; whatever stops it does so at once."""

import math

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.safety.protective_zones import Zones, ZoneSettings
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.models import model

SPEED_M_S, BRAKING_M_S2, FRAME_S = 0.3, 0.2, 0.02
FRAME_M = SPEED_M_S * FRAME_S


def nothing(robot):
    """The braking goes on."""


def stop(robot):
    robot.stop()


def zone(robot):
    """An obstacle: no sonar of these zones has reported, and so they allow no motion ahead."""
    zones = Zones(ZoneSettings(), robot.model.body, robot.model.sonars)
    robot.restrict(lambda speeds, now: (zones.limit(speeds[0], now), *speeds[1:]))


def way_m(name, turn_rad_s, braked_s, then):
    """Way of the true robot after it has braked for a time, and something else has happened."""
    its = model(name)
    limits = its.limits._replace(linear_m_s=SPEED_M_S, angular_rad_s=1.0, braking_m_s2=BRAKING_M_S2)
    plant, way = Plant(its, World(), footprint="none"), 0.0
    with SteppedDriver(PythonBoard(plant), its._replace(limits=limits)) as robot:

        def drive(seconds, *speeds):
            nonlocal way
            for _ in range(round(seconds / FRAME_S)):
                robot.drive(*speeds)
                before = plant.true_pose
                robot.wait(FRAME_S)
                way += math.dist(plant.true_pose[:2], before[:2])

        drive(2.0, SPEED_M_S, turn_rad_s)
        drive(braked_s, 0.0, 0.0)
        way = 0.0
        then(robot)
        drive(2.0, 0.0, 0.0)
    return way


ROBOTS = pytest.mark.parametrize("name", ["duo", "traxbot"], ids=["H-bridge", "OMNI-3MD"])


@ROBOTS
def test_a_zone_ends_a_braking_on_an_arc_as_a_stop_does(name):
    """Neither follows the ramp of the driver, or that of the board; a zone is asked with the next frame."""
    by_stop, by_zone, on = (way_m(name, 0.8, 0.2, then) for then in (stop, zone, nothing))
    assert by_zone == pytest.approx(by_stop, abs=FRAME_M)
    assert by_stop < 0.25 * on


@ROBOTS
def test_a_command_of_zero_brakes_as_gently_as_the_limit_says(name):
    way = way_m(name, 0.0, 0.0, nothing)
    assert way == pytest.approx(SPEED_M_S**2 / 2 / BRAKING_M_S2, rel=0.15)
