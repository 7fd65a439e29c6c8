"""Compares a robot's map with the walls of the world: what it found, and what is not there."""

import math
from typing import Any, NamedTuple

import numpy as np

from .grid_map import FREE, OCCUPIED, GridMap, draw
from .world import World

NEAR_M = 0.10
"""An occupied cell and a wall within this distance are the same [m]: about the error of a URG-04LX at 4 m."""
TRUE_CELL_M = 0.025


class MapScore(NamedTuple):
    """How good a map is."""

    found: float
    """Share of the true wall cells that have an occupied cell near, of those next to the floor that can be reached from
    the start."""
    false: float  # share of the occupied cells that have no wall near; NaN if there is none
    farthest_m: float  # largest distance of an occupied cell from a wall [m]; NaN if there is none


def score(made: GridMap, world: World) -> MapScore:
    """The score of a map."""
    true = draw(world, TRUE_CELL_M)
    walls, occupied = true.cells == OCCUPIED, points(made.cells == OCCUPIED, made)
    if not len(occupied):
        return MapScore(0.0, math.nan, math.nan)
    found_m = nearest(points(walls & _next_to(true.cells == FREE), true), occupied)
    off_m = nearest(occupied, points(walls, true))
    return MapScore(float(np.mean(found_m <= NEAR_M)), float(np.mean(off_m > NEAR_M)), float(off_m.max()))


def _next_to(mask: Any) -> Any:
    """The cells of a mask, and those around them."""
    height, width = mask.shape
    padded, found = np.pad(mask, 1), np.zeros(mask.shape, bool)
    for i in range(3):
        for j in range(3):
            found |= padded[i : i + height, j : j + width]
    return found


def points(mask: Any, grid: GridMap) -> Any:
    """Centres of the cells in `mask`, `(N, 2)` [m]."""
    rows, columns = np.nonzero(mask)
    x, y, yaw = grid.origin
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
