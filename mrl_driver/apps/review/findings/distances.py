"""Finds wheels of another size than in the model, by the sonars: walls seen from several places must coincide.

A sonar shows the distance to the nearest point in its cone, which for a wall is the perpendicular one if that direction
is in the cone.  So each reading votes for all walls, as direction and distance from the origin, that touch its arc (a
Hough transform for lines; Leonard and Durrant-Whyte, "Mobile robot localization by tracking geometric beacons", 1991,
call such readings regions of constant depth).  The path is scaled by several factors, and the right one makes the
sharpest walls.
"""

import math
from typing import Any, Iterator, NamedTuple, Tuple

import numpy as np

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.robot.sonar import FIELD_OF_VIEW_RAD

from .evidence import TELEMETRY, Finding, finding, heard, interruptions, outside

FACTORS = np.linspace(0.6, 1.4, 41)  # tried sizes of the wheels, as shares of the model's
LEAST_FACTOR, MOST_FACTOR = 0.7, 1.3
"""A best factor beyond these is none: parallel walls alone fit together the better the shorter the path."""
ONE_WALL = 0.8
"""Share of the votes for walls of one direction, such as those of a corridor, above which there is no answer: the
distance along them cannot be seen. """
WRONG, SHARPER = 0.08, 1.2
"""Wheels are of another size if the best factor differs from 1 by more than `WRONG`: two steps of `FACTORS`, and as
much for the sonars' own curve.  Its walls must be `SHARPER` than the others; right wheels reach 1.18 by chance. """
NEAR_M, FAR_M = 0.2, 4.0  # ranges that are used [m]; farther arcs are wide and often hit corners
LEAST, LEAST_M = 60, 2.0  # number of readings, and distance driven [m], that give an answer
PART_S, PARTS = 100.0, 3
"""A drive is examined in parts of this length [s], because errors of the path grow; at most `PARTS`, spread evenly."""
STEP_S = 0.1  # the path is followed in steps of at most this time [s]
DIRECTIONS, BIN_M, MOST_M = 180, 0.03, 12.0
READING_S = 0.05  # a reading is this much older than its frame, in the mean [s]


class _Readings(NamedTuple):
    """Ranges, and where each was measured: arrays `(N,)`."""

    time_s: Any
    range_m: Any
    x_m: Any
    y_m: Any
    yaw_rad: Any  # pose of the sonar in base_link


class _Path(NamedTuple):
    """Motion between the telemetry frames, in the robot's frame."""

    time_s: Any
    forward_m: Any
    left_m: Any
    turn_rad: Any
    gyro: bool  # the turns are those of the gyro, whatever the size of the wheels


def check(drive: DriveData) -> Iterator[Finding]:
    """Return whether the distances by the wheels fit the sonars."""
    readings, path = _readings(drive), _path(drive)
    if len(readings.time_s) < LEAST or np.abs(path.forward_m).sum() < LEAST_M:
        return
    count = max(1, math.ceil(drive.duration_s / PART_S))
    edges = np.linspace(0.0, drive.duration_s + 1e-6, count + 1)
    votes = np.zeros((len(FACTORS) + 1, DIRECTIONS))
    for part in sorted({int(each) for each in np.linspace(0, count - 1, min(count, PARTS))}):
        chosen = (readings.time_s >= edges[part]) & (readings.time_s < edges[part + 1])
        if chosen.sum() >= LEAST:
            some = _Readings(*(each[chosen] for each in readings))
            votes += [_sharpness(some, path, factor) for factor in (1.0, *FACTORS)]
    scores = votes.sum(axis=1)
    if not scores[0]:
        return
    best = int(np.argmax(scores[1:]))
    factor, sharper = float(FACTORS[best]), scores[1 + best] / scores[0]
    if abs(factor - 1.0) <= WRONG or sharper < SHARPER or not LEAST_FACTOR <= factor <= MOST_FACTOR:
        return
    if _is_one_wall(votes[1 + best]):
        return
    also = "" if path.gyro else " or the wheel separation"
    text = (
        f"The walls that the sonars see fit together if the robot drove {factor:.0%} of the distance by its "
        f"wheels: the wheel size{also} in the model is wrong, or the curve of the sonars."
    )
    farthest = int(np.argmax(np.abs(path.forward_m)))
    yield finding("wheel_size", 61, text, heard(drive, path.time_s[farthest], *TELEMETRY))


def _readings(drive: DriveData) -> _Readings:
    down, rows = interruptions(drive), [np.zeros((0, 5))]
    for name, (times_s, values) in drive.ranges.items():
        if drive.model.sonars[name].kind.infrared:  # the distance along its axis, not to the nearest point
            continue
        used = outside(times_s, down) & (values > NEAR_M) & (values < FAR_M)
        mount = drive.model.sonars[name].pose
        table = np.empty((int(used.sum()), 5))
        table[:, 0], table[:, 1], table[:, 2:] = times_s[used] - READING_S, values[used], mount
        rows.append(table)
    return _Readings(*np.concatenate(rows).T)


def _path(drive: DriveData) -> _Path:
    period_s = drive.duration_s / max(1, len(drive.poses.time_s))
    every = max(1, int(STEP_S / period_s)) if period_s > 0 else 1
    forward, left, turn = drive.steps(every).T
    gyro = len(drive.imu.time_s) > 0 and np.isfinite(drive.imu.values[:, 4]).mean() > 0.5
    return _Path(drive.poses.time_s[::every], forward, left, turn, bool(gyro))


def _placed(path: _Path, factor: float, times_s: Any) -> Tuple[Any, Any, Any]:
    """Poses x, y, yaw at some times, if the wheels have this size."""
    yaw = np.append(0.0, np.cumsum(path.turn_rad * (1.0 if path.gyro else factor)))
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    dx = factor * (path.forward_m * np.cos(middle) - path.left_m * np.sin(middle))
    dy = factor * (path.forward_m * np.sin(middle) + path.left_m * np.cos(middle))
    columns = np.append(0.0, np.cumsum(dx)), np.append(0.0, np.cumsum(dy)), yaw
    x_m, y_m, yaw = (np.interp(times_s, path.time_s, each) for each in columns)
    return x_m, y_m, yaw


def _is_one_wall(votes: Any) -> bool:
    """Return whether nearly all walls have the same direction, or are parallel."""
    both = votes[: DIRECTIONS // 2] + votes[DIRECTIONS // 2 :]
    wide = DIRECTIONS // 8
    around = np.convolve(np.tile(both, 2), np.ones(wide), "valid")
    return bool(around.max() > ONE_WALL * both.sum())


def _sharpness(readings: _Readings, path: _Path, factor: float) -> Any:
    """Sums of the squares of the votes for the walls of each direction, array `(DIRECTIONS,)`."""
    x_m, y_m, yaw = _placed(path, factor, readings.time_s)
    cos, sin = np.cos(yaw), np.sin(yaw)
    x_m, y_m = (x_m + cos * readings.x_m - sin * readings.y_m, y_m + sin * readings.x_m + cos * readings.y_m)
    step = 2 * math.pi / DIRECTIONS
    reach = int(FIELD_OF_VIEW_RAD / 2 / step)
    axis = np.round((yaw + readings.yaw_rad) / step).astype(int)
    direction = (axis[:, None] + np.arange(-reach, reach + 1)) % DIRECTIONS
    angle = direction * step
    far_m = readings.range_m[:, None] + x_m[:, None] * np.cos(angle) + y_m[:, None] * np.sin(angle)
    bins = int(MOST_M / BIN_M)
    place = np.round(far_m / BIN_M).astype(int) + bins // 2
    seen = (place >= 0) & (place < bins)
    votes = np.bincount((direction * bins + place)[seen], minlength=DIRECTIONS * bins).reshape(
        DIRECTIONS, bins
    )
    blurred = 2 * votes[:, 1:-1] + votes[:, 2:] + votes[:, :-2]
    return (blurred * blurred).sum(axis=1)
