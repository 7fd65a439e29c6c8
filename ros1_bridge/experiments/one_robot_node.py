"""The part of nodes that drives emulated robots by `cmd_vel`, and knows their poses at the times of messages."""

import time
from typing import Callable, List, Sequence, Tuple

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from mrl_driver.errors import MrlError
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.navigation.line_follower import Course
from ros1_bridge.demo.processes import wait_until
from ros1_bridge.node.cmd_vel import twist_of
from ros1_bridge.node.plane_poses import planar
from sim_arduino.experiments.mapping import pose_at

from .experiment_processes import START_S, Parts

ROBOT = "robot"
"""Namespace of a single robot."""
RATE_HZ = 20
MOST_S = 180.0
"""Time limit of a course [s]."""


_Then = Callable[[Odometry], None]


def ignore(_: Odometry) -> None:
    """Ignore a message."""


class TimedPoses(List[Tuple[float, Pose]]):
    """Poses and their times [s], which rise."""

    @property
    def last(self) -> Pose:
        """The last pose."""
        return self[-1][1]

    def at(self, stamps_s: Sequence[float]) -> List[Pose]:
        """Poses at these times, linear between two of them; the first before all, the last after all."""
        return [pose_at(self, stamp_s) for stamp_s in stamps_s]


def heard(topic: str, then: _Then = ignore) -> TimedPoses:
    """The poses of a topic with Odometry, from now on; `then` gets each message."""
    poses = TimedPoses()

    def keep(message: Odometry) -> None:
        poses.append((message.header.stamp.to_sec(), planar(message.pose.pose)))
        then(message)

    rospy.Subscriber(topic, Odometry, keep, tcp_nodelay=True)
    return poses


class OdometryRobot:
    """A robot reached through `cmd_vel` and `odom`.

    Args:
        space: Its namespace, with the leading slash.
        driven: Whether this node drives it.
        then: Gets each odometry message.
    """

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
        return self._in_frame(self._odometry.last)

    @property
    def stamps_s(self) -> List[float]:
        """The times of all poses by odometry [s]."""
        return [stamp_s for stamp_s, _ in self._odometry]

    def poses_at(self, stamps_s: Sequence[float]) -> List[Pose]:
        """Poses by odometry at these times [s]."""
        return [self._in_frame(pose) for pose in self._odometry.at(stamps_s)]

    def reset_pose(self, pose: Pose) -> None:
        """Sets the pose by odometry at which the robot is now."""
        self._first, self._mark = self._odometry.last, pose

    def _in_frame(self, pose: Pose) -> Pose:
        return self._mark.compose(*pose.relative_to(self._first))

    def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Publishes these speeds, unless another node drives."""
        if self._cmd_vel is not None:
            self._cmd_vel.publish(twist_of(linear_m_s, angular_rad_s))


def wait_for(parts: Parts, *known: TimedPoses, then: _Then = ignore) -> OdometryRobot:
    """The robot, when all poses have come; `then` gets each odometry message.  MrlError if a part fails, or is late."""
    robot = OdometryRobot(then=then)
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
