"""The path that a robot has travelled.  No I/O."""

import math
from typing import List

from mrl_driver.geometry import Pose

STEP_M = 0.01
MOST_POSES = 4000


class Trail:
    """Poses of a robot: one per centimetre, fewer on a long path."""

    def __init__(self) -> None:
        self.poses: List[Pose] = []
        self.distance_m = 0.0  # length of the path [m]
        self._step_m = STEP_M

    def add(self, pose: Pose) -> None:
        """Add the robot's pose now."""
        if not self.poses:
            self.poses.append(pose)
        step_m = math.dist(pose[:2], self.poses[-1][:2])
        if step_m < self._step_m:
            return
        self.poses.append(pose)
        self.distance_m += step_m
        if len(self.poses) > MOST_POSES:
            self.poses, self._step_m = self.poses[::2], self._step_m * 2

    def clear(self) -> None:
        """Forget all but the newest pose."""
        self.poses = self.poses[-1:]
        self.distance_m, self._step_m = 0.0, STEP_M
