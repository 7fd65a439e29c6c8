"""The command `pose`: drives to a pose given in the odom frame or in the robot's own frame.  Imports no ROS."""

import math
import threading
from typing import Any, Mapping, Optional

from mrl_driver.geometry import Pose
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.robot.models import Limits, SonarMount
from mrl_driver.robot.robot_state import Telemetry
from ros1_bridge.node.plane_poses import planar

from .speed_limiter import Commander

STEP_S = 0.05
"""The speeds are computed again after this time, or with each frame if frames come more slowly."""
REACHED = "the pose is reached"
BLOCKED = "the pose is given up"


class PoseGoal:
    """Drives to one pose at a time; any thread may call it."""

    def __init__(
        self, commander: Commander, odom_frame: str, base_frame: str, sonars: Mapping[str, SonarMount]
    ) -> None:
        """`sonars`: mounting pose of each sonar, by name."""
        self._sonars = sonars
        self._commander, self._odom, self._base = commander, odom_frame, base_frame
        self._lock = threading.Lock()
        self._goal: Optional[Pose] = None
        self._seeker: Optional[GoalSeeker] = None
        self._due_s = -math.inf

    @property
    def active(self) -> bool:
        """The robot is driving to a pose."""
        return self._goal is not None

    def start(self, message: Any, now_pose: Pose) -> Pose:
        """Take a geometry_msgs/PoseStamped; returns the goal in the odom frame.

        Raises:
            ValueError: the pose is not finite, or is in another frame.
        """
        frame, goal = message.header.frame_id, planar(message.pose)
        if frame not in ("", self._odom, self._base):
            raise ValueError(
                f"pose is in {frame}, expected {self._odom} (absolute) or {self._base} (relative); "
                "go_to_goal takes goals in other frames"
            )
        if frame == self._base:
            goal = now_pose.compose(*goal)
        with self._lock:
            self._goal, self._seeker, self._due_s = goal, None, -math.inf
            self._commander.seeking = True
        return goal

    def cancel(self) -> None:
        """Drop the goal; the caller decides how the robot moves from now on."""
        with self._lock:
            self._end()

    def on_telemetry(self, telemetry: Telemetry) -> str:
        """Drive on towards the pose; returns how it ended, or an empty string.

        Raises:
            MrlError: see `Commander`.
        """
        if self._goal is None or telemetry.arrival_s < self._due_s:
            return ""
        with self._lock:
            return self._step(self._goal, telemetry.pose, telemetry.ranges, telemetry.arrival_s)

    def _step(self, goal: Optional[Pose], pose: Pose, ranges: Mapping[str, float], now: float) -> str:
        if goal is None:
            return ""
        if self._seeker is not None and self._commander.dropped:
            self._end()
            return f"{BLOCKED}: the robot was stopped ({self._commander.stopped_by})"
        self._due_s = now + STEP_S
        limits = self._commander.limits
        if self._seeker is None:
            free = Limits(limits.linear_m_s, limits.angular_rad_s, math.inf, math.inf)
            self._seeker = GoalSeeker(goal, free, now, self._sonars)
        speeds = self._seeker.command(pose, ranges, now)
        if self._seeker.reached or self._seeker.blocked:
            end = REACHED if self._seeker.reached else f"{BLOCKED}: {self._seeker.why}"
            self._end()
            self._commander.stop()
            return end
        if not self._commander.drive(*speeds):
            self._end()
            return f"the pose is given up: {self._commander.refusal()}"
        return ""

    def _end(self) -> None:
        self._goal = self._seeker = None
        self._commander.seeking = False
