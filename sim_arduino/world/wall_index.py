"""Distances to fixed walls: a loop for few walls, arrays for many."""

import math
from typing import Any, List, Sequence

from mrl_driver.geometry import Pose

from .shapes import Wall, distance, nearest_in_cone

FEW = 96  # up to this number of walls a loop is as fast as arrays, and it starts faster


class WallIndex:
    """Exact answers about a fixed set of walls."""

    def __init__(self, walls: Sequence[Wall]) -> None:
        self.walls = list(walls)
        self._array: Any = None
        self._circles: Any = None

    def array(self) -> Any:
        """The walls as `(N, 4)`, columns x1 y1 x2 y2 [m]."""
        if self._array is None:
            import numpy as np

            self._array = np.array(self.walls, dtype=float).reshape(-1, 4)
        return self._array

    def nearest(self, pose: Pose, half_angle_rad: float, range_m: float) -> float:
        """Distance to the nearest point of any wall in a cone along the pose's x [m]; infinite beyond range."""
        if len(self.walls) <= FEW:
            return nearest_in_cone(self.walls, pose, half_angle_rad, range_m)
        from . import rays

        if self._circles is None:
            self._circles = rays.circles(self.array())
        near = rays.near_cone(self._circles, pose, half_angle_rad, range_m)
        return nearest_in_cone([self.walls[i] for i in near.tolist()], pose, half_angle_rad, range_m)

    def clearance(self, x: float, y: float) -> float:
        """Distance from a point to the nearest wall [m]; infinite without walls."""
        if len(self.walls) <= FEW:
            return min((distance(wall, x, y) for wall in self.walls), default=math.inf)
        from . import rays

        return float(rays.distances(self.array(), x, y).min())

    def near(self, x: float, y: float, radius_m: float) -> List[Wall]:
        """Walls that are closer to a point than `radius_m`."""
        if len(self.walls) <= FEW:
            return [wall for wall in self.walls if distance(wall, x, y) < radius_m]
        from . import rays

        return [self.walls[i] for i in (rays.distances(self.array(), x, y) < radius_m).nonzero()[0].tolist()]
