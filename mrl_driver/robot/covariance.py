"""Covariance of the odometry's pose and twist.  No I/O.

Errors are of two kinds.  Random errors are independent from step to step: the variance of a wheel's distance grows with
that distance, that of the yaw with the angle turned, because tracks slip (Siegwart, Nourbakhsh: Introduction to
Autonomous Mobile Robots, section 5.2.4), or with time, if a gyro measures the turn.  Their covariance P is carried from
step to step.  Constant errors are the same in every step of a drive: the scales of distance, wheels, turn and gyro.
They are not noise: after a turn and a turn back, they cancel out.  So the pose has one derivative J for each of them,
and the covariance of the pose is P + the sum of J J' times the variance of each constant.

The scale of a turn by the wheels may be wrong by a tenth on tracks.  After some turns, a derivative does not describe
its effect: the end of the path moves on an arc.  So there are two more paths in place of J, whose turns are larger and
smaller by sqrt(3) standard deviations.  The covariance is a sixth of the squares of how far each ends from the pose:
points and weights of Gauss and Hermite (Press et al.: Numerical Recipes, section 4.6), of which the pose has the rest.

A step moves by (dx, dy) in the odom frame and turns by phi.  An error e_yaw of the yaw before it, and an error e_phi of
the turn, move its end by (-dy, dx) (e_yaw + e_phi / 2).  P and J both follow from this.

The bias of the gyro changes slowly, and is measured again at each stand.  It is a random walk; C is the covariance of
its error with that of the pose.  In a step of dt, e_phi contains -dt times the error of the bias.  A measurement with
the Kalman gain K leaves the pose as it is and the share 1 - K of C.
"""

import math
from typing import List, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose

from .heading import HeadingFilter
from .kinematics import Spread, kinematics_of
from .models import RobotModel

START_POSITION_M2, START_YAW_RAD2 = 1e-6, 1e-6
"""Variances at the start: 1 mm and 1 mrad squared, because filters refuse zeros."""

AT_START: Spread = (START_POSITION_M2, 0.0, 0.0, START_POSITION_M2, 0.0, START_YAW_RAD2)
SIDEWAYS_M2_S2 = 1e-6  # variance of the speed to the left of a base whose wheels prevent sliding
LARGEST_VARIANCE = 1e16
"""Largest variance of a pose that is set: that of a position unknown within 1e8 m; sums and products stay finite."""
TOLERANCE = 1e-9  # relative tolerance of a covariance whose errors depend on each other completely
ROUNDING = 1 / 6  # variance of the difference of two counters that are rounded down [count2]
NEWEST = 0.2
"""Share of the last step in the variances of the twist; smooth ones do not favour steps that happen to be small."""
TWIST_INTERVAL_S = 0.015
"""Without board time, speeds are averaged over at least this time [s], so that a burst does not make a spike."""
CLOCK_SD_S = {True: 5e-5, False: 2e-3}
"""Standard deviation of the time between two readings [s]: the tick of the board's clock; how evenly frames arrive."""

Variances = Tuple[float, float, float]
"""Variances of the linear, the angular and the lateral speed [m2/s2, rad2/s2, m2/s2]."""


class Uncertainty:
    """The covariance of pose and twist of a differential drive.

    Attributes:
        spread: the covariance of the pose.
        variances: those of the twist, smoothed.  A gyro is read a little before or after the counts; that error is not
            in them, because the next step takes it back.
    """

    def __init__(self, model: RobotModel, start: Spread = AT_START, exact_time: bool = True) -> None:
        drive, noise = model.base, model.noise
        self._base_m, self._noise = drive.turning_separation_m, noise
        self._clock_s2 = CLOCK_SD_S[exact_time] ** 2
        self._least_s = 0.0 if exact_time else TWIST_INTERVAL_S
        self._scale_variance = noise.distance_scale_sd**2
        self._turn_variance, self._gyro_variance = noise.turn_scale_sd**2, model.imu.gyro_scale_sd**2
        self._reach = math.sqrt(3) * noise.turn_scale_sd
        # the gyro comes first, for all drives; then the constants of the wheels
        self._constants = [self._gyro_variance, *self._wheel_variances()]
        self._rounding = self._rounding_of(ROUNDING * drive.metres_per_count**2)
        self._start = self.spread = start
        self.reset()
        self.variances: Variances = (0.0, 0.0, SIDEWAYS_M2_S2)

    def _wheel_variances(self) -> List[float]:
        return [self._noise.wheel_ratio_sd**2]

    def _rounding_of(self, counter_m2: float) -> Variances:
        """Variances of a step by the rounding of its counters, from that of one wheel [m2, rad2, m2]."""
        return counter_m2 / 2, 2 * counter_m2 / self._base_m**2, 0.0

    def reset(self, start: Optional[Spread] = None) -> None:
        """The pose was set, with the covariance `start`: earlier errors are forgotten.

        Variances are at least those of the start.
        """
        least = self._start
        xx, xy, xt, yy, yt, tt = least if start is None else start
        self._random = (max(xx, least[0]), xy, xt, max(yy, least[3]), yt, max(tt, least[5]))
        self.spread = self._random
        self._effects = [[0.0, 0.0, 0.0] for _ in self._constants]  # J: x, y [m] and yaw [rad] per unit
        # of the paths with other turns: x, y [m] of their mean and half their difference, half that of their yaws [rad]
        self._other_paths = (0.0, 0.0, 0.0, 0.0, 0.0)
        self._moved_m = (0.0, 0.0)
        self._bias = (0.0, 0.0, 0.0)

    def widen(self, distance_m: float, turn_rad: float) -> None:
        """The robot may have moved by up to `distance_m` in any direction and turned by up to `turn_rad`, unseen
        by the counters.  All values are equally likely.
        """
        position, yaw = distance_m * distance_m / 3, turn_rad * turn_rad / 3
        xx, xy, xt, yy, yt, tt = self._random
        self._random = (xx + position, xy, xt, yy + position, yt, tt + yaw)
        xx, xy, xt, yy, yt, tt = self.spread
        self.spread = (xx + position, xy, xt, yy + position, yt, tt + yaw)

    def stand(self, dt_s: float, gyro: Optional[HeadingFilter] = None) -> None:
        """Process a step of the odometry, of this duration [s], without any motion."""
        if dt_s > self._least_s:
            per_s2 = 1 / (dt_s * dt_s)
            linear, angular, lateral = self._rounding
            turning = angular * per_s2 if gyro is None else gyro.noise_rad2_s / dt_s + gyro.bias_variance
            found = linear * per_s2, turning, lateral * per_s2 or SIDEWAYS_M2_S2
            linear, angular, lateral = self.variances
            self.variances = (
                linear + NEWEST * (found[0] - linear), angular + NEWEST * (found[1] - angular),
                lateral + NEWEST * (found[2] - lateral),
            )  # fmt: skip

    def update(
        self,
        before: Pose,
        after: Pose,
        wheels_m: Sequence[float],
        turn_rad: float,
        dt_s: float,
        gyro: Optional[HeadingFilter] = None,
    ) -> None:
        """Process a step of the odometry that takes `dt_s` and turns by `turn_rad`; `gyro` is the filter of that angle.
        `wheels_m` are the distances of the wheels, in the order of the drive's kinematics [m].
        """
        (right_m, left_m), base_m, noise = wheels_m, self._base_m, self._noise
        dx, dy = after[0] - before[0], after[1] - before[1]
        middle_rad, forward_m = before[2] + turn_rad / 2, (right_m + left_m) / 2
        cos, sin = math.cos(middle_rad), math.sin(middle_rad)
        # random errors of the step: variances of way and turn, and their covariance
        right, left = noise[0] * abs(right_m), noise[0] * abs(left_m)
        along, both, turning, changes = (right + left) / 4, 0.0, 0.0, (turn_rad, 0.0)
        if gyro is None:
            both = (right - left) / 2 / base_m
            turning = (right + left) / base_m / base_m + noise[1] * abs(turn_rad)
            changes = (0.0, forward_m / base_m)
        if gyro is None and self._bias[2] == 0.0:  # no gyro so far: as `_carried`, but faster
            xx, xy, xt, yy, yt, tt = self._random
            whole, half, mixed = tt + turning / 4, tt + turning / 2, (dx * cos - dy * sin) * both / 2
            self._random = (
                xx - 2 * dy * xt + dy * dy * whole + cos * cos * along - dy * cos * both,
                xy - dy * yt + dx * xt - dx * dy * whole + cos * sin * along + mixed,
                xt - dy * half + cos * both,
                yy + 2 * dx * yt + dx * dx * whole + sin * sin * along + dx * sin * both,
                yt + dx * half + sin * both,
                tt + turning,
            )
        else:
            of_step = cos * cos * along, cos * sin * along, cos * both, sin * sin * along, sin * both, turning
            self._random = self._with_gyro(dx, dy, of_step, dt_s, gyro)
        by_wheels = turn_rad if gyro is None else 0.0
        self.spread = self._with_turns(self._with_constants(dx, dy, changes), dx, dy, by_wheels)
        if dt_s > self._least_s:
            self._note_speeds(forward_m, turn_rad, along, turning, dt_s, gyro)

    def _with_turns(self, spread: Spread, dx: float, dy: float, turn_rad: float) -> Spread:
        """Carry the two paths with other turns over a step, which turns by `turn_rad`; return the spread with them."""
        mean_x, mean_y, half_x, half_y, angle = self._other_paths
        if not turn_rad and not angle:
            return spread
        middle = angle + self._reach * turn_rad / 2
        sin, less = math.sin(middle), math.cos(middle) - 1.0
        mean_x, half_x = mean_x + less * dx, half_x - sin * dy
        mean_y, half_y = mean_y + less * dy, half_y + sin * dx
        angle += self._reach * turn_rad
        self._other_paths = mean_x, mean_y, half_x, half_y, angle
        xx, xy, xt, yy, yt, tt = spread
        return (
            xx + (mean_x * mean_x + half_x * half_x) / 3,
            xy + (mean_x * mean_y + half_x * half_y) / 3,
            xt + half_x * angle / 3,
            yy + (mean_y * mean_y + half_y * half_y) / 3,
            yt + half_y * angle / 3,
            tt + angle * angle / 3,
        )

    def _with_constants(self, dx: float, dy: float, changes: Tuple[float, float]) -> Spread:
        """Carry the effects of the constant errors over a step; return the spread with them."""
        xx, xy, xt, yy, yt, tt = self._random
        x_m, y_m = self._moved_m = (self._moved_m[0] + dx, self._moved_m[1] + dy)
        scale = self._scale_variance
        xx, xy, yy = xx + scale * x_m * x_m, xy + scale * x_m * y_m, yy + scale * y_m * y_m
        for effect, change, variance in zip(self._effects, changes, self._constants):
            x, y, t = effect
            if not (change or t or x or y):
                continue  # such as the scale of the gyro without a gyro
            mean = t + change / 2
            x, y, t = effect[:] = x - dy * mean, y + dx * mean, t + change
            vx, vy = variance * x, variance * y
            xx, xy, xt = xx + vx * x, xy + vx * y, xt + vx * t
            yy, yt, tt = yy + vy * y, yt + vy * t, tt + variance * t * t
        return xx, xy, xt, yy, yt, tt

    def _note_speeds(
        self,
        forward_m: float,
        turn_rad: float,
        along: float,
        turning: float,
        dt_s: float,
        gyro: Optional[HeadingFilter],
    ) -> None:
        """Take the variances of the speeds of a step: rounding, random errors, shares of the speed."""
        per_s2 = 1 / (dt_s * dt_s)
        clock = self._clock_s2 * per_s2
        linear2, angular2 = forward_m * forward_m * per_s2, turn_rad * turn_rad * per_s2
        if gyro is None:
            bend2 = self._constants[1] * linear2 / self._base_m / self._base_m
            share = (self._turn_variance + clock) * angular2 + bend2
            of_turn = (self._rounding[1] + turning) * per_s2 + share
        else:
            of_turn = gyro.noise_rad2_s / dt_s + gyro.bias_variance + self._gyro_variance * angular2
        of_way = (self._rounding[0] + along) * per_s2 + (self._scale_variance + clock) * linear2
        linear, angular, lateral = self.variances
        self.variances = (
            linear + NEWEST * (of_way - linear),
            angular + NEWEST * (of_turn - angular),
            lateral,
        )

    def _with_gyro(
        self, dx: float, dy: float, of_step: Spread, dt_s: float, gyro: Optional[HeadingFilter]
    ) -> Spread:
        """Return P after a step with random errors `of_step`, and carry C; without `gyro` the wheels gave the turn."""
        bx, by, bt = self._bias
        if gyro is None:
            self._bias = (bx - dy * bt, by + dx * bt, bt)
            return _carried(self._random, dx, dy, of_step)
        kept, variance, noise = gyro.kept, gyro.bias_variance, gyro.noise_rad2_s * dt_s + gyro.unseen_rad2
        gyro.kept, gyro.unseen_rad2 = 1.0, 0.0
        bx, by, bt = kept * bx, kept * by, kept * bt
        mx, my, mt, v = -dt_s * bx, -dt_s * by, -dt_s * bt, dt_s * dt_s * variance
        mean = bt - dt_s * variance / 2
        self._bias = (bx - dy * mean, by + dx * mean, bt - dt_s * variance)
        xx, xy, xt, yy, yt, tt = _carried(self._random, dx, dy, (*of_step[:5], noise))
        whole, part = mt + v / 4, 1.5 * mt + v / 2
        return (
            xx - dy * mx + dy * dy * whole,
            xy + (dx * mx - dy * my) / 2 - dx * dy * whole,
            xt + mx - dy * part,
            yy + dx * my + dx * dx * whole,
            yt + my + dx * part,
            tt + 2 * mt + v,
        )


class WheelUncertainty(Uncertainty):
    """The covariance of pose and twist of a base with three or four wheels, each with its own constant scale."""

    def __init__(self, model: RobotModel, start: Spread = AT_START, exact_time: bool = True) -> None:
        self._kinematics = kinematics_of(model.base)
        self._columns = self._kinematics.columns
        super().__init__(model, start, exact_time)

    def _wheel_variances(self) -> List[float]:
        wheels = len(self._kinematics.wheels)
        on_a_side = wheels // 2  # the ratio of both sides has twice the variance of one, which is a mean
        return [self._noise.wheel_ratio_sd**2 / 2 * on_a_side] * wheels

    def _rounding_of(self, counter_m2: float) -> Variances:
        forward, left, turn = (sum(column[axis] ** 2 for column in self._columns) for axis in range(3))
        return counter_m2 * forward, counter_m2 * turn, counter_m2 * left

    def update(
        self,
        before: Pose,
        after: Pose,
        wheels_m: Sequence[float],
        turn_rad: float,
        dt_s: float,
        gyro: Optional[HeadingFilter] = None,
    ) -> None:
        """As `Uncertainty.update`."""
        dx, dy = after[0] - before[0], after[1] - before[1]
        cos, sin = math.cos(before[2] + turn_rad / 2), math.sin(before[2] + turn_rad / 2)
        by_wheels = 1.0 if gyro is None else 0.0
        xx, xl, xt, ll, lt, tt = self._kinematics.covariance(wheels_m, *self._noise[:2])
        xt, lt, tt = xt * by_wheels, lt * by_wheels, tt * by_wheels
        of_step = (
            cos * cos * xx - 2 * cos * sin * xl + sin * sin * ll,
            cos * sin * (xx - ll) + (cos * cos - sin * sin) * xl,
            cos * xt - sin * lt,
            sin * sin * xx + 2 * cos * sin * xl + cos * cos * ll,
            sin * xt + cos * lt,
            tt,
        )
        self._random = self._with_gyro(dx, dy, of_step, dt_s, gyro)
        self._moved_m = (self._moved_m[0] + dx, self._moved_m[1] + dy)
        changes = [
            (0.0, 0.0, turn_rad * (1.0 - by_wheels)),
            *(
                ((cos * x - sin * y) * way_m, (sin * x + cos * y) * way_m, t * way_m * by_wheels)
                for (x, y, t), way_m in zip(self._columns, wheels_m)
            ),
        ]
        for effect, (x, y, turn) in zip(self._effects, changes):
            mean = effect[2] + turn / 2
            effect[:] = effect[0] + x - dy * mean, effect[1] + y + dx * mean, effect[2] + turn
        self.spread = self._with_turns(self._whole(), dx, dy, turn_rad * by_wheels)
        if dt_s > self._least_s:
            self.variances = self._of_speeds((xx, tt, ll), wheels_m, turn_rad, dt_s, gyro)

    def _whole(self) -> Spread:
        xx, xy, xt, yy, yt, tt = self._random
        constants = [(self._scale_variance, (*self._moved_m, 0.0)), *zip(self._constants, self._effects)]
        for variance, (x, y, t) in constants:
            vx, vy = variance * x, variance * y
            xx, xy, xt = xx + vx * x, xy + vx * y, xt + vx * t
            yy, yt, tt = yy + vy * y, yt + vy * t, tt + variance * t * t
        return xx, xy, xt, yy, yt, tt

    def _of_speeds(
        self,
        random: Variances,
        wheels_m: Sequence[float],
        turn_rad: float,
        dt_s: float,
        gyro: Optional[HeadingFilter],
    ) -> Variances:
        """Return the variances of the speeds, as `Uncertainty.update` computes them."""
        per_s2 = 1 / (dt_s * dt_s)
        clock, moved = self._clock_s2 * per_s2, self._kinematics.step(wheels_m)
        linear, angular, lateral = (
            (rounding + variance) * per_s2 for rounding, variance in zip(self._rounding, random)
        )
        share, angular2 = (self._scale_variance + clock) * per_s2, turn_rad * turn_rad * per_s2
        if gyro is not None:
            angular = gyro.noise_rad2_s / dt_s + gyro.bias_variance + self._gyro_variance * angular2
        else:
            wheels = zip(self._constants[1:], self._columns, wheels_m)
            bend = sum(variance * (column[2] * way_m) ** 2 for variance, column, way_m in wheels)
            angular += (self._turn_variance + clock) * angular2 + bend * per_s2
        lateral = lateral + share * moved.left**2 if self._kinematics.sideways else SIDEWAYS_M2_S2
        found = linear + share * moved.forward**2, angular, lateral
        return tuple(  # type: ignore[return-value]
            before + NEWEST * (now - before) for before, now in zip(self.variances, found)
        )


def _carried(random: Spread, dx: float, dy: float, of_step: Spread) -> Spread:
    """Return P after a step whose random errors have the covariance `of_step`."""
    xx, xy, xt, yy, yt, tt = random
    nxx, nxy, nxt, nyy, nyt, ntt = of_step
    whole, half = tt + ntt / 4, tt + ntt / 2
    return (
        xx - 2 * dy * xt + dy * dy * whole + nxx - dy * nxt,
        xy - dy * yt + dx * xt - dx * dy * whole + nxy + (dx * nxt - dy * nyt) / 2,
        xt - dy * half + nxt,
        yy + 2 * dx * yt + dx * dx * whole + nyy + dx * nyt,
        yt + dx * half + nyt,
        tt + ntt,
    )


def is_covariance(spread: Spread) -> bool:
    """Return whether these finite numbers can be the variances and covariances of a pose; a variance may be zero.

    Variances are at most `LARGEST_VARIANCE`.
    """
    xx, xy, xt, yy, yt, tt = spread
    if min(xx, yy, tt) < 0.0 or max(xx, yy, tt) > LARGEST_VARIANCE:
        return False
    pairs = ((xy, xx, yy), (xt, xx, tt), (yt, yy, tt))
    determinant = xx * (yy * tt - yt * yt) - xy * (xy * tt - yt * xt) + xt * (xy * yt - yy * xt)
    return (
        all(each * each <= (1 + TOLERANCE) * a * b for each, a, b in pairs)
        and determinant >= -TOLERANCE * xx * yy * tt
    )
