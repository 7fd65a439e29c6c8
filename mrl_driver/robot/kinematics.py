"""Kinematics of all drive types: wheel motion to body motion and back.  Metres and radians, no I/O, no arrays.

A base is a linear map: the distance of each wheel is a row (per metre forward, per metre to the left, per radian
turned) times the body's step.  Forward kinematics is the least-squares inverse; it is exact if the wheels do not
contradict each other.  Sources of the rows: Siegwart, Nourbakhsh: Introduction to Autonomous Mobile Robots, section 3.2
(omni wheels); for 45 deg mecanum wheels Taheri, Qiao, Ghaeminezhad: Kinematic model of a four mecanum wheeled mobile
robot, 2015.
"""

import math
from typing import List, NamedTuple, Sequence, Tuple

from mrl_driver.errors import ConfigError, FrameError
from mrl_driver.protocol.table import WHEELS

from .models.drives import THREE_WHEELS_DEG, Base, MecanumDrive, OmniDrive, SkidDrive

Row = Tuple[float, float, float]
Spread = Tuple[float, float, float, float, float, float]
"""xx, xy, x-yaw, yy, y-yaw, yaw-yaw of a symmetric covariance [m2, m rad, rad2]."""
_SINGULAR = 1e-9


class Planar(NamedTuple):
    """A step of the body in its own frame [m, m, rad], or its speeds [m/s, m/s, rad/s]."""

    forward: float
    left: float
    turn: float


STANDING = Planar(0.0, 0.0, 0.0)


class Kinematics:
    """Kinematics of one base; ConfigError if its wheels do not determine the motion.

    Args:
        kind: drive type, for messages.
        wheels: names of the wheels, in the order of all numbers per wheel.
        rows: distance of each wheel per unit of forward, left and turn.
        sideways: the base can move sideways; otherwise its wheels prevent that.
    """

    def __init__(self, kind: str, wheels: Sequence[str], rows: Sequence[Row], sideways: bool) -> None:
        self.kind, self.wheels, self.rows, self.sideways = kind, tuple(wheels), tuple(rows), sideways
        self._inverse = _least_squares(self.rows, (0, 1, 2) if sideways else (0, 2), kind)

    @property
    def columns(self) -> List[Planar]:
        """The body's step for a step of each wheel alone [1, 1, rad/m]."""
        return [Planar(*column) for column in zip(*self._inverse)]

    def step(self, wheels_m: Sequence[float]) -> Planar:
        """Return the body's step for these wheel distances [m], or its speeds for wheel speeds [m/s]."""
        forward, left, turn = (sum(a * wheel_m for a, wheel_m in zip(row, wheels_m)) for row in self._inverse)
        return Planar(forward, left, turn)

    def covariance(
        self, wheels_m: Sequence[float], wheel_m2_per_m: float, turn_rad2_per_rad: float
    ) -> Spread:
        """Return the covariance of `step(wheels_m)`.

        The wheels err independently, in proportion to their distances; the yaw also errs in proportion to the turn.
        """
        variances = [wheel_m2_per_m * abs(wheel_m) for wheel_m in wheels_m]
        x, y, t = self._inverse
        xx, xy, xt, yy, yt, tt = (
            sum(a * b * v for a, b, v in zip(p, q, variances))
            for p, q in ((x, x), (x, y), (x, t), (y, y), (y, t), (t, t))
        )
        return xx, xy, xt, yy, yt, tt + turn_rad2_per_rad * abs(self.step(wheels_m).turn)

    def wheel_steps(self, step: Planar) -> Tuple[float, ...]:
        """Return the wheel distances for a step of the body [m], or wheel speeds for its speeds [m/s].

        Raise FrameError if the step goes sideways and the base cannot.
        """
        forward, left, turn = step
        if left and not self.sideways:
            raise FrameError(cannot_sideways(left, self.kind))
        return tuple(x * forward + y * left + t * turn for x, y, t in self.rows)

    def saturated(self, twist: Planar, most_m_s: float) -> Planar:
        """Return the twist, scaled down as a whole if a wheel would exceed `most_m_s`; errors as `wheel_steps`."""
        excess = max(map(abs, self.wheel_steps(twist))) / most_m_s
        if math.isinf(excess):  # a wheel's speed, or the quotient, overflows
            most = max(map(abs, twist))
            twist = Planar(twist.forward / most, twist.left / most, twist.turn / most)
            excess = max(map(abs, self.wheel_steps(twist))) / most_m_s
        if excess <= 1.0:
            return twist
        return Planar(twist.forward / excess, twist.left / excess, twist.turn / excess)


def differential(separation_m: float, turn_slip: float = 0.0) -> Kinematics:
    """Kinematics of two wheels or tracks, right and left; tracks lose the share `turn_slip` of each turn to slip."""
    half_m = separation_m / 2 / (1 - turn_slip)
    kind = "tracked" if turn_slip else "differential"
    return Kinematics(kind, ("right", "left"), ((1.0, 0.0, half_m), (1.0, 0.0, -half_m)), False)


def skid(separation_m: float, turn_slip: float = 0.0) -> Kinematics:
    """Kinematics of two wheels on each side, which slide in turns; the order is that of `mecanum`."""
    half_m = separation_m / 2 / (1 - turn_slip)
    left, right = (1.0, 0.0, -half_m), (1.0, 0.0, half_m)
    return Kinematics("skid", WHEELS, (left, right, left, right), False)


def omni(radius_m: float, angles_deg: Sequence[float] = THREE_WHEELS_DEG) -> Kinematics:
    """Kinematics of omni wheels at these angles, `radius_m` from the centre; positive is counter-clockwise."""
    angles = [math.radians(angle) for angle in angles_deg]
    rows = [(-math.sin(angle), math.cos(angle), radius_m) for angle in angles]
    return Kinematics("omni", ("left", "rear", "right"), rows, True)


def mecanum(half_length_m: float, half_width_m: float, side_slip: float = 0.0) -> Kinematics:
    """Kinematics of four mecanum wheels at the corners, with rollers at 45 deg that form an X seen from above.

    Their order is that of `WHEELS`: front left, front right, rear left, rear right.  They lose the share `side_slip` of
    a distance sideways.
    """
    arm_m, aside = half_length_m + half_width_m, 1 / (1 - side_slip)
    rows = ((1.0, -aside, -arm_m), (1.0, aside, arm_m), (1.0, aside, -arm_m), (1.0, -aside, arm_m))
    return Kinematics("mecanum", WHEELS, rows, True)


def kinematics_of(drive: Base) -> Kinematics:
    """Return the kinematics of a robot model's `drive`, including slip."""
    keeps = 1 - drive.turn_slip
    if isinstance(drive, OmniDrive):
        return omni(drive.radius_m / keeps, drive.angles_deg)
    if isinstance(drive, MecanumDrive):
        return mecanum(drive.half_length_m / keeps, drive.half_width_m / keeps, drive.side_slip)
    of_sides = skid if isinstance(drive, SkidDrive) else differential
    return of_sides(drive.wheel_separation_m, drive.turn_slip)


def cannot_sideways(left: float, kind: str) -> str:
    """Return the error text for a sideways speed that the base cannot reach."""
    return f"a {kind} base cannot move sideways ({left:g} m/s requested); turn instead, or use an omni or mecanum base"


def _least_squares(rows: Sequence[Row], axes: Tuple[int, ...], kind: str) -> Tuple[Tuple[float, ...], ...]:
    """Return the pseudo-inverse of `rows` for these axes, by Gauss-Jordan elimination of the normal equations.

    The rows of the other axes are zero.
    """
    size = len(axes)
    table = [[sum(row[p] * row[q] for row in rows) for q in axes] + [row[p] for row in rows] for p in axes]
    for at in range(size):
        pivot = max(range(at, size), key=lambda each: abs(table[each][at]))
        table[at], table[pivot] = table[pivot], table[at]
        if abs(table[at][at]) < _SINGULAR:
            raise ConfigError(
                f"the wheels of this {kind} base do not determine its motion: check their places"
            )
        table[at] = [value / table[at][at] for value in table[at]]
        for other in range(size):
            if other != at:
                by = table[other][at]
                table[other] = [value - by * pivoted for value, pivoted in zip(table[other], table[at])]
    found = dict(zip(axes, (tuple(line[size:]) for line in table)))
    return tuple(found.get(axis, (0.0,) * len(rows)) for axis in range(3))
