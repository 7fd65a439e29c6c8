"""Compares a robot's map with the walls of the world: what it found, and what is not there."""

import math
from typing import Any, NamedTuple

import numpy as np

from mrl_driver.geometry import ORIGIN, Pose

from .grid_map import FREE, OCCUPIED, GridMap, draw
from .world import World

NEAR_M = 0.10
"""An occupied cell and a wall within this distance are the same [m]: about the error of a URG-04LX at 4 m."""
TRUE_CELL_M = 0.025
REACHES_M = (0.5, 0.5, 0.5, 0.3, 0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.1, 0.1)
"""Cells that are farther than this from a wall do not count in a step of `fitted` [m]."""


class MapScore(NamedTuple):
    """How good a map is."""

    found: float
    """Share of the true wall cells that have an occupied cell near, of those next to the floor that can be reached from
    the start."""
    false: float  # share of the occupied cells that have no wall near; NaN if there is none
    farthest_m: float  # largest distance of an occupied cell from a wall [m]; NaN if there is none


def score(made: GridMap, world: World, frame: Pose = ORIGIN) -> MapScore:
    """The score of a map, whose frame has this pose in the world: a mapper's frame is where its robot began."""
    true = draw(world, TRUE_CELL_M)
    walls, occupied = true.cells == OCCUPIED, points(made.cells == OCCUPIED, made, frame)
    if not len(occupied):
        return MapScore(0.0, math.nan, math.nan)
    found_m = nearest(points(walls & _next_to(true.cells == FREE), true), occupied)
    off_m = nearest(occupied, points(walls, true))
    return MapScore(float(np.mean(found_m <= NEAR_M)), float(np.mean(off_m > NEAR_M)), float(off_m.max()))


def fitted(made: GridMap, world: World, frame: Pose = ORIGIN) -> Pose:
    """The pose of the map's frame near `frame` with which its occupied cells lie best on the walls.

    Each step moves all cells, as one body, to the walls nearest to them, by least squares.  It finds a map that lies up
    to about 0.3 m and 5 deg off.
    """
    true = draw(world, TRUE_CELL_M)
    walls = points(true.cells == OCCUPIED, true)
    for reach_m in REACHES_M:
        occupied = points(made.cells == OCCUPIED, made, frame)
        aims = walls[[int(np.argmin(np.hypot(*(walls - point).T))) for point in occupied]]
        near = np.hypot(*(occupied - aims).T) <= reach_m
        if np.count_nonzero(near) < 3:
            break
        middle, aim = occupied[near].mean(axis=0), aims[near].mean(axis=0)
        (x, y), (to_x, to_y) = (occupied[near] - middle).T, (aims[near] - aim).T
        turn = math.atan2(float(np.sum(x * to_y - y * to_x)), float(np.sum(x * to_x + y * to_y)))
        moved = frame.relative_to(Pose(middle[0], middle[1], 0.0))
        frame = Pose(aim[0], aim[1], turn).compose(*moved)
    return frame


def _next_to(mask: Any) -> Any:
    """The cells of a mask, and those around them."""
    height, width = mask.shape
    padded, found = np.pad(mask, 1), np.zeros(mask.shape, bool)
    for i in range(3):
        for j in range(3):
            found |= padded[i : i + height, j : j + width]
    return found


def points(mask: Any, grid: GridMap, frame: Pose = ORIGIN) -> Any:
    """Centres of the cells in `mask`, `(N, 2)` [m]; `frame` is the pose of the map's frame."""
    rows, columns = np.nonzero(mask)
    x, y, yaw = frame.compose(*grid.origin)
    along, across = (columns + 0.5) * grid.resolution_m, (rows + 0.5) * grid.resolution_m
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.column_stack((x + cos * along - sin * across, y + sin * along + cos * across))


def nearest(of: Any, others: Any) -> Any:
    """Distance of each point in `of`, `(N, 2)`, from the nearest of `others`, `(M, 2)`: `(N,)` [m]."""
    if not len(of) or not len(others):
        return np.full(len(of), np.inf)
    return np.array([np.min(np.hypot(*(others - point).T)) for point in of])


def share_near(of: Any, others: Any, within_m: float) -> float:
    """Share of the points `of` that have one of `others` within a distance; 0 if either is empty."""
    return float(np.mean(nearest(of, others) <= within_m)) if len(of) else 0.0
