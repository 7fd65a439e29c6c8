"""Tip-over margin of a vehicle: the force-angle stability margin.  No I/O.

Source: Papadopoulos and Rey (A New Measure of Tipover Stability Margin for Mobile Manipulators, ICRA 1996; in Vehicle
System Dynamics 33, 2000, the angle is weighted with the force and its arm).  Each edge of the polygon of ground contact
points is a tip-over axis.  The margin is the angle between the net force on the centre of mass and the perpendicular
from there to the axis.  It is 0 when the wheels on the other side lift off.

x is forward, y left, z up.  The ground is flat.  Friction is not considered: the wheels never slip.
"""

import functools
import math
from typing import Dict, List, NamedTuple, Sequence, Tuple

from mrl_driver.errors import ConfigError

GRAVITY_M_S2 = 9.80665
DIRECTIONS: Dict[str, Tuple[float, float]] = {
    "forward": (1.0, 0.0),
    "back": (-1.0, 0.0),
    "left": (0.0, 1.0),
    "right": (0.0, -1.0),
}
"""Directions of an acceleration (x, y); braking is an acceleration backwards."""
MOST_M_S2 = 1000.0
"""Largest acceleration that is tried."""
_STEPS = 48
"""Number of bisection steps; they give the acceleration to about 4e-12 m/s2."""

Vector = Tuple[float, float, float]
Point = Tuple[float, float]
NOTHING: Vector = (0.0, 0.0, 0.0)


class Mass(NamedTuple):
    """A mass and its centre."""

    mass_kg: float
    x_m: float
    y_m: float
    height_m: float
    """Height of the centre above the ground."""


class Vehicle(NamedTuple):
    """A vehicle and its payloads."""

    name: str
    contacts: Tuple[Point, ...]
    """Ground contact points [m m], in any order."""
    body: Mass
    payloads: Dict[str, Mass]

    @property
    def whole(self) -> Mass:
        """The total mass and its centre."""
        masses = [self.body, *self.payloads.values()]
        total = sum(each.mass_kg for each in masses)

        def mean(place: int) -> float:
            return sum(each[place] * each.mass_kg for each in masses) / total

        return Mass(total, mean(1), mean(2), mean(3))


class Margin(NamedTuple):
    """The margin for one tip-over axis."""

    axis: Tuple[Point, Point]
    angle_rad: float
    """The force-angle margin; below 0 the vehicle tips over."""
    measure_n_m: float
    """The angle times the net force times its distance from the axis (the measure of 2000)."""


def margins(
    vehicle: Vehicle,
    acceleration_m_s2: Point = (0.0, 0.0),
    force_n: Vector = NOTHING,
    moment_n_m: Vector = NOTHING,
    slope: Point = (0.0, 0.0),
) -> List[Margin]:
    """Return the margin of each tip-over axis, counter-clockwise.

    Args:
        vehicle: the vehicle.
        acceleration_m_s2: acceleration along the ground; in a curve it includes v * omega towards the inside.
        force_n: external force on the centre of mass, such as from an arm that pushes.
        moment_n_m: external moment about the centre of mass.
        slope: downhill direction, as a vector of length sin(slope).

    Raises:
        ConfigError: the contact points do not span an area.
    """
    mass = vehicle.whole
    weight_n = mass.mass_kg * GRAVITY_M_S2
    down = math.sqrt(max(0.0, 1 - slope[0] ** 2 - slope[1] ** 2))
    net = (
        weight_n * slope[0] - mass.mass_kg * acceleration_m_s2[0] + force_n[0],
        weight_n * slope[1] - mass.mass_kg * acceleration_m_s2[1] + force_n[1],
        -weight_n * down + force_n[2],
    )
    corners = _hull(vehicle.contacts)
    centre = (mass.x_m, mass.y_m, mass.height_m)
    pairs = zip(corners, corners[1:] + corners[:1])
    return [_margin(first, second, centre, net, moment_n_m) for first, second in pairs]


def least(found: Sequence[Margin]) -> Margin:
    """Return the smallest margin: the vehicle tips over this axis first."""
    return min(found, key=lambda margin: margin.angle_rad)


def greatest_acceleration(
    vehicle: Vehicle, direction: Point, reserve_rad: float = 0.0, slope_rad: float = 0.0
) -> float:
    """Return the largest acceleration in a direction (unit vector) at which all margins keep the reserve [m/s2].

    The ground slopes in the worst direction, so that weight and inertia add up.  The result is 0 if the vehicle does
    not have the reserve at rest, and `MOST_M_S2` if even that keeps it.

    Raises:
        ConfigError: the contact points do not span an area.
    """
    slope = (-direction[0] * math.sin(slope_rad), -direction[1] * math.sin(slope_rad))

    def enough(value: float) -> bool:
        found = margins(vehicle, (direction[0] * value, direction[1] * value), slope=slope)
        return least(found).angle_rad >= reserve_rad

    low, high = 0.0, MOST_M_S2
    if not enough(low):
        return 0.0
    if enough(high):
        return high
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if enough(middle) else (low, middle)
    return low


def limits(vehicle: Vehicle, reserve_rad: float = 0.0, slope_rad: float = 0.0) -> Dict[str, float]:
    """Return `greatest_acceleration` for each of the `DIRECTIONS` [m/s2]."""
    return {
        name: greatest_acceleration(vehicle, way, reserve_rad, slope_rad) for name, way in DIRECTIONS.items()
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
def _hull(points: Tuple[Point, ...]) -> List[Point]:
    return hull(points)


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _margin(first: Point, second: Point, centre: Vector, net: Vector, moment: Vector) -> Margin:
    length = math.hypot(second[0] - first[0], second[1] - first[1])
    axis = ((second[0] - first[0]) / length, (second[1] - first[1]) / length, 0.0)
    to_axis = _across((second[0] - centre[0], second[1] - centre[1], -centre[2]), axis)
    arm_m = _length(to_axis)
    about = _dot(moment, axis)
    couple = _cross(to_axis, (axis[0] * about, axis[1] * about, axis[2] * about))
    across = _across(net, axis)
    force = tuple(a + b / arm_m**2 for a, b in zip(across, couple))
    lever = _dot(_cross(to_axis, force), axis)
    angle = math.atan2(lever, _dot(to_axis, force))
    # |lever| is the force times the distance of its line of action from the axis
    return Margin((first, second), angle, angle * abs(lever))


def _across(vector: Sequence[float], axis: Vector) -> Vector:
    """Return the part of a vector that is perpendicular to an axis (unit vector)."""
    along = _dot(vector, axis)
    return (vector[0] - along * axis[0], vector[1] - along * axis[1], vector[2] - along * axis[2])


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Sequence[float], b: Sequence[float]) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _length(a: Sequence[float]) -> float:
    return math.sqrt(_dot(a, a))
