"""Drives to a pose, around what the sonars see.  Pure: pose, ranges and time in, speeds out.

The robot turns towards the goal, drives, and turns to the goal's heading.  Where the front sonar sees something near,
the robot turns to the side with more room, goes past for half a metre, and takes up the goal again.
"""

import math
from typing import Mapping, NamedTuple, Optional, Tuple

from .robots import Limits
from .sonar import FARTHEST_M

Pose = Tuple[float, float, float]
"""x [m], y [m], yaw [rad]."""
Speeds = Tuple[float, float]

ARRIVED_M, ALIGNED_RAD = 0.03, math.radians(3.0)
NEAR_M, STOP_M, SIDE_M = 0.55, 0.3, 0.28
"""Ranges at which a detour begins, at which the robot only turns, and that it keeps from what lies beside it."""
PASS_M = 0.5
"""Way straight on after the front has become free."""
TURN_FIRST_RAD = 0.5
"""Further off the goal's direction than this, the robot turns on the spot."""
HEADING_GAIN = 2.0
SLOWING_M = 0.5
SLOWEST_M_S, SLOWEST_RAD_S = 0.03, 0.15
"""Slower than this the motors may not turn at all."""
PROGRESS_M, PATIENCE_S = 0.1, 30.0
"""Blocked is who has not come nearer by so much for so long, unless told otherwise."""


class Detour(NamedTuple):
    """Around something: to the left (1) or right (-1), and where the front became free."""

    side: int
    free_at: Optional[Tuple[float, float]] = None


class GoalSeeker:
    """Seeks one goal (x, y, yaw) in the frame of the poses."""

    def __init__(self, goal: Pose, limits: Limits, now_s: float, patience_s: float = PATIENCE_S) -> None:
        self._goal, self._limits, self._patience_s = goal, limits, patience_s
        self._detour: Optional[Detour] = None
        self._there = False
        self._best_m, self._best_s = math.inf, now_s
        self.reached = self.blocked = False

    def command(self, pose: Pose, ranges: Mapping[str, float], now_s: float) -> Speeds:
        """Speeds (linear [m/s], angular [rad/s]) at a pose; `ranges` maps sonar names to metres (REP-117)."""
        away_m = math.hypot(self._goal[0] - pose[0], self._goal[1] - pose[1])
        self._watch_progress(away_m, now_s)
        self._there = self._there or away_m < ARRIVED_M
        if self._there:
            return self._align(pose)
        if self.blocked:
            return 0.0, 0.0
        front, left, right = (room(ranges.get(name, math.nan)) for name in ("front", "left", "right"))
        if self._detour is None and front < min(NEAR_M, away_m + STOP_M):
            self._detour = Detour(1 if left >= right else -1)
        if self._detour is not None:
            return self._go_round(self._detour, pose, front, left, right)
        return self._approach(pose, away_m, left, right)

    def _watch_progress(self, away_m: float, now_s: float) -> None:
        if away_m < self._best_m - PROGRESS_M:
            self._best_m, self._best_s = away_m, now_s
        elif now_s - self._best_s > self._patience_s and not self._there:
            self.blocked = True

    def _align(self, pose: Pose) -> Speeds:
        error = wrapped(self._goal[2] - pose[2])
        if abs(error) < ALIGNED_RAD:
            self.reached = True
            return 0.0, 0.0
        return 0.0, self._turn(error)

    def _approach(self, pose: Pose, away_m: float, left: float, right: float) -> Speeds:
        error = wrapped(math.atan2(self._goal[1] - pose[1], self._goal[0] - pose[0]) - pose[2])
        if abs(error) > TURN_FIRST_RAD:
            return 0.0, self._turn(error)
        linear = self._limits.linear_m_s * min(1.0, away_m / SLOWING_M) * math.cos(error)
        return max(SLOWEST_M_S, linear), self._bounded(HEADING_GAIN * error + self._shy(left, right))

    def _go_round(self, detour: Detour, pose: Pose, front: float, left: float, right: float) -> Speeds:
        if front < NEAR_M:
            self._detour = Detour(detour.side)
            share = max(0.0, (front - STOP_M) / (NEAR_M - STOP_M))
            turn = detour.side * max(SLOWEST_RAD_S, 0.6 * self._limits.angular_rad_s)
            return 0.3 * self._limits.linear_m_s * share, turn
        if detour.free_at is None:
            self._detour = detour = Detour(detour.side, (pose[0], pose[1]))
        assert detour.free_at is not None
        if math.hypot(pose[0] - detour.free_at[0], pose[1] - detour.free_at[1]) > PASS_M:
            self._detour = None
        return 0.6 * self._limits.linear_m_s, self._bounded(self._shy(left, right))

    def _shy(self, left: float, right: float) -> float:
        """Yaw rate away from what is too near beside."""
        push = max(0.0, SIDE_M - right) - max(0.0, SIDE_M - left)
        return 4.0 * self._limits.angular_rad_s * push

    def _turn(self, error: float) -> float:
        return math.copysign(max(SLOWEST_RAD_S, abs(self._bounded(HEADING_GAIN * error))), error)

    def _bounded(self, rate: float) -> float:
        return max(-self._limits.angular_rad_s, min(self._limits.angular_rad_s, rate))


def room(range_m: float) -> float:
    """Free way before a sonar [m]: none when too near, all of its range when it has no reading."""
    if math.isnan(range_m):
        return FARTHEST_M
    return min(FARTHEST_M, max(0.0, range_m))


def wrapped(angle_rad: float) -> float:
    """The same angle in [-pi, pi] [rad]."""
    return math.remainder(angle_rad, 2 * math.pi)


def carried(pose: Pose, frame: Pose) -> Pose:
    """A pose given in a frame, in the frame's parent, where `frame` is the frame's own pose."""
    cos, sin = math.cos(frame[2]), math.sin(frame[2])
    return (
        frame[0] + cos * pose[0] - sin * pose[1],
        frame[1] + sin * pose[0] + cos * pose[1],
        wrapped(pose[2] + frame[2]),
    )
