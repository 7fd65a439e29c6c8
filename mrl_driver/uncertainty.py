"""How sure odometry is of its pose: random errors of the wheels and of slip, carried along the way.  Pure.

First-order propagation for a differential drive (Siegwart, Nourbakhsh: Introduction to Autonomous Mobile Robots,
section 5.2.4): the variance of each wheel's way grows with its length, the wheels independently; that of the yaw
grows further with the angle turned, as tracks slip in turns.
"""

import math
from typing import NamedTuple, Tuple

from .odometry import Geometry
from .robots import Noise

START_POSITION_M2, START_YAW_RAD2 = 1e-6, 1e-6
"""1 mm and 1 mrad: what a standing robot starts with, as filters refuse zeros."""


class Spread(NamedTuple):
    """Covariance of x, y and yaw: the upper triangle, row by row [m2, m rad, rad2]."""

    xx: float
    xy: float
    xt: float
    yy: float
    yt: float
    tt: float


AT_START = Spread(START_POSITION_M2, 0.0, 0.0, START_POSITION_M2, 0.0, START_YAW_RAD2)


class Uncertainty:
    """Carries a `Spread` along the counts of one robot."""

    def __init__(self, drive: Geometry, noise: Noise, spread: Spread = AT_START) -> None:
        self._metres = drive.right_m_per_count, drive.left_m_per_count
        self._base_m = drive.turning_separation_m
        self._noise = noise
        self.spread = spread

    def move(self, right: float, left: float, yaw_rad: float) -> Spread:
        """The wheels went so far [count], and the heading is now `yaw_rad`; the spread from now on."""
        right_m, left_m = right * self._metres[0], left * self._metres[1]
        turn = (right_m - left_m) / self._base_m
        self.spread = propagate(
            self.spread, right_m, left_m, yaw_rad - turn / 2, self._base_m, turn, self._noise
        )
        return self.spread


def propagate(
    spread: Tuple[float, ...],
    right_m: float,
    left_m: float,
    heading_rad: float,
    base_m: float,
    turn_rad: float,
    noise: Noise,
) -> Spread:
    """The spread after one step.

    Args:
        right_m, left_m: ways of the wheels.
        heading_rad: in the middle of the step.
        base_m: `turning_separation_m` of the drive.
        turn_rad: yaw of this step.
    """
    xx, xy, xt, yy, yt, tt = spread
    way_m = (right_m + left_m) / 2
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    right, left = noise[0] * abs(right_m), noise[0] * abs(left_m)
    lean = way_m / 2 / base_m
    xr, xl = cos / 2 - lean * sin, cos / 2 + lean * sin
    yr, yl = sin / 2 + lean * cos, sin / 2 - lean * cos
    dx, dy = -way_m * sin, way_m * cos
    slip = noise[1] * abs(turn_rad)
    hx, hy = dx / 2 * slip, dy / 2 * slip
    return Spread(
        xx + dx * (2 * xt + dx * tt) + xr * xr * right + xl * xl * left + hx * dx / 2,
        xy + dx * yt + dy * xt + dx * dy * tt + xr * yr * right + xl * yl * left + hx * dy / 2,
        xt + dx * tt + (xr * right - xl * left) / base_m + hx,
        yy + dy * (2 * yt + dy * tt) + yr * yr * right + yl * yl * left + hy * dy / 2,
        yt + dy * tt + (yr * right - yl * left) / base_m + hy,
        tt + (right + left) / base_m / base_m + slip,
    )


def error_squared(spread: Spread, dx_m: float, dy_m: float, dyaw_rad: float) -> float:
    """The normalised estimation error squared of a pose that is off by so much; on average 3 where `spread` holds.

    Raises:
        ValueError: the spread has no inverse.
    """
    xx, xy, xt, yy, yt, tt = spread
    a, b, c = yy * tt - yt * yt, xt * yt - xy * tt, xy * yt - xt * yy
    d, e, f = xx * tt - xt * xt, xy * xt - xx * yt, xx * yy - xy * xy
    determinant = xx * a + xy * b + xt * c
    if not determinant > 0.0:
        raise ValueError(f"{spread} has no inverse, expected a covariance")
    x, y, t = dx_m, dy_m, dyaw_rad
    return (x * x * a + y * y * d + t * t * f + 2 * (x * y * b + x * t * c + y * t * e)) / determinant
