"""A robot with a mast drives fast, brakes and turns: with the limits that `mrl tip-over` writes, and without.

An emergency stop at full speed is the same with both: no limit delays it.
"""

import math
import os
from functools import partial
from tempfile import TemporaryDirectory
from typing import NamedTuple

from mrl_driver.apps.calibration.calibration_files import write_model
from mrl_driver.apps.tip_over import vehicle_file
from mrl_driver.apps.tip_over.margin import Situation
from mrl_driver.apps.tip_over.robot_limits import write_limits
from mrl_driver.robot import models
from sim_arduino.hardware.robot_physics import MAX_STEP_S
from sim_arduino.hardware.tipping import Tipping
from sim_arduino.world.world import World

from . import disturbances
from .experiment_report import Measure, Result, figures, over_seeds
from .experiment_robot import TICK_S, ExperimentRobot, Setting, open_robot

ROBOT, VEHICLE, RESERVE_RAD = "duo", "duo-mast", math.radians(10.0)
FAST = {"linear_m_s": 0.5, "angular_rad_s": 6.0}
"""Limits of a driver in a hurry: the board's ceilings."""
COMMAND_S = 2.0
AHEAD, STAND, BACK, LEFT, RIGHT = (0.5, 0.0), (0.0, 0.0), (-0.5, 0.0), (0.5, 6.0), (0.5, -3.0)
DRIVE = (AHEAD, STAND, BACK, AHEAD, LEFT, STAND, RIGHT, AHEAD, STAND)
"""Commands [m/s, rad/s], each for `COMMAND_S`."""
MEASURES = (
    Measure("tips_s", "time with the zero moment point outside the contacts", "s"),
    Measure("most_m_s2", "largest acceleration", "m/s2"),
    Measure("braking_m", "way from 0.5 m/s to standstill at a command of zero", "m"),
    Measure("emergency_m", "the same at an emergency stop", "m"),
)
REMARK = (
    "Control: the same robot's file without the limits. Acceleration and zero moment point are means over 0.1 s; the "
    "masses are chosen. An emergency stop is never limited, and may tip the robot over."
)


class TipDrive(NamedTuple):
    """What the drive was like."""

    tips_s: float
    most_m_s2: float
    braking_m: float
    emergency_m: float


def run(setting: Setting) -> Result:
    """Drives robots with loads of their own, with the limits and without."""
    values = {("limits", key): value for key, value in FAST.items()}
    with TemporaryDirectory() as folder:
        path = os.path.join(folder, "robot.yaml")
        write_model(models.path_of(ROBOT), path, values, "fast")
        control = over_seeds(partial(_drive, robot=path), setting)
        write_limits(Situation(vehicle_file.load(VEHICLE)), RESERVE_RAD, path)
        rows = figures(MEASURES, over_seeds(partial(_drive, robot=path), setting), control)
    return Result("tip-over", "Drive of a robot with a mast", rows, [], REMARK)


def _drive(setting: Setting, robot: str) -> TipDrive:
    vehicle = vehicle_file.load(VEHICLE)
    mass = vehicle.whole
    error = disturbances.error(setting.seed, load=mass.mass_kg / models.load(robot).body.mass_kg)
    its = setting._replace(robot=robot)
    with open_robot(its, World(), period_ms=20, error=error, footprint="none") as made:
        assert made.plant is not None
        tipping = Tipping(vehicle.contacts, (mass.x_m, mass.y_m, mass.height_m))
        made.plant.robot.report_motion(tipping.moved, MAX_STEP_S)
        ways = [_command(made, *each) for each in DRIVE]
        found = tipping.tips_s, tipping.most_m_s2
        _command(made, *AHEAD)
        before = made.true_pose
        made.driver.stop()
        made.wait(2.0)
        return TipDrive(*found, ways[1], math.dist(before[:2], made.true_pose[:2]))


def _command(robot: ExperimentRobot, linear_m_s: float, angular_rad_s: float) -> float:
    """Commands speeds; returns the distance from start to end [m]."""
    before = robot.true_pose
    for _ in range(round(COMMAND_S / TICK_S)):
        robot.drive(linear_m_s, angular_rad_s)
        robot.wait(TICK_S)
    return math.dist(before[:2], robot.true_pose[:2])
