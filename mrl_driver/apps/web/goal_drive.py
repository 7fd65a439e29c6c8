"""A goal that is held on the page: each fresh command is one step towards it.  No I/O."""

import math
from typing import Any, NamedTuple, Optional

from mrl_driver.geometry import Pose
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.protocol.stop_reason import StopReason

from .helm import Goal, Why, why_of

LOOK_RAD = 4 * math.pi
"""The robot turns twice on the spot in search of a free path before the goal counts as blocked, as in `mrl goto`."""


class Step(NamedTuple):
    """One step towards the goal."""

    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0
    ended: Optional[Why] = None  # why the robot stops here: the goal is reached, or blocked; None before that
    notice: str = ""  # why the robot waits now, or has stopped; empty while it drives


class GoalDrive:
    """Drives to one goal at a time, in the frame of the poses.

    A new goal, and the first step after `end`, begin a new search with an empty map.
    """

    def __init__(self) -> None:
        self._seeker: Optional[GoalSeeker] = None
        self._goal: Optional[Goal] = None

    def end(self) -> None:
        """Forget the goal: the robot was stopped, or the control was released."""
        self._seeker = self._goal = None

    def step(self, goal: Goal, robot: Any) -> Step:
        """Return the speeds now.  Without a yaw the robot arrives in the direction from here to the goal.

        `robot` is a Driver, or has its `pose`, `ranges`, `limits`, `model` and `now_s`.
        """
        pose, now_s = robot.pose, robot.now_s
        if self._seeker is None or self._goal != goal:
            self._goal = goal
            x_m, y_m, yaw_rad = goal
            if yaw_rad is None:
                yaw_rad = math.atan2(y_m - pose.y_m, x_m - pose.x_m)
            target, sonars = Pose(x_m, y_m, yaw_rad), robot.model.sonars
            self._seeker = GoalSeeker(target, robot.limits, now_s, sonars, look_rad=LOOK_RAD)
        seeker = self._seeker
        linear_m_s, angular_rad_s = seeker.command(pose, robot.ranges, now_s)
        if not (seeker.reached or seeker.blocked):
            return Step(linear_m_s, angular_rad_s, notice=f"waits: {seeker.why}" if seeker.blind else "")
        ended = why_of(StopReason.GOAL_REACHED)
        if not seeker.reached:
            ended = Why(StopReason.GOAL_BLOCKED, f"the goal was not reached: {seeker.why}")
        return Step(ended=ended, notice=ended.words)
