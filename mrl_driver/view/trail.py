"""The path that a robot has travelled.  No I/O."""

import math
from typing import List

from mrl_driver.geometry import Pose

STEP_M = 0.01
MOST_POSES = 4000
FASTEST_M_S = 5.0  # no robot's file allows more


class Trail:
    """Poses of a robot: one per centimetre, fewer on a long path."""

    def __init__(self) -> None:
        self.poses: List[Pose] = []
        self.distance_m = 0.0  # length of the path [m]
        self._step_m, self._stamp_s = STEP_M, math.nan

    def add(self, pose: Pose, stamp_s: float = math.nan) -> None:
        """Add the robot's pose at this time [s].  If that is given, a pose that no robot could reach meanwhile was set,
        and begins a new path.
        """
        gap_s, self._stamp_s = abs(stamp_s - self._stamp_s), stamp_s
        if not self.poses:
            self.poses.append(pose)
        step_m = math.dist(pose[:2], self.poses[-1][:2])
        if step_m < self._step_m:
            return
        self.poses.append(pose)
        if step_m > self._step_m + FASTEST_M_S * gap_s:
            self.clear()
            return
        self.distance_m += step_m
        if len(self.poses) > MOST_POSES:
            self.poses, self._step_m = self.poses[::2], self._step_m * 2

    def clear(self) -> None:
        """Forget all but the newest pose."""
        self.poses = self.poses[-1:]
        self.distance_m, self._step_m = 0.0, STEP_M
