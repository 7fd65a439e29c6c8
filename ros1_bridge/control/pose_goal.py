"""The command `pose`: drives to a pose given in the odom frame or in the robot's own frame.  Imports no ROS."""

import math
from typing import Any, Mapping, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.lock_order import new_lock
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.robot.models import SonarMount
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.yaml_file import short
from ros1_bridge.node.plane_poses import planar

from .commander import Commander

STEP_S = 0.05  # the speeds are computed again after this time, or with each frame if frames come more slowly
REACHED = "the pose is reached"
BLOCKED = "the pose is given up"
REFUSED = "the robot is in manual mode; call the service manual_mode with false"


class PoseGoal:
    """Drives to one pose at a time; any thread may call it."""

    def __init__(
        self, commander: Commander, odom_frame: str, base_frame: str, sonars: Mapping[str, SonarMount]
    ) -> None:
        """`sonars`: mounting pose of each sonar, by name."""
        self._sonars = sonars
        self._commander, self._odom, self._base = commander, odom_frame, base_frame
        self._lock = new_lock("pose goal")
        self._goal: Optional[Pose] = None
        self._seeker: Optional[GoalSeeker] = None
        self._due_s = -math.inf

    def start(self, message: Any, now_pose: Pose) -> Pose:
        """Take a geometry_msgs/PoseStamped; returns the goal in the odom frame.

        Raises:
            ValueError: the pose is not finite, or is in another frame, or the robot may not move by itself now.
        """
        if not self._commander.ready:  # it would set off by itself as soon as it may
            raise ValueError(self._commander.refusal())
        frame, goal = message.header.frame_id, planar(message.pose)
        if frame not in ("", self._odom, self._base):
            raise ValueError(
                f"pose is in {short(frame)}, expected {self._odom} (absolute) or {self._base} (relative); "
                "go_to_goal takes goals in other frames"
            )
        if frame == self._base:
            goal = now_pose.compose(*goal)
        with self._lock:
            self._goal, self._seeker, self._due_s = goal, None, -math.inf
            self._commander.seeking = True
            if self._commander.manual:  # asked last, so that a change of the mode meanwhile counts
                self._end()
                raise ValueError(REFUSED)
        return goal

    def cancel(self) -> None:
        """Drop the goal; the caller decides how the robot moves from now on."""
        with self._lock:
            self._end()

    def on_telemetry(self, telemetry: Telemetry) -> str:
        """Drive on towards the pose; returns how it ended, or an empty string.  Raises MrlError as `Commander` does."""
        if self._goal is None or telemetry.arrival_s < self._due_s:
            return ""
        with self._lock:
            goal = self._goal
            if goal is None:
                return ""
            if not self._commander.seeking:
                self._end()
                return f"{BLOCKED}: the robot was stopped, or got another command"
            if self._seeker is not None and self._commander.dropped:
                self._end()
                return f"{BLOCKED}: the robot was stopped ({self._commander.stopped_by})"
            speeds, end = self._step(goal, telemetry.pose, telemetry.ranges, telemetry.arrival_s)
        # The driver writes without this lock, so that `cancel` never waits for the port.
        if speeds is None:
            self._commander.stop()
        elif not self._commander.drive(*speeds):
            with self._lock:
                if self._goal is goal:
                    self._end()
            return f"the pose is given up: {self._commander.refusal()}"
        elif self._goal is not goal or not self._commander.seeking:
            self._commander.stop()  # cancelled or stopped meanwhile: these speeds must not stay in force
        return end

    def _step(
        self, goal: Pose, pose: Pose, ranges: Mapping[str, float], now: float
    ) -> Tuple[Optional[Sequence[float]], str]:
        """Return the speeds, or None and how the drive to the pose ended."""
        self._due_s = now + STEP_S
        if self._seeker is None:
            free = self._commander.limits._replace(
                linear_acceleration_m_s2=math.inf, angular_acceleration_rad_s2=math.inf
            )
            self._seeker = GoalSeeker(goal, free, now, self._sonars)
        speeds = self._seeker.command(pose, ranges, now)
        if not (self._seeker.reached or self._seeker.blocked):
            return speeds, ""
        end = REACHED if self._seeker.reached else f"{BLOCKED}: {self._seeker.why}"
        self._end()
        return None, end

    def _end(self) -> None:
        self._goal = self._seeker = None
        self._commander.seeking = False
