"""The node that runs experiments with one emulated robot, driven by `cmd_vel`: the square, the L-course."""

import math
import os
import time
from typing import Any, Callable, List, Sequence, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan, Range

from mrl_driver.apps.calibration.ground_truth import Truth, truth_file
from mrl_driver.errors import MrlError
from mrl_driver.geometry import ORIGIN, Pose, wrap_angle
from mrl_driver.navigation.line_follower import Course, FollowerLimits
from mrl_driver.robot import models
from ros1_bridge.node.cmd_vel import twist_of
from ros1_bridge.node.plane_poses import planar
from ros1_bridge.node.processes import wait_until
from sim_arduino.experiments import disturbances, l_course, square
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.l_course import CourseRecord
from sim_arduino.world import world_file
from sim_arduino.world.world_file import pose_text

from .legs import START_S, Parts

ROBOT = "robot"
"""Namespace of a single robot."""
RATE_HZ = 20
MOST_S = 180.0
"""Time limit of a course [s]."""
LAP = ((1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0), (0.05, 0.0))
"""A counter-clockwise lap; the last point makes the robot turn to its first heading."""
LAP_LIMITS = FollowerLimits(square.SPEEDS.linear_m_s, square.SPEEDS.angular_rad_s)
LAP_STOP_S, COURSE_STOP_S = 2.0, 1.0  # the robot stands for this time at the end
_Then = Callable[[Odometry], None]
TimedPoses = List[Tuple[float, Pose]]
"""Times [s], which rise, and poses."""


def ignore(_: Odometry) -> None:
    """Ignore a message."""


def heard(topic: str, then: _Then = ignore) -> TimedPoses:
    """The poses of a topic with Odometry, from now on; `then` gets each message."""
    poses: TimedPoses = []

    def keep(message: Odometry) -> None:
        poses.append((message.header.stamp.to_sec(), planar(message.pose.pose)))
        then(message)

    rospy.Subscriber(topic, Odometry, keep, tcp_nodelay=True)
    return poses


class OdometryRobot:
    """A robot reached through `cmd_vel`, if this node drives it, and `odom`; `then` gets each odometry message."""

    def __init__(self, space: str = f"/{ROBOT}", driven: bool = True, then: _Then = ignore) -> None:
        self._first, self._mark = ORIGIN, ORIGIN
        self._odometry = heard(f"{space}/odom", then)
        self._cmd_vel = (
            rospy.Publisher(f"{space}/cmd_vel", Twist, queue_size=1, tcp_nodelay=True) if driven else None
        )

    @property
    def known(self) -> bool:
        """Whether a pose has come."""
        return len(self._odometry) > 0

    @property
    def pose(self) -> Pose:
        """The last pose by odometry."""
        return self._in_frame(self._odometry[-1][1])

    @property
    def path(self) -> TimedPoses:
        """All poses by odometry."""
        return [(stamp_s, self._in_frame(pose)) for stamp_s, pose in self._odometry]

    def reset_pose(self, pose: Pose) -> None:
        """Sets the pose by odometry at which the robot is now."""
        self._first, self._mark = self._odometry[-1][1], pose

    def _in_frame(self, pose: Pose) -> Pose:
        return self._mark.compose(*pose.relative_to(self._first))

    def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Publishes these speeds, unless another node drives."""
        if self._cmd_vel is not None:
            self._cmd_vel.publish(twist_of(linear_m_s, angular_rad_s))


def wait_for(parts: Parts, *known: TimedPoses) -> OdometryRobot:
    """The robot, when all poses have come; MrlError if a part fails, or is late."""
    robot = OdometryRobot()
    wait_until(lambda: parts.check() or (robot.known and all(map(len, known))), START_S)  # type: ignore[func-returns-value]
    if not robot.known:
        raise MrlError(f"no odometry after {START_S:g} s")
    if not all(map(len, known)):
        raise MrlError(f"no true pose after {START_S:g} s")
    return robot


def follow(parts: Parts, robot: OdometryRobot, course: Course, stop_s: float) -> None:
    """Drives a course to its end, then stands for `stop_s`; MrlError if a part fails, or the robot does not arrive."""
    end_s = time.monotonic() + MOST_S
    while not course.done:
        parts.check()
        if time.monotonic() > end_s:
            raise MrlError(f"the robot has not arrived after {MOST_S:g} s; clear the path")
        robot.drive(*course.command(robot.pose))
        time.sleep(1 / RATE_HZ)
    robot.drive(0.0, 0.0)
    time.sleep(stop_s)


# -- the square


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
    follow(parts, robot, Course(LAP, LAP_LIMITS), LAP_STOP_S)
    end, found = (ruler.end("lap", lambda _: None) for ruler in (truth, by_odometry))
    return Pose(end.x_m - found.x_m, end.y_m - found.y_m, wrap_angle(end.yaw_rad - found.yaw_rad))


# -- the L-course


def drive(parts: Parts, setting: Setting) -> CourseRecord:
    """Drives the course with a robot that has random errors alone; MrlError if a part, a sensor or the drive fails."""
    start = world_file.load(l_course.WORLD).start
    _start_in_course(parts, setting, start)
    truth = heard(f"/{ROBOT}/base_pose_ground_truth")
    robot = wait_for(parts, truth)
    robot.reset_pose(start)
    ranges, scans, subscribers = _listen(models.load(setting.robot))
    follow(parts, robot, Course(l_course.WAYPOINTS, l_course.SLOW), COURSE_STOP_S)
    for subscriber in subscribers:
        subscriber.unregister()
    for name, readings in (("sonar/left and sonar/right", ranges), ("scan", scans)):
        if not readings:
            raise MrlError(f"no message on {name} during the drive, expected readings; see the node's log")
    path = robot.path
    cones, beams = (_placed(each, path, truth) for each in (ranges, scans))
    times_s, poses = zip(*path)
    return CourseRecord([*poses], cones, beams, poses_at(truth, times_s))


def _start_in_course(parts: Parts, setting: Setting, start: Pose) -> None:
    """Starts the board, its robot node, and the world node, which is the laser."""
    pose = pose_text(disturbances.placed(start, setting.seed))
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


def _placed(readings: Sequence[Any], path: TimedPoses, truth: TimedPoses) -> List[Tuple[Pose, Any, Pose]]:
    """Readings with the pose of their sensor by odometry, and its true pose, at the time of the message."""
    times_s = [time_s for time_s, _, _ in readings]
    return [
        (pose.compose(*mount), value, true.compose(*mount))
        for (_, mount, value), pose, true in zip(readings, poses_at(path, times_s), poses_at(truth, times_s))
    ]


def poses_at(path: TimedPoses, times_s: Sequence[float]) -> List[Pose]:
    """The poses at these times, between the two around each; the first or last one beyond the ends."""
    stamps_s, poses = zip(*path)
    x_m, y_m, yaw_rad = zip(*poses)
    columns = (np.interp(times_s, stamps_s, each).tolist() for each in (x_m, y_m, np.unwrap(yaw_rad)))
    return list(map(Pose, *columns))
