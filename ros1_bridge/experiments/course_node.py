"""The node that maps the L-shaped course: it reads `odom`, the side sonars and `scan`, and publishes `cmd_vel`."""

import math
from typing import Any, List, Sequence, Tuple

import numpy as np
import rospy
from sensor_msgs.msg import LaserScan, Range

from mrl_driver.errors import MrlError
from mrl_driver.geometry import Pose
from mrl_driver.navigation.line_follower import Course
from mrl_driver.robot import models
from sim_arduino.experiments import disturbances, l_course
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.l_course import CourseRecord
from sim_arduino.world import world_file

from .experiment_processes import Parts
from .one_robot_node import RATE_HZ, ROBOT, OdometryRobot, TimedPoses, follow, heard, wait_for

STOP_S = 1.0


def drive(parts: Parts, setting: Setting) -> CourseRecord:
    """Drives the course with a robot that has random errors alone; MrlError if a part, a sensor or the drive fails."""
    start = world_file.load(l_course.WORLD).start
    _start(parts, setting, start)
    truth = heard(f"/{ROBOT}/base_pose_ground_truth")
    robot = wait_for(parts, truth)
    robot.reset_pose(start)
    ranges, scans, subscribers = _listen(models.load(setting.robot))
    follow(parts, robot, Course(l_course.WAYPOINTS, l_course.SLOW), STOP_S)
    for subscriber in subscribers:
        subscriber.unregister()
    for name, readings in (("sonar/left and sonar/right", ranges), ("scan", scans)):
        if not readings:
            raise MrlError(f"no message on {name} during the drive, expected readings; see the node's log")
    stamps_s = robot.stamps_s
    cones, beams = (_placed(each, robot, truth) for each in (ranges, scans))
    return CourseRecord(robot.poses_at(stamps_s), cones, beams, truth.at(stamps_s))


def _start(parts: Parts, setting: Setting, start: Pose) -> None:
    """Starts the board, its robot node, and the world node, which is the laser."""
    pose = world_file.pose_text(disturbances.placed(start, setting.seed))
    errors = ("--error", disturbances.WANDER, "--sonar", disturbances.SONAR, "--seed", str(setting.seed))
    place = ("--world", l_course.WORLD, "--world-name", ROBOT, "--pose", pose)
    parts.robot(ROBOT, setting.robot, RATE_HZ, *place, *errors)
    world = {"world": l_course.WORLD, "world_name": ROBOT, "robot": setting.robot}
    parts.node("world_node", ROBOT, only=ROBOT, localise=False, **world)


def _listen(model: models.RobotModel) -> Tuple[List[Any], List[Any], List[rospy.Subscriber]]:
    """The readings of the side sonars and of the laser from now on: time [s], mount in base_link, and reading."""
    ranges: List[Any] = []
    scans: List[Any] = []
    laser = Pose(model.laser.x_m, model.laser.y_m, math.radians(model.laser.yaw_deg))

    def on_range(message: Range, mount: Pose) -> None:
        ranges.append((message.header.stamp.to_sec(), mount, message.range))

    def on_scan(message: LaserScan) -> None:
        scans.append((message.header.stamp.to_sec(), laser, np.array(message.ranges)))

    subscribers = [
        rospy.Subscriber(f"/{ROBOT}/sonar/{name}", Range, on_range, model.sonars[name].pose)
        for name in l_course.SIDES
    ]
    return ranges, scans, [*subscribers, rospy.Subscriber(f"/{ROBOT}/scan", LaserScan, on_scan)]


def _placed(readings: Sequence[Any], robot: OdometryRobot, truth: TimedPoses) -> List[Tuple[Pose, Any, Pose]]:
    """Readings with the pose of their sensor by odometry, and its true pose, at the time of the message."""
    stamps_s = [stamp_s for stamp_s, _, _ in readings]
    places = zip(readings, robot.poses_at(stamps_s), truth.at(stamps_s))
    return [(pose.compose(*mount), value, true.compose(*mount)) for (_, mount, value), pose, true in places]
