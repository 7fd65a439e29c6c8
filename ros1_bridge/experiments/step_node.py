"""The node that runs the step test: `follow_waypoints` drives the robot; a mirror in another process follows `odom`."""

import time
from contextlib import ExitStack, closing

import rospy
from nav_msgs.msg import Odometry

from mrl_driver.navigation.waypoint_tour import DONE, PAUSED
from ros1_bridge.node.plane_poses import planar
from sim_arduino.experiments import step_test
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.step_test import START, Live, Mirrored, StepDrive
from sim_arduino.experiments.team import Member, Team

from .experiment_processes import Parts
from .one_robot_node import ignore
from .team_node import TopicRobot, begin_tour, gather, watch

NAME, MOST_S = "robot", 300.0
"""The robot's namespace, and the longest drive [s]."""


def drive(parts: Parts, setting: Setting) -> Live:
    """Drives the steps; the mirror receives the pose of each odometry message.

    The delay is that of a pose from the board, which read its counters at the message's stamp, to the mirror.
    MrlError if a part fails, or a waypoint is not reached.
    """
    with ExitStack() as stack:
        members = [Member(NAME, START, virtual=False, robot=setting.robot)]
        team = gather(stack, parts, setting, members, navigated=True, world=step_test.WORLD)
        (player,) = team.players
        with closing(Mirrored(setting.robot)) as mirror:
            try:
                _drive(parts, team, player.robot, mirror)
            finally:
                player.robot.on_odometry = ignore
    return StepDrive(player.path, player.odometry_path, player.bumps, player.robot.visits), mirror


def _drive(parts: Parts, team: Team, robot: TopicRobot, mirror: Mirrored) -> None:
    def send(message: Odometry) -> None:
        read_s = time.monotonic() - (rospy.Time.now() - message.header.stamp).to_sec()
        mirror.send(START.compose(*planar(message.pose.pose)), read_s)

    robot.on_odometry = send
    mirror.wait()
    begin_tour(parts, NAME, step_test.goals())

    def over(_: float) -> bool:
        parts.check()
        return robot.tour in (DONE, PAUSED)

    watch(team, MOST_S, over)
    step_test.require_end(robot.visits, robot.pose)
