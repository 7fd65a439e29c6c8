"""The path that a robot has travelled, for pictures."""

import math
from typing import List, Tuple

from mrl_driver.geometry import Pose
from sim_arduino.hardware.wiring import Plant

PERIOD_S = 0.05
MOST_POSES = 20000


class Trail:
    """Poses of a robot while it moves, 20 per second; the list is thinned out when it is full, so that hours fit.

    Attributes:
        poses: Poses, oldest first.
        due_s: Time of the next look [s].
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.poses: List[Pose] = []
        self.due_s = 0.0
        self._period_s = PERIOD_S

    def look(self, now_s: float) -> None:
        """Stores the robot's pose if it has moved."""
        self.due_s = now_s + self._period_s
        pose = self.plant.true_pose
        if not self.poses or pose != self.poses[-1]:
            self.poses.append(pose)
        if len(self.poses) > MOST_POSES:
            self.poses = self.poses[::2]
            self._period_s *= 2.0

    def way_m(self) -> float:
        """Length of the path [m]."""
        return sum(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in zip(self.poses, self.poses[1:]))


def frame(plant: Plant, poses: List[Pose], margin_m: float = 0.2) -> Tuple[float, float, float, float]:
    """Left, bottom, right and top of a picture that shows the world and all poses [m]."""
    left, bottom, right, top = plant.world.bounds()
    xs, ys = [left, right, *(p.x_m for p in poses)], [bottom, top, *(p.y_m for p in poses)]
    return min(xs) - margin_m, min(ys) - margin_m, max(xs) + margin_m, max(ys) + margin_m
