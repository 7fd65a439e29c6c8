"""A goal that is held on the page: each fresh command is one step towards it.  No I/O."""

import math
from typing import Mapping, NamedTuple, Optional, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.robot.models import Limits, SonarMount

LOOK_RAD = 4 * math.pi
"""The robot turns twice on the spot in search of a free path before the goal counts as blocked, as in `mrl goto`."""
REACHED = "the goal is reached"


class Step(NamedTuple):
    """One step towards the goal."""

    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0
    ended: str = ""
    """Why the robot stops here: the goal is reached, or blocked; empty before that."""
    notice: str = ""
    """Why the robot waits now; empty if it does not."""


class GoalDrive:
    """Drives to one goal at a time, in the frame of the poses.

    A new goal, and the first step after `end`, begin a new search with an empty map.
    """

    def __init__(self) -> None:
        self._seeker: Optional[GoalSeeker] = None
        self._goal: Optional[Tuple[Pose, bool]] = None

    @property
    def goal(self) -> Optional[Pose]:
        """The goal that the robot drives to; None without one."""
        return self._goal[0] if self._goal else None

    def end(self) -> None:
        """Forget the goal: the robot was stopped, or the control was released."""
        self._seeker = self._goal = None

    def step(
        self,
        goal: Pose,
        has_yaw: bool,
        pose: Pose,
        ranges: Mapping[str, float],
        limits: Limits,
        sonars: Mapping[str, SonarMount],
        now_s: float,
    ) -> Step:
        """Return the speeds now.  Without `has_yaw` the robot arrives in the direction from here to the goal."""
        if self._seeker is None or self._goal != (goal, has_yaw):
            self._goal = goal, has_yaw
            yaw_rad = goal.yaw_rad if has_yaw else math.atan2(goal.y_m - pose.y_m, goal.x_m - pose.x_m)
            target = Pose(goal.x_m, goal.y_m, yaw_rad)
            self._seeker = GoalSeeker(target, limits, now_s, sonars, look_rad=LOOK_RAD)
        seeker = self._seeker
        linear_m_s, angular_rad_s = seeker.command(pose, ranges, now_s)
        if seeker.reached:
            return Step(ended=REACHED)
        if seeker.blocked:
            return Step(ended=f"the goal was not reached: {seeker.why}")
        return Step(linear_m_s, angular_rad_s, notice=f"waits: {seeker.why}" if seeker.blind else "")
