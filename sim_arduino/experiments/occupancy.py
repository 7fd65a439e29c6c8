"""Occupancy grids from ranges and known poses: beams of a laser, cones of a sonar.

Cells hold log odds.  A laser beam ends in an occupied cell, and the cells before it are free.  A sonar measures the
nearest object in its cone: no object in the cone is closer, and one is somewhere on the arc.  Its position follows
after many cones have marked the free cells.
"""

import math
from typing import Any, NamedTuple, Tuple

import numpy as np

from mrl_driver.geometry import Pose, wrap_angles
from sim_arduino.world.grid_map import FREE, OCCUPIED, UNKNOWN, GridMap

MAX_LOG_ODDS = 12.0
"""Limit of the log odds, so that new readings can change a cell."""


class SensorModel(NamedTuple):
    """The effect of one reading on the grid.

    Attributes:
        hit, free: Log odds of a cell at the end of the reading, and of one before it.
        free_m: Cells closer than the reading minus this are free [m]; it covers the noise.
        thick_m: The end is within this distance to both sides [m].
        sure_m: Ends farther away than this are too uncertain to mark a cell [m].
    """

    hit: float
    free: float
    free_m: float
    thick_m: float
    sure_m: float = math.inf


LASER = SensorModel(hit=1.0, free=-0.4, free_m=0.05, thick_m=0.0, sure_m=1.5)
"""The URG-04LX errs by 1 cm up to 1 m and by 2 % beyond."""
SONAR = SensorModel(hit=0.5, free=-1.0, free_m=0.045, thick_m=0.02)


class Grid:
    """A grid from (x, y) = `low_m` to `high_m`, all cells unknown at first."""

    def __init__(
        self, low_m: Tuple[float, float], high_m: Tuple[float, float], resolution_m: float = 0.025
    ) -> None:
        self.resolution_m, self._low = resolution_m, low_m
        width, height = (math.ceil((b - a) / resolution_m) for a, b in zip(low_m, high_m))
        self.odds = np.zeros((height, width))
        rows, columns = np.mgrid[0:height, 0:width]
        self._x = low_m[0] + (columns + 0.5) * resolution_m
        self._y = low_m[1] + (rows + 0.5) * resolution_m

    def beams(
        self, pose: Pose, angles_rad: Any, ranges_m: Any, far_m: float, sensor: SensorModel = LASER
    ) -> None:
        """Adds a scan from `pose`; `angles_rad` and `ranges_m` are `(N,)`, +inf is free up to `far_m`."""
        known = ~np.isnan(ranges_m) & (ranges_m > 0)
        angles, ranges = angles_rad[known] + pose.yaw_rad, np.minimum(ranges_m[known], far_m)
        hits = np.isfinite(ranges_m[known]) & (ranges < far_m)
        steps = np.arange(0.0, far_m, self.resolution_m / 2)
        reach = np.where(hits, ranges - sensor.free_m, ranges)
        beam, step = np.nonzero(steps[None, :] < reach[:, None])
        free = self._mask(
            pose.x_m + steps[step] * np.cos(angles[beam]), pose.y_m + steps[step] * np.sin(angles[beam])
        )
        sure = hits & (ranges < sensor.sure_m)
        ends = self._mask(
            pose.x_m + (ranges * np.cos(angles))[sure], pose.y_m + (ranges * np.sin(angles))[sure]
        )
        self._add(ends, sensor.hit)
        self._add(free & ~ends, sensor.free)

    def cone(
        self, pose: Pose, half_angle_rad: float, range_m: float, far_m: float, sensor: SensorModel = SONAR
    ) -> None:
        """Adds a sonar's reading from `pose`; +inf is free up to `far_m`."""
        if math.isnan(range_m) or range_m < 0:
            return
        away = np.hypot(self._x - pose.x_m, self._y - pose.y_m)
        bearing = np.arctan2(self._y - pose.y_m, self._x - pose.x_m) - pose.yaw_rad
        inside = np.abs(wrap_angles(bearing)) <= half_angle_rad
        hits = range_m < far_m
        self._add(inside & (away < (range_m - sensor.free_m if hits else far_m)), sensor.free)
        if hits:
            self._add(inside & (np.abs(away - range_m) <= sensor.thick_m), sensor.hit)

    def _mask(self, x: Any, y: Any) -> Any:
        """Mask of the cells that contain the points, `(height, width)`."""
        mask = np.zeros(self.odds.shape, bool)
        columns = np.floor((x - self._low[0]) / self.resolution_m).astype(int)
        rows = np.floor((y - self._low[1]) / self.resolution_m).astype(int)
        inside = (rows >= 0) & (rows < mask.shape[0]) & (columns >= 0) & (columns < mask.shape[1])
        mask[rows[inside], columns[inside]] = True
        return mask

    def _add(self, mask: Any, odds: float) -> None:
        self.odds[mask] = np.clip(self.odds[mask] + odds, -MAX_LOG_ODDS, MAX_LOG_ODDS)

    def map(self, occupied: float = 0.0) -> GridMap:
        """The map: cells above `occupied` are walls, cells below 0 are free."""
        cells = np.where(self.odds > occupied, OCCUPIED, np.where(self.odds < 0, FREE, UNKNOWN))
        return GridMap(cells.astype(np.int8), self.resolution_m, Pose(*self._low, 0.0))
