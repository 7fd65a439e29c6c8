"""Covariance of the odometry's pose, from random errors of the wheels and of slip.  No I/O.

First-order propagation for a differential drive (Siegwart, Nourbakhsh: Introduction to Autonomous Mobile Robots,
section 5.2.4).  The variance of each wheel's distance grows with that distance, independently of the other wheel.  The
variance of the yaw also grows with the angle turned, because tracks slip in turns.
"""

import math
from typing import Sequence

from mrl_driver.geometry import yaw_of

from .kinematics import Spread, kinematics_of
from .models import OmniDrive, RobotModel

START_POSITION_M2, START_YAW_RAD2 = 1e-6, 1e-6
"""Variances at the start: 1 mm and 1 mrad squared, because filters refuse zeros."""

AT_START: Spread = (START_POSITION_M2, 0.0, 0.0, START_POSITION_M2, 0.0, START_YAW_RAD2)


class Uncertainty:
    """The covariance of a pose in the plane; `unknowns` holds the current value."""

    def __init__(self, model: RobotModel, start: Spread = AT_START) -> None:
        drive = model.drive
        self._metres = drive.right_m_per_count, drive.left_m_per_count
        self._base_m = drive.turning_separation_m
        self._noise = model.noise
        self._counts: Sequence[float] = (0.0, 0.0)
        self._start = start
        self.unknowns = start

    def reset(self) -> None:
        """The pose was set: go back to the covariance of the start."""
        self.unknowns = self._start

    def widen(self, distance_m: float, turn_rad: float) -> None:
        """The robot may have moved by up to `distance_m` in any direction and turned by up to `turn_rad`, unseen
        by the counters.  All values are equally likely.
        """
        xx, xy, xt, yy, yt, tt = self.unknowns
        position, yaw = distance_m * distance_m / 3, turn_rad * turn_rad / 3
        self.unknowns = (xx + position, xy, xt, yy + position, yt, tt + yaw)

    def update(self, counts: Sequence[float], half_sin: float, half_cos: float) -> None:
        """Update from the counters `counts` (right, left, without wrap) and the new yaw, given as sine and cosine of
        its half as in a quaternion.
        """
        before = self._counts
        if counts == before:
            return
        self._counts = counts
        (right_m, left_m), base_m, (noise_m, noise_rad) = self._metres, self._base_m, self._noise
        right_m, left_m = (counts[0] - before[0]) * right_m, (counts[1] - before[1]) * left_m
        forward_m, back_rad = (right_m + left_m) / 2, (right_m - left_m) / base_m / 2
        cos, sin = half_cos * half_cos - half_sin * half_sin, 2 * half_sin * half_cos
        cos, sin = (
            cos + sin * back_rad,
            sin - cos * back_rad,
        )  # yaw at the middle of the step, for small turns
        right, left, slip = noise_m * abs(right_m), noise_m * abs(left_m), noise_rad * abs(back_rad)
        lean = forward_m / 2 / base_m
        xr, xl = cos / 2 - lean * sin, cos / 2 + lean * sin
        yr, yl = sin / 2 + lean * cos, sin / 2 - lean * cos
        dx, dy = -forward_m * sin, forward_m * cos
        xx, xy, xt, yy, yt, tt = self.unknowns
        whole, half = tt + slip / 2, tt + slip  # `slip` is the variance for half the turn
        self.unknowns = (
            xx + dx * (2 * xt + dx * whole) + xr * xr * right + xl * xl * left,
            xy + dx * yt + dy * xt + dx * dy * whole + xr * yr * right + xl * yl * left,
            xt + dx * half + (xr * right - xl * left) / base_m,
            yy + dy * (2 * yt + dy * whole) + yr * yr * right + yl * yl * left,
            yt + dy * half + (yr * right - yl * left) / base_m,
            tt + 2 * slip + (right + left) / base_m / base_m,
        )


class OmniUncertainty(Uncertainty):
    """The covariance of the pose of a base with three omni wheels.  The covariance of each step is rotated into the
    odom frame and added to the propagated one.
    """

    def __init__(self, model: RobotModel, start: Spread = AT_START) -> None:
        super().__init__(model, start)
        self._m_per_count, self._kinematics = model.drive.metres_per_count, kinematics_of(model.drive)
        self._counts = (0.0, 0.0, 0.0)

    def update(self, counts: Sequence[float], half_sin: float, half_cos: float) -> None:
        """As `Uncertainty.update`, for the counters right, left, rear."""
        before = self._counts
        if counts == before:
            return
        self._counts = counts
        right_m, left_m, rear_m = ((now - was) * self._m_per_count for now, was in zip(counts, before))
        wheels_m = (left_m, rear_m, right_m)
        forward, left, turn = self._kinematics.step(wheels_m)
        yaw_rad = yaw_of(0.0, 0.0, half_sin, half_cos) - turn / 2  # yaw at the middle of the step
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        dx, dy = -(sin * forward + cos * left), cos * forward - sin * left
        fxx, fxl, fxt, fll, flt, ftt = self._kinematics.covariance(wheels_m, *self._noise)
        xx, xy, xt, yy, yt, tt = self.unknowns
        self.unknowns = (
            xx + dx * (2 * xt + dx * tt) + cos * cos * fxx - 2 * cos * sin * fxl + sin * sin * fll,
            xy + dx * yt + dy * xt + dx * dy * tt + cos * sin * (fxx - fll) + (cos * cos - sin * sin) * fxl,
            xt + dx * tt + cos * fxt - sin * flt,
            yy + dy * (2 * yt + dy * tt) + sin * sin * fxx + 2 * cos * sin * fxl + cos * cos * fll,
            yt + dy * tt + sin * fxt + cos * flt,
            tt + ftt,
        )


def uncertainty_of(model: RobotModel) -> Uncertainty:
    """Return the covariance estimator for a robot of this model."""
    return OmniUncertainty(model) if isinstance(model.drive, OmniDrive) else Uncertainty(model)
