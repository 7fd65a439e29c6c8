"""How sure odometry is of its pose: wheel noise propagated along the way.  Pure.

First-order propagation for a differential drive (Siegwart, Nourbakhsh: Introduction to Autonomous Mobile
Robots, section 5.2.4): the variance of each wheel's way grows with its length, the wheels independently.
"""

from typing import List, Tuple

from mrl_driver.robots import RobotModel

UNUSED_VARIANCE = 1e6
"""Variance on the axes that a robot on the floor does not have; filters take it as "not measured"."""
WHEEL_NOISE_M, TRACK_NOISE_M = 1e-4, 4e-4
"""Variance per way [m2/m]: 1 cm over 1 m for wheels, 2 cm for tracks, which slip in every turn."""
START_POSITION_M2, START_YAW_RAD2 = 1e-6, 1e-6
"""1 mm and 1 mrad: what a standing robot starts with, as filters refuse zeros."""
STILL_M2_S2, STILL_RAD2_S2, SIDEWAYS_M2_S2 = 1e-4, 1e-3, 1e-6
"""Twist variances of a standing robot; sideways motion is excluded by the wheels, not unknown."""
SPEED_SHARE = 0.05
"""Standard deviation of a speed as a share of it."""


Unknowns = Tuple[float, float, float, float, float, float]
"""The part of a symmetric covariance that changes: xx, xy, x-yaw, yy, y-yaw, yaw-yaw."""
_START: Unknowns = (START_POSITION_M2, 0.0, 0.0, START_POSITION_M2, 0.0, START_YAW_RAD2)


class PoseCovariance:
    """The covariance of a pose in the plane, kept up to date in `unknowns`."""

    def __init__(self, model: RobotModel) -> None:
        self._metres = model.drive.metres_per_count
        self._base_m = model.drive.wheel_separation_m
        self._noise_m = TRACK_NOISE_M if model.body.tracks else WHEEL_NOISE_M
        self._counts = (0.0, 0.0)
        self.unknowns = _START

    def reset(self) -> None:
        """The pose was set: as sure as at the start."""
        self.unknowns = _START

    def update(self, counts: Tuple[float, float], half_sin: float, half_cos: float) -> None:
        """The counters (right, left, without wrap) stand at `counts`, and the heading is now the one whose half has
        this sine and cosine, as quaternions do.
        """
        before = self._counts
        if counts == before:
            return
        self._counts = counts
        metres, base_m, noise_m = self._metres, self._base_m, self._noise_m
        right_m, left_m = (counts[0] - before[0]) * metres, (counts[1] - before[1]) * metres
        way_m, back_rad = (right_m + left_m) / 2, (right_m - left_m) / base_m / 2
        cos, sin = half_cos * half_cos - half_sin * half_sin, 2 * half_sin * half_cos
        cos, sin = (
            cos + sin * back_rad,
            sin - cos * back_rad,
        )  # at the middle of the way, where turns are small
        right, left = noise_m * abs(right_m), noise_m * abs(left_m)
        lean = way_m / 2 / base_m
        xr, xl = cos / 2 - lean * sin, cos / 2 + lean * sin
        yr, yl = sin / 2 + lean * cos, sin / 2 - lean * cos
        dx, dy = -way_m * sin, way_m * cos
        xx, xy, xt, yy, yt, tt = self.unknowns
        self.unknowns = (
            xx + dx * (2 * xt + dx * tt) + xr * xr * right + xl * xl * left,
            xy + dx * yt + dy * xt + dx * dy * tt + xr * yr * right + xl * yl * left,
            xt + dx * tt + (xr * right - xl * left) / base_m,
            yy + dy * (2 * yt + dy * tt) + yr * yr * right + yl * yl * left,
            yt + dy * tt + (yr * right - yl * left) / base_m,
            tt + (right + left) / base_m / base_m,
        )


def pose_matrix(unknowns: Unknowns) -> List[float]:
    """The 6 x 6 row-major covariance (36,) of a pose."""
    xx, xy, xt, yy, yt, tt = unknowns
    matrix = diagonal((xx, yy) + (UNUSED_VARIANCE,) * 3 + (tt,))
    matrix[1] = matrix[6] = xy
    matrix[5] = matrix[30] = xt
    matrix[11] = matrix[31] = yt
    return matrix


def twist_matrix(linear_m_s: float, angular_rad_s: float) -> List[float]:
    """The 6 x 6 row-major covariance (36,) of a twist."""
    along, turning = twist_variances(linear_m_s, angular_rad_s)
    return diagonal((along, SIDEWAYS_M2_S2) + (UNUSED_VARIANCE,) * 3 + (turning,))


def twist_variances(linear_m_s: float, angular_rad_s: float) -> Tuple[float, float]:
    """The variances of these speeds."""
    linear, angular = SPEED_SHARE * linear_m_s, SPEED_SHARE * angular_rad_s
    return STILL_M2_S2 + linear * linear, STILL_RAD2_S2 + angular * angular


def diagonal(variances: Tuple[float, ...]) -> List[float]:
    """6 x 6 row-major matrix (36,) with these six on its diagonal."""
    return [variances[i // 6] if i % 7 == 0 else 0.0 for i in range(36)]
