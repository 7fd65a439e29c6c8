"""Heading with and without a gyro, on a robot whose model does not know its slip in turns."""

import math
import random
from operator import itemgetter
from typing import Any, ContextManager, Dict, Optional, Tuple

from mrl_driver.apps.calibration import fit, imu_procedures, manoeuvres
from mrl_driver.apps.calibration.geometry_procedures import turn_legs
from mrl_driver.apps.calibration.ground_truth import Truth
from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.navigation.line_follower import Course
from mrl_driver.robot.models import ImuMount
from sim_arduino.hardware.imu import ImuErrors
from sim_arduino.world import world_file

from . import disturbances, l_course
from .experiment_report import Measure, Result, figures, over_seeds
from .experiment_robot import ExperimentRobot, Setting, follow, open_robot

SEEDS = 20
TURNS, SLIP = 10, 0.1
PERIOD_MS = 20
STAND_S = 2.0
SPEEDS = manoeuvres.Speeds()
COURSE = "l-course"
CALIBRATION_LEGS, CALIBRATION_TURNS = 3, 5  # legs of `mrl calibrate imu`: two of one turn, and one of five


def run(setting: Setting) -> Result:
    """Drives with and without the gyro, and compares the poses with the true ones."""
    with_gyro = over_seeds(lambda each: _errors(each, _calibrated(each)), setting, SEEDS)
    without = [_errors(setting, None)]  # nothing in it is drawn
    text = f"error of the heading after {TURNS} turns of 90 deg, gyro and wheels"
    position = Measure("gyro_position_cm", "error of the position after the L-course", "cm", itemgetter(1))
    measures = (Measure("gyro_heading_deg", text, "deg", itemgetter(0)), position)
    remark = (
        f"Emulated {setting.robot} with {100 * SLIP:g} % slip that its model does not know; this is put in. Control: "
        "the wheels alone. The seeds draw the errors of the IMU from its data sheet. The scale of the gyro is "
        f"calibrated by {CALIBRATION_LEGS} legs of up to {CALIBRATION_TURNS} turns to a mark, whose direction is "
        f"measured to {math.degrees(fit.BY_TAPE.heading_rad):.1f} deg."
    )
    return Result("gyro", "Heading by gyro and wheels", figures(measures, with_gyro, without), [], remark)


def _calibrated(setting: Setting) -> ImuMount:
    """The IMU of this seed, as `mrl calibrate imu` finds it."""
    rng = random.Random(f"mark {setting.seed}")
    with _open(setting, ImuMount()) as robot:

        def look() -> Pose:
            x_m, y_m, yaw_rad = robot.true_pose
            return Pose(x_m, y_m, wrap_angle(yaw_rad + rng.gauss(0.0, fit.BY_TAPE.heading_rad)))

        legs = turn_legs(CALIBRATION_LEGS, CALIBRATION_TURNS, SPEEDS)
        found = imu_procedures.calibrate(robot.driver, Truth(look), legs, 0.0, fit.BY_TAPE, lambda _: None)
        return found.after


def _open(setting: Setting, mount: Optional[ImuMount]) -> ContextManager[ExperimentRobot]:
    """A robot with slip, and with an IMU if `mount` is not None."""
    error = disturbances.option(slip=SLIP)
    imu: Dict[str, Any] = {}
    if mount is not None:
        imu = {"imu": True, "imu_errors": ImuErrors.drawn(setting.seed)}
    return open_robot(
        setting, COURSE, imu_mount=mount, period_ms=PERIOD_MS, error=error, footprint="none", **imu
    )


def _errors(setting: Setting, mount: Optional[ImuMount]) -> Tuple[float, float]:
    """Errors of one robot at the end of the turns [deg], and of the L-course that begins where they end [cm]."""
    with _open(setting, mount) as robot:
        robot.wait(STAND_S)
        robot.reset_pose(robot.true_pose)
        for _ in range(TURNS):
            manoeuvres.turn(robot.driver, math.pi / 2, SPEEDS)
        robot.wait(STAND_S)
        start = robot.true_pose
        heading_deg = math.degrees(abs(wrap_angle(start.yaw_rad - robot.pose.yaw_rad)))
        robot.reset_pose(start)
        first = world_file.load(COURSE).start
        points = [start.compose(*Pose(*each, 0.0).relative_to(first)) for each in l_course.WAYPOINTS]
        follow(robot, Course([point[:2] for point in points]), lambda: None)
        robot.wait(STAND_S)
        return heading_deg, 100 * math.dist(robot.pose[:2], robot.true_pose[:2])
