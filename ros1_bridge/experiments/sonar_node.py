"""The node that approaches a wall: it reads `odom` and `sonar/front`, and publishes `cmd_vel`."""

import time
from typing import List, Tuple

import numpy as np
import rospy
from sensor_msgs.msg import Range

from mrl_driver.apps.calibration import sonar_procedures
from mrl_driver.apps.calibration.sonar_procedures import FRESH_S
from mrl_driver.geometry import ORIGIN
from mrl_driver.navigation.line_follower import Course, FollowerLimits
from mrl_driver.robot import models, sonar_curve
from mrl_driver.robot.sonar_curve import Curve
from sim_arduino.experiments import disturbances, sonar_approach
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.sonar_approach import SonarRun
from sim_arduino.world.world_file import pose_text

from .experiment_processes import Parts
from .one_robot_node import RATE_HZ, ROBOT, follow, wait_for

PLAN = sonar_procedures.SonarPlan(step_m=0.15)
"""Fewer stops than in simulated time, because these are in real time."""
LIMITS = FollowerLimits(linear_m_s=0.2)
READ_S = 1.0
"""Readings of a stop: the sonar measures every 0.3 s."""


def approach(parts: Parts, setting: Setting) -> SonarRun:
    """Approaches the wall with a robot with drawn errors, and fits the readings at the stops.

    Raises:
        MrlError: a part has failed or is not ready in time, or the robot does not arrive.
        ConfigError: the sonar missed the wall too often.
    """
    ranges, distances = readings(parts, setting)
    board = {**models.COMMON_BOARD, **models.load(setting.robot).board}
    curve = Curve(*(board[name] / 1e4 for name in models.CURVE_KEYS))  # by which it converts counts to ranges
    counts = curve.counts(np.array(ranges)).tolist()
    hidden = sonar_approach.hidden_curve(setting.seed)
    return SonarRun(counts, distances, sonar_curve.fit(counts, distances), hidden)


def _start(parts: Parts, setting: Setting) -> None:
    """Starts the board, whose sonars have a hidden curve, in front of a wall, and its robot node."""
    world = parts.folder / "wall.yaml"
    wall_m, wide_m = sonar_approach.SONAR_X_M + PLAN.start_m, sonar_approach.WIDE_M
    world.write_text(f"start: [0, 0, 0]\nwalls:\n  - [{wall_m}, {-wide_m}, {wall_m}, {wide_m}]\n")
    pose = pose_text(disturbances.placed(ORIGIN, setting.seed))
    place = ("--world", str(world), "--pose", pose, "--seed", str(setting.seed))
    sonar = sonar_approach.sonar_errors(disturbances.sonar_curve(setting.seed))
    errors = ("--error", disturbances.error(setting.seed), "--sonar", sonar)
    parts.robot(ROBOT, setting.robot, RATE_HZ, *place, *errors)


def readings(parts: Parts, setting: Setting) -> Tuple[List[float], List[float]]:
    """Median range of the front sonar [m], NaN for none, and distance by odometry [m], at each stop; see `approach`."""
    _start(parts, setting)
    robot = wait_for(parts)
    robot.reset_pose(ORIGIN)
    heard: List[float] = []
    rospy.Subscriber(f"/{ROBOT}/sonar/front", Range, lambda message: heard.append(message.range))
    ranges, distances = [], []
    for distance_m in PLAN.distances():
        follow(parts, robot, Course([(PLAN.start_m - distance_m, 0.0)], LIMITS), FRESH_S)
        heard.clear()
        time.sleep(READ_S)
        valid = [range_m if np.isfinite(range_m) else np.nan for range_m in heard]
        ranges.append(float(np.median(valid)) if valid else np.nan)
        distances.append(PLAN.start_m - robot.pose.x_m)
    return ranges, distances
