"""Where a robot has been: what pictures are drawn from."""

import math
from typing import List, Tuple

from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.geometry import Pose

PERIOD_S = 0.05
MOST_POSES = 20000


class Trail:
    """Poses of a robot while it moves, 20 a second; old ones grow sparse, so that hours fit.

    Attributes:
        poses: Oldest first.
        due_s: When to look next [s].
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.poses: List[Pose] = []
        self.due_s = 0.0
        self._period_s = PERIOD_S

    def look(self, now_s: float) -> None:
        """Notes where the robot is, if it has moved."""
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
    """Left, bottom, right and top of a picture with the world and all poses in it [m]."""
    left, bottom, right, top = plant.world.bounds()
    xs, ys = [left, right, *(p.x_m for p in poses)], [bottom, top, *(p.y_m for p in poses)]
    return min(xs) - margin_m, min(ys) - margin_m, max(xs) + margin_m, max(ys) + margin_m
