"""Occupancy grids from ranges and known poses: beams of a laser, cones of a sonar; their scores and pictures.

Cells hold log odds.  A laser beam ends in an occupied cell, and the cells before it are free.  A sonar measures the
nearest object in its cone: no object in the cone is closer, and one is somewhere on the arc.  Its position follows
after many cones have marked the free cells.
"""

import math
from typing import Any, Dict, Iterable, List, Mapping, Sequence, Tuple

import numpy as np

from mrl_driver.geometry import Pose, wrap_angles
from sim_arduino.hardware.laser import URG_04LX
from sim_arduino.hardware.sonars import HALF_CONE_RAD
from sim_arduino.world.grid_map import FREE, OCCUPIED, UNKNOWN, GridMap
from sim_arduino.world.world import World

from . import plot_style
from .experiment_report import Figure, Measure, figures
from .experiment_robot import Setting

SONAR_FAR_M = 2.5  # largest range of a sonar that is used [m]
LASER_RAD = URG_04LX.first_rad + np.arange(URG_04LX.rays) * URG_04LX.step_rad
"""Directions of the laser's beams."""
MAX_LOG_ODDS = 12.0  # limit of the log odds, so that new readings can change a cell


LASER_HIT, LASER_FREE, SONAR_HIT, SONAR_FREE = 1.0, -0.4, 0.5, -1.0
"""Log odds of a cell at the end of a reading, and of one before it."""
LASER_BEFORE_M, SONAR_BEFORE_M = 0.05, 0.045
"""Cells closer than the reading minus this are free [m]; it covers the noise."""
LASER_SURE_M = 1.5
"""Ends farther away than this are too uncertain to mark a cell [m]: the URG-04LX errs by 1 cm up to 1 m and by 2 %
beyond."""
SONAR_THICK_M = 0.02  # the end of a sonar's reading is within this distance to both sides [m]


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

    def beams(self, pose: Pose, angles_rad: Any, ranges_m: Any, far_m: float) -> None:
        """Adds a scan from `pose`; `angles_rad` and `ranges_m` are `(N,)`, +inf is free up to `far_m`."""
        known = ~np.isnan(ranges_m) & (ranges_m > 0)
        angles, ranges = angles_rad[known] + pose.yaw_rad, np.minimum(ranges_m[known], far_m)
        hits = np.isfinite(ranges_m[known]) & (ranges < far_m)
        steps = np.arange(0.0, far_m, self.resolution_m / 2)
        reach = np.where(hits, ranges - LASER_BEFORE_M, ranges)
        beam, step = np.nonzero(steps[None, :] < reach[:, None])
        free = self._mask(
            pose.x_m + steps[step] * np.cos(angles[beam]), pose.y_m + steps[step] * np.sin(angles[beam])
        )
        sure = hits & (ranges < LASER_SURE_M)
        ends = self._mask(
            pose.x_m + (ranges * np.cos(angles))[sure], pose.y_m + (ranges * np.sin(angles))[sure]
        )
        self._add(ends, LASER_HIT)
        self._add(free & ~ends, LASER_FREE)

    def cone(self, pose: Pose, half_angle_rad: float, range_m: float, far_m: float) -> None:
        """Adds a sonar's reading from `pose`; +inf is free up to `far_m`."""
        if math.isnan(range_m) or range_m < 0:
            return
        away = np.hypot(self._x - pose.x_m, self._y - pose.y_m)
        bearing = np.arctan2(self._y - pose.y_m, self._x - pose.x_m) - pose.yaw_rad
        inside = np.abs(wrap_angles(bearing)) <= half_angle_rad
        hits = range_m < far_m
        self._add(inside & (away < (range_m - SONAR_BEFORE_M if hits else far_m)), SONAR_FREE)
        if hits:
            self._add(inside & (np.abs(away - range_m) <= SONAR_THICK_M), SONAR_HIT)

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


def maps(
    world: World,
    cones: Sequence[Tuple[Pose, float]],
    scans: Iterable[Tuple[Pose, Any]],
    occupied_from: Mapping[str, float],
    margin_m: float,
    cell_m: float,
) -> Dict[str, GridMap]:
    """The maps by "sonars" and "laser", those that `occupied_from` has with the smallest log odds of a wall cell.

    `cones` are poses of a sonar and its ranges [m], `scans` poses of the laser and its ranges, `(rays,)` [m].
    """
    left, bottom, right, top = world.bounds()
    low, high = (left - margin_m, bottom - margin_m), (right + margin_m, top + margin_m)
    grids = {sensor: Grid(low, high, cell_m) for sensor in occupied_from}
    for pose, range_m in cones:
        grids["sonars"].cone(pose, HALF_CONE_RAD, range_m, SONAR_FAR_M)
    for pose, ranges in scans if "laser" in grids else ():
        grids["laser"].beams(pose, LASER_RAD, ranges, URG_04LX.far_m)
    return {sensor: grid.map(occupied_from[sensor]) for sensor, grid in grids.items()}


def score_rows(key: str, text: str, scores: Sequence[Any], control: Sequence[Any] = ()) -> List[Figure]:
    """Figures of maps whose scores have the shares `found` and `false`."""
    measures = (
        Measure(f"{key}_found_percent", f"{text}: walls found", "%", lambda score: 100 * score.found, min),
        Measure(f"{key}_false_percent", "false cells", "%", lambda score: 100 * score.false),
    )
    return figures(measures, scores, control)


def draw(
    setting: Setting,
    name: str,
    world: World,
    panels: Sequence[Tuple[str, GridMap, Sequence[Pose]]],
    height_in: float,
) -> str:
    """Draws maps side by side, each with a title, the walls, and a path by odometry."""
    made, axes = plot_style.figure(len(panels), 3.8 * len(panels), height_in)
    for axis, (title, grid, path) in zip(axes, panels):
        plot_style.grid(axis, grid)
        plot_style.draw_walls(axis, world.walls, "", plot_style.ORANGE, 0.8)
        plot_style.path(axis, path, plot_style.BLUE, "path by odometry")
        plot_style.floor(axis, title)
        axis.grid(False)
    axes[0].legend(loc="upper left", fontsize="small")
    return plot_style.save(made, setting.folder, name)
