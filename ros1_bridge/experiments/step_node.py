"""The node that drives the step test: sends goals to `go_to_goal`; a mirror in another process follows `odom`."""

import math
import time
from contextlib import ExitStack

import rospy
from nav_msgs.msg import Odometry

from mrl_driver.errors import MrlError
from mrl_driver.geometry import ORIGIN, Pose
from ros1_bridge.node.plane_poses import planar
from sim_arduino.experiments import step_test
from sim_arduino.experiments.experiment_report import Result
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.step_test import Mirrored, StepRecord
from sim_arduino.experiments.team import Member, Player

from .experiment_processes import Parts
from .team_node import TopicRobot, gather, ignore

REMARK = (
    "Through ROS, in real time: the delay is that of a pose from the board, which read its counters at the message's "
    "stamp, to the mirror."
)


def play(_: str, parts: Parts, setting: Setting) -> Result:
    """Drives the steps; the mirror receives the pose of each odometry message."""
    with ExitStack() as stack:
        members = [Member("robot", ORIGIN, virtual=False, robot=setting.robot)]
        (player,) = gather(stack, parts, setting, members, navigated=True, world="square").players
        assert isinstance(player.robot, TopicRobot)
        mirror = Mirrored(setting.robot)
        try:
            _drive(parts, player, player.robot, mirror)
        finally:
            player.robot.stop()
            player.robot.on_odometry = ignore
            mirror.close()
    odometry, true = ([tuple(pose) for pose in path] for path in (player.odometry_path, player.path))
    return step_test.outcome(setting, StepRecord(odometry, true, mirror.poses, mirror.delays_s), REMARK)


def _drive(parts: Parts, player: Player, robot: TopicRobot, mirror: Mirrored) -> None:
    robot.on_odometry = lambda message: mirror.send(planar(message.pose.pose), _monotonic_s(message))
    mirror.wait()
    for waypoint in step_test.WAYPOINTS:
        _go(parts, player, Pose(*waypoint, 0.0))


def _monotonic_s(message: Odometry) -> float:
    """Time at which the board read its counters [s, monotonic]."""
    return time.monotonic() - (rospy.Time.now() - message.header.stamp).to_sec()


def _go(parts: Parts, player: Player, point: Pose) -> None:
    """Drive to a waypoint, with the final heading along the line from the start to it."""
    pose = player.robot.pose
    heading = math.atan2(point.y_m - pose.y_m, point.x_m - pose.x_m)
    seek = player.robot.seek(point._replace(yaw_rad=heading))
    end_s = time.monotonic() + step_test.TIME_LIMIT_S
    step = seek(player.ranges())
    while not step.reached:
        parts.check()
        if step.blocked or time.monotonic() > end_s:
            raise MrlError(f"waypoint {point[:2]} is not reached from {pose}; clear the path")
        player.step(step.speeds)
        step = seek(player.ranges())
