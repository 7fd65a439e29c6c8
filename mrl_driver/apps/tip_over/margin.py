"""Tip-over margin of a vehicle: the force-angle stability margin.  No I/O.

Source: (Papadopoulos and Rey 1996); (Papadopoulos and Rey 2000) weights the angle with the force and its arm.  Each
edge of the polygon of ground contact points is a tip-over axis.  The margin is the angle between the net force on the
centre of mass and the perpendicular from there to the axis.  It is 0 when the wheels on the other side lift off.

x is forward, y left, z up.  The ground is flat.  Friction is not considered: the wheels never slip.
"""

import functools
import math
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import GRAVITY_M_S2

DIRECTIONS: Dict[str, Tuple[float, float]] = {
    "forward": (1.0, 0.0),
    "back": (-1.0, 0.0),
    "left": (0.0, 1.0),
    "right": (0.0, -1.0),
}
"""Directions of an acceleration (x, y); braking is an acceleration backwards."""
MOST_M_S2, MOST_N = 1000.0, 1e5  # largest acceleration and force that are tried
_STEPS = 48  # number of bisection steps; they give the acceleration to about 4e-12 m/s2

Vector = Tuple[float, float, float]
Point = Tuple[float, float]
NOTHING: Vector = (0.0, 0.0, 0.0)


class Mass(NamedTuple):
    """A mass and its centre."""

    mass_kg: float
    x_m: float
    y_m: float
    height_m: float  # height of the centre above the ground


class Arm(NamedTuple):
    """A straight arm on the vehicle, which turns about its lower end in a vertical plane."""

    mass_kg: float
    x_m: float
    y_m: float
    height_m: float  # place of its lower end; the height is above the ground
    length_m: float
    centre_m: float  # distance of its centre of mass from the lower end
    angle_deg: float  # angle above the horizontal: 0 is level and forward, 90 upright, 180 level and backward
    heading_deg: float = 0.0  # turns the vertical plane counter-clockwise: with 90, angle 0 is to the left

    def point(self, distance_m: float) -> Vector:
        """Return the point at a distance from the lower end (x, y, height) [m]."""
        angle, heading = math.radians(self.angle_deg), math.radians(self.heading_deg)
        level_m = distance_m * math.cos(angle)
        return (
            self.x_m + level_m * math.cos(heading),
            self.y_m + level_m * math.sin(heading),
            self.height_m + distance_m * math.sin(angle),
        )


class Push(NamedTuple):
    """An external force."""

    force_n: float = 0.0
    at_m: Optional[Vector] = None
    """Point of attack: x, y, height above the ground; None is the tip of the vehicle's arm."""
    direction: Optional[Vector] = None  # unit vector; None is the worst direction of each tip-over axis


NO_PUSH = Push()


class Vehicle(NamedTuple):
    """A vehicle, its payloads and its arm."""

    name: str
    contacts: Tuple[Point, ...]  # ground contact points [m m], in any order
    body: Mass
    payloads: Dict[str, Mass]
    arm: Optional[Arm] = None

    @property
    def tip(self) -> Vector:
        """The tip of the arm (x, y, height) [m].

        Raises:
            ConfigError: the vehicle has no arm.
        """
        if self.arm is None:
            raise ConfigError(
                f"vehicle {self.name} has no arm, expected the point of attack of the force (--at X,Y,HEIGHT)"
            )
        return self.arm.point(self.arm.length_m)

    @property
    def whole(self) -> Mass:
        """The total mass and its centre."""
        masses = [self.body, *self.payloads.values()]
        if self.arm is not None:
            masses.append(Mass(self.arm.mass_kg, *self.arm.point(self.arm.centre_m)))
        total = sum(each.mass_kg for each in masses)

        def mean(place: int) -> float:
            return sum(each[place] * each.mass_kg for each in masses) / total

        return Mass(total, mean(1), mean(2), mean(3))


class Margin(NamedTuple):
    """The margin for one tip-over axis."""

    axis: Tuple[Point, Point]
    angle_rad: float  # the force-angle margin; below 0 the vehicle tips over
    measure_n_m: float  # the angle times the net force times its distance from the axis (the measure of 2000)
    push: Vector = NOTHING  # direction of the push, a unit vector; nothing without a push


def margins(
    vehicle: Vehicle,
    acceleration_m_s2: Point = (0.0, 0.0),
    force_n: Vector = NOTHING,
    moment_n_m: Vector = NOTHING,
    slope: Point = (0.0, 0.0),
    push: Push = NO_PUSH,
) -> List[Margin]:
    """Return the margin of each tip-over axis, counter-clockwise.

    Args:
        vehicle: the vehicle.
        acceleration_m_s2: acceleration along the ground; in a curve it includes v * omega towards the inside.
        force_n: external force on the centre of mass, such as from an arm that pushes.
        moment_n_m: external moment about the centre of mass.
        slope: downhill direction, as a vector of length sin(slope).
        push: external force at a point.

    Raises:
        ConfigError: the contact points do not span an area, or the push needs an arm.
    """
    mass = vehicle.whole
    weight_n = mass.mass_kg * GRAVITY_M_S2
    down = math.sqrt(max(0.0, 1 - slope[0] ** 2 - slope[1] ** 2))
    net = (
        weight_n * slope[0] - mass.mass_kg * acceleration_m_s2[0] + force_n[0],
        weight_n * slope[1] - mass.mass_kg * acceleration_m_s2[1] + force_n[1],
        -weight_n * down + force_n[2],
    )
    centre = (mass.x_m, mass.y_m, mass.height_m)
    planes = (_Plane.across(first, second, centre) for first, second in _edges(vehicle.contacts))
    if push.force_n:
        at_m = vehicle.tip if push.at_m is None else push.at_m
        push = push._replace(at_m=(at_m[0] - centre[0], at_m[1] - centre[1], at_m[2] - centre[2]))
    return [_margin(plane, net, moment_n_m, push) for plane in planes]


def worst(
    vehicle: Vehicle, acceleration_m_s2: float = 0.0, slope_rad: float = 0.0, push: Push = NO_PUSH
) -> Margin:
    """Return the least margin with the acceleration and the slope in the worst direction of each tip-over axis.

    Raises:
        ConfigError: as `margins`.
    """
    found = []
    for number, (first, second) in enumerate(_edges(vehicle.contacts)):
        length_m = math.hypot(second[0] - first[0], second[1] - first[1])
        out = (second[1] - first[1]) / length_m, (first[0] - second[0]) / length_m
        inwards = (-out[0] * acceleration_m_s2, -out[1] * acceleration_m_s2)
        slope = (out[0] * math.sin(slope_rad), out[1] * math.sin(slope_rad))
        found.append(margins(vehicle, inwards, slope=slope, push=push)[number])
    return least(found)


def least(found: Sequence[Margin]) -> Margin:
    """Return the smallest margin: the vehicle tips over this axis first."""
    return min(found, key=lambda margin: margin.angle_rad)


def greatest_acceleration(
    vehicle: Vehicle,
    direction: Point,
    reserve_rad: float = 0.0,
    slope_rad: float = 0.0,
    push: Push = NO_PUSH,
) -> float:
    """Return the largest acceleration in a direction (unit vector) at which all margins keep the reserve [m/s2].

    The ground slopes in the worst direction, so that weight and inertia add up.  The result is 0 if the vehicle does
    not have the reserve at rest, and `MOST_M_S2` if even that keeps it.

    Raises:
        ConfigError: as `margins`.
    """
    slope = (-direction[0] * math.sin(slope_rad), -direction[1] * math.sin(slope_rad))

    def enough(value: float) -> bool:
        found = margins(vehicle, (direction[0] * value, direction[1] * value), slope=slope, push=push)
        return least(found).angle_rad >= reserve_rad

    return _greatest(enough, MOST_M_S2)


def greatest_acceleration_anywhere(
    vehicle: Vehicle, reserve_rad: float = 0.0, slope_rad: float = 0.0, push: Push = NO_PUSH
) -> float:
    """Return the largest acceleration at which all margins keep the reserve, whatever its direction is [m/s2].

    It may be less than in each of the `DIRECTIONS`: a vehicle whose tip-over axes lie askew tips over between them.
    The slope is as in `worst`.

    Raises:
        ConfigError: as `margins`.
    """
    return _greatest(lambda value: worst(vehicle, value, slope_rad, push).angle_rad >= reserve_rad, MOST_M_S2)


def greatest_force(
    vehicle: Vehicle,
    push: Push,
    reserve_rad: float = 0.0,
    slope_rad: float = 0.0,
    acceleration_m_s2: float = 0.0,
) -> float:
    """Return the largest force of a push at which all margins keep the reserve [N]; slope and acceleration are as in
    `worst`.  The result is 0 if the vehicle does not have the reserve without the force, and `MOST_N` if even that
    keeps it.

    Raises:
        ConfigError: as `margins`.
    """

    def enough(value: float) -> bool:
        pushed = push._replace(force_n=value)
        return worst(vehicle, acceleration_m_s2, slope_rad, pushed).angle_rad >= reserve_rad

    return _greatest(enough, MOST_N)


def _greatest(enough: Callable[[float], bool], high: float) -> float:
    """Return the largest value up to `high` that is enough; all smaller ones are, too."""
    low = 0.0
    if not enough(low):
        return 0.0
    if enough(high):
        return high
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if enough(middle) else (low, middle)
    return low


def limits(
    vehicle: Vehicle, reserve_rad: float = 0.0, slope_rad: float = 0.0, push: Push = NO_PUSH
) -> Dict[str, float]:
    """Return `greatest_acceleration` for each of the `DIRECTIONS` [m/s2]."""
    return {
        name: greatest_acceleration(vehicle, direction, reserve_rad, slope_rad, push)
        for name, direction in DIRECTIONS.items()
    }


def hull(points: Sequence[Point]) -> List[Point]:
    """Return the corners of the convex hull of points, counter-clockwise.

    Raises:
        ConfigError: the hull has no area.
    """
    ordered = sorted(set(points))

    def half(along: Sequence[Point]) -> List[Point]:
        made: List[Point] = []
        for point in along:
            while len(made) > 1 and _turn(made[-2], made[-1], point) <= 1e-12:
                made.pop()
            made.append(point)
        return made[:-1]

    corners = half(ordered) + half(ordered[::-1])
    if len(corners) < 3:
        raise ConfigError(f"contacts are {list(points)}, expected three or more points that span an area")
    return corners


@functools.lru_cache(maxsize=8)
def _edges(points: Tuple[Point, ...]) -> Sequence[Tuple[Point, Point]]:
    corners = hull(points)
    return tuple(zip(corners, corners[1:] + corners[:1]))


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


class _Plane(NamedTuple):
    """The vertical plane through the centre of mass, across a tip-over axis: only forces in it tip the vehicle over."""

    ends: Tuple[Point, Point]
    arm_m: float  # distance of the axis from the centre of mass
    axis: Vector
    towards: Vector  # from the centre of mass to the axis, a unit vector
    off: Vector
    """Perpendicular to `towards`, down and to the inside; a net force keeps the vehicle down if it has a part there."""

    @classmethod
    def across(cls, first: Point, second: Point, centre: Vector) -> "_Plane":
        length = math.hypot(second[0] - first[0], second[1] - first[1])
        axis = ((second[0] - first[0]) / length, (second[1] - first[1]) / length, 0.0)
        to_axis = _across((second[0] - centre[0], second[1] - centre[1], -centre[2]), axis)
        arm_m = math.sqrt(_dot(to_axis, to_axis))
        towards = (to_axis[0] / arm_m, to_axis[1] / arm_m, to_axis[2] / arm_m)
        return cls((first, second), arm_m, axis, towards, _cross(axis, towards))

    def seen(self, vector: Vector) -> Point:
        """The part of a vector in this plane, along `towards` and `off`."""
        return _dot(vector, self.towards), _dot(vector, self.off)


def _margin(plane: _Plane, net: Vector, moment: Vector, push: Push) -> Margin:
    towards, off = plane.seen(net)
    off -= _dot(moment, plane.axis) / plane.arm_m
    direction = NOTHING
    if push.force_n and push.at_m is not None:
        at = plane.seen(push.at_m)
        if push.direction is None:
            seen = _worst_direction(plane, (towards, off), push.force_n, at)
            x, y, z = (seen[0] * a + seen[1] * b for a, b in zip(plane.towards, plane.off))
            direction = (x, y, z)
        else:
            seen, direction = plane.seen(push.direction), push.direction
        extra = _effective(plane, seen, at)
        towards, off = towards + push.force_n * extra[0], off + push.force_n * extra[1]
    angle = math.atan2(off, towards)
    # |off * arm_m| is the force times the distance of its line of action from the axis
    return Margin(plane.ends, angle, angle * abs(off * plane.arm_m), direction)


def _effective(plane: _Plane, force: Point, at: Point) -> Point:
    """The force on the centre of mass that tips as this one at another point does."""
    return force[0], force[1] - (at[0] * force[1] - at[1] * force[0]) / plane.arm_m


def _worst_direction(plane: _Plane, net: Point, force_n: float, at: Point) -> Point:
    """The direction of a force in the plane that leaves the least margin.

    Over all directions, the net force lies on an ellipse, and the tangents from the origin to it have the least and the
    greatest angle.  If the ellipse goes round the origin, the result is the direction with the greatest moment.
    """
    across, along = 1 - at[0] / plane.arm_m, at[1] / plane.arm_m
    a, b = net[0] * across, net[1] - net[0] * along
    size = math.hypot(a, b)
    if abs(force_n * across) >= size:
        reach = math.hypot(along, across) or 1.0
        return -along / reach, -across / reach
    # the angle grows with the direction from here to as far beyond atan2(b, a)
    turn = math.atan2(b, a) - math.acos(-force_n * across / size)
    return math.cos(turn), math.sin(turn)


def _across(vector: Sequence[float], axis: Vector) -> Vector:
    """Return the part of a vector that is perpendicular to an axis (unit vector)."""
    along = _dot(vector, axis)
    return (vector[0] - along * axis[0], vector[1] - along * axis[1], vector[2] - along * axis[2])


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Sequence[float], b: Sequence[float]) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
