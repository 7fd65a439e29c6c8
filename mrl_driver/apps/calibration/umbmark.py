"""UMBmark (Borenstein and Feng 1996): squares in both directions separate unequal wheels from a wrong wheelbase.

The robot starts at the origin and looks along x; a counter-clockwise square lies to its left.  An error is the measured
end minus that of the odometry.  A wrong wheelbase (type A) turns each corner too far by the same angle, in both
directions.  Unequal wheels (type B) bend each side in the same direction.
"""

import math
from typing import NamedTuple, Sequence, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.robot.models import MecanumDrive

from .fit import Geometry

LEAST_LAPS, MOST_LAPS = 2, 50  # laps in each direction; fewer show no spread.  The paper drives 5.

Point = Tuple[float, float]


class UmbmarkResult(NamedTuple):
    """Result of UMBmark; angles in rad, positive counter-clockwise."""

    left_centre: Point  # mean error of the counter-clockwise laps [m]
    right_centre: Point  # mean error of the clockwise laps [m]
    corner_excess_rad: float  # type A: true turn of a corner minus the turn by odometry
    side_bend_rad: float  # type B: true turn on a straight side
    wheel_ratio: float  # E_d: true ratio of right to left wheel, divided by the ratio in use
    wheelbase_ratio: float  # E_b: true wheelbase divided by the one in use
    worst_m: float
    """The paper's measure of accuracy: the distance from zero of the centre that is farther away."""


def closed_form(
    left: Sequence[Point], right: Sequence[Point], side_m: float, separation_m: float
) -> UmbmarkResult:
    """The paper's closed form, exact for small errors; raise ConfigError if there are too few laps.

    `left` and `right` are errors of the counter-clockwise and the clockwise laps (x, y) [m], and `separation_m` is the
    effective wheelbase in use.
    """
    for laps, direction in ((len(left), "counter-clockwise"), (len(right), "clockwise")):
        if not LEAST_LAPS <= laps <= MOST_LAPS:
            raise ConfigError(f"there are {laps} {direction} laps, expected {LEAST_LAPS} to {MOST_LAPS}")
    xl, yl = _centre(left)
    xr, yr = _centre(right)
    corner = ((xl + xr) + (yr - yl)) / (8 * side_m)
    bend = ((xl - xr) - (yl + yr)) / (8 * side_m)
    return UmbmarkResult(
        (xl, yl),
        (xr, yr),
        corner,
        bend,
        wheel_ratio(bend, side_m, separation_m),
        (math.pi / 2) / (math.pi / 2 + corner),
        max(math.hypot(xl, yl), math.hypot(xr, yr)),
    )


def wheel_ratio(bend_rad: float, side_m: float, separation_m: float) -> float:
    """E_d of a robot that turns `bend_rad` on a side."""
    if bend_rad == 0.0:
        return 1.0
    radius_m = side_m / 2 / math.sin(bend_rad / 2)
    return (radius_m + separation_m / 2) / (radius_m - separation_m / 2)


def corrected(drive: Geometry, result: UmbmarkResult, tracks: bool) -> Geometry:
    """The drive with both corrections; on tracks and mecanum wheels the slip is corrected instead of the wheelbase."""
    ratio = (2 + drive.wheel_offset) / (2 - drive.wheel_offset) * result.wheel_ratio
    drive = drive._replace(wheel_offset=2 * (ratio - 1) / (ratio + 1))
    if tracks or isinstance(drive, MecanumDrive):
        return drive._replace(turn_slip=1 - (1 - drive.turn_slip) / result.wheelbase_ratio)
    return drive._replace(wheel_separation_m=drive.wheel_separation_m * result.wheelbase_ratio)


def _centre(points: Sequence[Point]) -> Point:
    return sum(x for x, _ in points) / len(points), sum(y for _, y in points) / len(points)
