"""Distances to many walls at once, as arrays `(N, 4)` of x1 y1 x2 y2 [m].  Exact: no grid, no steps."""

import math
from typing import Any

import numpy as np

from mrl_driver.geometry import Pose, wrap_angles

_EDGE = 1e-9  # walls are widened by this [ray], so that no ray passes between two walls that meet


def _in_frame(walls: Any, pose: Pose) -> Any:
    """Starts and directions of the walls as seen from `pose`: rows u, v, du, dv [m]."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    dx, dy = walls[:, 0] - pose.x_m, walls[:, 1] - pose.y_m
    ex, ey = walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]
    return cos * dx + sin * dy, cos * dy - sin * dx, cos * ex + sin * ey, cos * ey - sin * ex


def circles(walls: Any) -> Any:
    """The smallest circles around walls, `(3, N)`: rows x, y of the middle and radius [m]."""
    middle = 0.5 * (walls[:, :2] + walls[:, 2:])
    return np.vstack((middle.T, 0.5 * np.hypot(walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1])))


def near_cone(circles: Any, pose: Pose, half_angle_rad: float, range_m: float) -> Any:
    """Indices of the circles that may reach into a cone along the pose's x: all that do, and few others."""
    x, y, radius = circles
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    dx, dy = x - pose.x_m, y - pose.y_m
    u, v = cos * dx + sin * dy, cos * dy - sin * dx
    outside = np.abs(v) * math.cos(half_angle_rad) - u * math.sin(half_angle_rad)
    return (np.maximum(outside, np.maximum(-u, u - range_m)) <= radius + _EDGE).nonzero()[0]


def distances(walls: Any, x: float, y: float) -> Any:
    """Distances from a point to each wall [m], `(N,)`."""
    dx, dy = walls[:, 0] - x, walls[:, 1] - y
    ex, ey = walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]
    length2 = ex * ex + ey * ey
    t = np.clip(-(dx * ex + dy * ey) / np.where(length2 > 0.0, length2, 1.0), 0.0, 1.0)
    return np.hypot(dx + t * ex, dy + t * ey)


def cast(walls: Any, pose: Pose, first_rad: float, step_rad: float, count: int, range_m: float) -> Any:
    """Distances along a fan of `count` rays from `pose` [m], `(count,)`; infinite if nothing is in range.

    The first ray leaves at `first_rad` from the pose's x axis, each next one `step_rad` (positive) further to the left;
    the fan is at most one turn.  Each wall is tested only with the rays that it covers.
    """
    out = np.full(count, np.inf)
    u, v, du, dv = _in_frame(walls[distances(walls, pose.x_m, pose.y_m) <= range_m], pose)
    begin, end = np.arctan2(v, u), np.arctan2(v + dv, u + du)
    span = wrap_angles(end - begin)
    start = np.where(span < 0.0, begin + span, begin)
    wall, ray = _covered(start - first_rad, np.abs(span), step_rad, count)
    angle = first_rad + step_rad * ray
    cos, sin = np.cos(angle), np.sin(angle)
    u, v, du, dv = u[wall], v[wall], du[wall], dv[wall]
    across = cos * dv - sin * du
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (u * dv - v * du) / across
    end_on = np.minimum(np.hypot(u, v), np.hypot(u + du, v + dv))
    along = np.where(np.abs(across) < 1e-12, end_on, along)
    good = (along >= 0.0) & (along <= range_m)
    np.minimum.at(out, ray[good], along[good])
    return out


def _covered(start: Any, span: Any, step_rad: float, count: int) -> Any:
    """Pairs of wall and ray: the rays between `start` and `start + span` [rad from the first ray], in any turn."""
    start = np.remainder(start, math.tau)
    lows, highs, walls = [], [], []
    for turn in (-1.0, 0.0):
        low = np.ceil((start + turn * math.tau) / step_rad - _EDGE)
        high = np.floor((start + span + turn * math.tau) / step_rad + _EDGE)
        low, high = np.maximum(low, 0.0), np.minimum(high, count - 1.0)
        hit = (low <= high).nonzero()[0]
        lows.append(low[hit])
        highs.append(high[hit])
        walls.append(hit)
    low, high, wall = (np.concatenate(parts).astype(np.int64) for parts in (lows, highs, walls))
    counts = high - low + 1
    offset = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.repeat(wall, counts), np.repeat(low, counts) + offset
