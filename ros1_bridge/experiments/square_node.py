"""The node that drives one lap of a square: it reads `odom` and publishes `cmd_vel`; the emulator logs the truth."""

import os

from mrl_driver.apps.calibration.ground_truth import Truth, truth_file
from mrl_driver.geometry import ORIGIN, Pose, wrap_angle
from mrl_driver.navigation.line_follower import Course, FollowerLimits
from ros1_bridge.demo.processes import wait_until
from sim_arduino.experiments import disturbances, square
from sim_arduino.experiments.experiment_robot import Setting

from .experiment_processes import START_S, Parts
from .one_robot_node import RATE_HZ, ROBOT, follow, wait_for

STOP_S = 2.0
POINTS = ((1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0), (0.05, 0.0))
"""A counter-clockwise lap; the last point makes the robot turn to its first heading."""
LIMITS = FollowerLimits(square.SPEEDS.linear_m_s, square.SPEEDS.angular_rad_s)


def lap(parts: Parts, setting: Setting) -> Pose:
    """Drives a lap with a robot like the published one; returns the true end minus the end by `odom`.

    Both ends are in the frame of the start.  MrlError if a part fails or is late, or the robot does not arrive.
    """
    true_file = str(parts.folder / "truth.jsonl")
    error = disturbances.error(setting.seed, "square", **square.LIKE_PUBLISHED)
    options = ("--world", "square", "--error", error, "--seed", str(setting.seed), "--truth", true_file)
    parts.robot(ROBOT, setting.robot, RATE_HZ, *options)
    robot = wait_for(parts)
    wait_until(lambda: os.path.isfile(true_file), START_S)
    robot.reset_pose(ORIGIN)
    truth, by_odometry = Truth(truth_file(true_file)), Truth(lambda: robot.pose)
    for ruler in (truth, by_odometry):
        ruler.begin("lap")
    follow(parts, robot, Course(POINTS, LIMITS), STOP_S)
    end, found = (ruler.end("lap", lambda _: None) for ruler in (truth, by_odometry))
    return Pose(end.x_m - found.x_m, end.y_m - found.y_m, wrap_angle(end.yaw_rad - found.yaw_rad))
