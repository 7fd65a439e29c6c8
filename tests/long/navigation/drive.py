"""Drives a robot to goals with the action `move_base`, judged by true poses.  Imports ROS."""

import math
import time
from typing import Any, List, Sequence

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped
from move_base_msgs.msg import MoveBaseGoal

from mrl_driver.geometry import quaternion_of

from .goals import Goal, Judge, Outcome

END_S = 5.0  # A goal that is cancelled ends within this time


def message_of(goal: Goal, frame: str) -> MoveBaseGoal:
    pose = PoseStamped()
    pose.header.frame_id, pose.header.stamp = frame, rospy.Time.now()
    pose.pose.position.x, pose.pose.position.y = goal[0], goal[1]
    pose.pose.orientation.z, pose.pose.orientation.w = quaternion_of(math.radians(goal[2]))
    return MoveBaseGoal(pose)


def drive(
    client: Any, judge: Judge, goals: Sequence[Goal], limit_s: float, frame: str = "map"
) -> List[Outcome]:
    """How each goal ended; one that takes longer than `limit_s` is cancelled.

    Args:
        client: SimpleActionClient of the action, connected.
        judge: it sees the true poses meanwhile.
        goals: poses in `frame`, which is that of the judge's poses.
    """
    outcomes = []
    for goal in goals:
        judge.contact, judge.recoveries = False, 0
        begun_s = time.monotonic()
        client.send_goal(message_of(goal, frame))
        if not client.wait_for_result(rospy.Duration(limit_s)):
            client.cancel_goal()
            client.wait_for_result(rospy.Duration(END_S))
        succeeded = client.get_state() == actionlib.GoalStatus.SUCCEEDED
        took_s = time.monotonic() - begun_s
        outcomes.append(Outcome(succeeded, *judge.errors(goal), judge.contact, took_s, judge.recoveries))
    return outcomes
