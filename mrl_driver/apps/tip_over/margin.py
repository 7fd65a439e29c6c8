"""Tip-over margin of a vehicle: the force-angle stability margin.  No I/O.

Source: (Papadopoulos and Rey 1996); without the weights of (Papadopoulos and Rey 2000).  Each edge of the polygon of
ground contact points is a tip-over axis.  The margin is the angle between the net force on the centre of mass and the
perpendicular from there to the axis.  It is 0 when the wheels on the other side lift off.

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
RANGES = {
    "mass_kg": (1e-6, 1e5),
    "x_m": (-100.0, 100.0),
    "y_m": (-100.0, 100.0),
    "height_m": (1e-6, 100.0),
    "length_m": (1e-3, 100.0),
    "centre_m": (0.0, 100.0),
    "angle_deg": (0.0, 180.0),
    "heading_deg": (-180.0, 180.0),
}
"""Limits of the numbers of vehicles."""
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
        """The tip of the arm (x, y, height) [m]; raise ConfigError if the vehicle has no arm."""
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

    angle_rad: float  # the force-angle margin; below 0 the vehicle tips over
    push: Vector = NOTHING  # direction of the push, a unit vector; nothing without a push


class Situation(NamedTuple):
    """A vehicle and what acts on it.  The ground slopes so that weight and inertia add up."""

    vehicle: Vehicle
    acceleration_m_s2: float = 0.0
    slope_rad: float = 0.0
    push: Push = NO_PUSH
    direction: Optional[Point] = None
    """Of the acceleration, a unit vector along the ground; in a curve, v * omega acts towards the inside.  None is the
    worst direction of each tip-over axis."""

    def margins(self) -> List[Margin]:
        """Return the margin of each tip-over axis, counter-clockwise; ConfigError without an area, or a needed arm."""
        found, acceleration, slope = [], self.acceleration_m_s2, math.sin(self.slope_rad)
        for plane in _planes(self.vehicle):
            x, y = self.direction or (-plane.out[0], -plane.out[1])
            inertia, downhill = (x * acceleration, y * acceleration), (-x * slope, -y * slope)
            found.append(_margin(self.vehicle, plane, inertia, downhill, self.push))
        return found

    def margin(self) -> Margin:
        """Return the least margin: the vehicle tips over this axis first.  Raise ConfigError as `margins` does."""
        return min(self.margins(), key=lambda margin: margin.angle_rad)

    def with_arm(self, **values: float) -> "Situation":
        """Return the situation with other attributes of the arm; raise ConfigError if the vehicle has none."""
        arm = self.vehicle.arm
        if arm is None:
            name = self.vehicle.name
            raise ConfigError(f"vehicle {name} has no arm, expected a vehicle's .yaml with the key arm")
        return self._replace(vehicle=self.vehicle._replace(arm=arm._replace(**values)))

    def with_force(self, force_n: float) -> "Situation":
        """Return the situation with another force of the push."""
        return self._replace(push=self.push._replace(force_n=force_n))


def greatest_acceleration(
    now: Situation, direction: Optional[Point] = None, reserve_rad: float = 0.0
) -> float:
    """Return the largest acceleration in a direction (unit vector) at which all margins keep the reserve [m/s2].

    Without a direction it is the one that keeps it whatever the direction is.  This may be less than in each of the
    `DIRECTIONS`: a vehicle whose tip-over axes lie askew tips over between them.  The result is 0 if the vehicle does
    not have the reserve at rest, and `MOST_M_S2` if even that keeps it.
    """
    now = now._replace(direction=direction)
    return _greatest(lambda value: now._replace(acceleration_m_s2=value), reserve_rad, MOST_M_S2)


class DriveLimits(NamedTuple):
    """Accelerations of a drive that keep a reserve, forward and backward, also at the same time [m/s2]."""

    along_m_s2: float  # speeding up and braking
    curve_m_s2: float  # to the inside of a curve


def drive_limits(now: Situation, turning: Point, reserve_rad: float = 0.0) -> DriveLimits:
    """Return the limits of a drive with these angular speeds and accelerations at most [rad/s, rad/s2].

    A turn accelerates a centre of mass that is not in the middle: that much is taken from the limits.  Raise
    ConfigError if nothing is left.
    """
    mass, found = now.vehicle.whole, limits(now, reserve_rad)
    turn_m_s2 = math.hypot(mass.x_m, mass.y_m) * (turning[0] ** 2 + turning[1])
    along, curve = min(found["forward"], found["back"]), min(found["left"], found["right"])
    size = math.hypot(along, curve) or 1.0

    def keeps(most: float) -> bool:
        corners = [(x * along / size, y * curve / size) for x in (1, -1) for y in (1, -1)]
        pushed = now._replace(acceleration_m_s2=most)
        return all(pushed._replace(direction=each).margin().angle_rad >= reserve_rad for each in corners)

    share = (size if keeps(size) else bisect(keeps, 0.0, size)) / size
    along, curve = share * along - turn_m_s2, share * curve - turn_m_s2
    if min(along, curve) <= 0:
        raise ConfigError(
            f"{now.vehicle.name} has no acceleration left that keeps {math.degrees(reserve_rad):g} deg (its turns need "
            f"{turn_m_s2:.3g} m/s2), expected a lower centre of mass, slower turns or a smaller reserve"
        )
    return DriveLimits(along, curve)


def greatest_force(now: Situation, reserve_rad: float = 0.0) -> float:
    """Return the largest force of the push at which all margins keep the reserve [N].

    The result is 0 if the vehicle does not have the reserve without the force, and `MOST_N` if even that keeps it.
    """
    return _greatest(now.with_force, reserve_rad, MOST_N)


def limits(now: Situation, reserve_rad: float = 0.0) -> Dict[str, float]:
    """Return `greatest_acceleration` for each of the `DIRECTIONS` [m/s2]."""
    return {name: greatest_acceleration(now, each, reserve_rad) for name, each in DIRECTIONS.items()}


def _greatest(situation_at: Callable[[float], Situation], reserve_rad: float, high: float) -> float:
    """Return the largest value up to `high` that keeps the reserve; all smaller ones do, too."""

    def enough(value: float) -> bool:
        return situation_at(value).margin().angle_rad >= reserve_rad

    if not enough(0.0):
        return 0.0
    return high if enough(high) else bisect(enough, 0.0, high)


def bisect(is_low: Callable[[float], bool], low: float, high: float) -> float:
    """Return the value between `low` and `high` up to which `is_low` holds."""
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if is_low(middle) else (low, middle)
    return low


def hull(points: Sequence[Point]) -> List[Point]:
    """Return the corners of the convex hull of points, counter-clockwise; raise ConfigError if the hull has no area."""
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


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


# -- a sweep


class Quantity(NamedTuple):
    """A quantity that can be swept."""

    unit: str
    low: float
    high: float
    change: Callable[[Situation, float], Situation]


QUANTITIES: Dict[str, Quantity] = {
    "arm-angle": Quantity("deg", *RANGES["angle_deg"], lambda now, value: now.with_arm(angle_deg=value)),
    "arm-height": Quantity("m", *RANGES["height_m"], lambda now, value: now.with_arm(height_m=value)),
    "acceleration": Quantity(
        "m/s2", 0.0, MOST_M_S2, lambda now, value: now._replace(acceleration_m_s2=value)
    ),
    "force": Quantity("N", 0.0, MOST_N, Situation.with_force),
}


class Range(NamedTuple):
    """Values of a quantity, from the first to the last."""

    name: str
    first: float
    last: float

    @property
    def quantity(self) -> Quantity:
        """The quantity."""
        return QUANTITIES[self.name]


def parse_range(text: str) -> Range:
    """Return the range in a text such as `force=0:900`; raise ConfigError for another quantity, or other values."""
    name, _, values = text.partition("=")
    if name not in QUANTITIES:
        raise ConfigError(f"sweep is {text!r}, expected QUANTITY=FROM:TO with {', '.join(QUANTITIES)}")
    quantity = QUANTITIES[name]
    try:
        first, last = map(float, values.split(":"))
    except ValueError:
        first = last = math.nan
    if not quantity.low <= first < last <= quantity.high:
        raise ConfigError(
            f"sweep is {text!r}, expected {name}=FROM:TO with two rising numbers from {quantity.low:g} to "
            f"{quantity.high:g} {quantity.unit}"
        )
    return Range(name, first, last)


def sweep(situation: Situation, over: Range, points: int = 61) -> List[Tuple[float, Margin]]:
    """Return the values of the quantity, and the least margin at each."""
    step = (over.last - over.first) / (points - 1)
    values = [over.first + step * number for number in range(points - 1)] + [over.last]
    return [(value, over.quantity.change(situation, value).margin()) for value in values]


def crossings(situation: Situation, over: Range, found: List[Tuple[float, Margin]]) -> List[float]:
    """Return the values between the points of a sweep at which the vehicle begins or ceases to tip over."""

    def tips(value: float) -> bool:
        return over.quantity.change(situation, value).margin().angle_rad < 0

    made = []
    for (low, before), (high, after) in zip(found, found[1:]):
        if (before.angle_rad < 0) != (after.angle_rad < 0):
            made.append(bisect(lambda value: tips(value) == (before.angle_rad < 0), low, high))  # noqa: B023
    return made


# -- the margin of an axis


class _Plane(NamedTuple):
    """The vertical plane through the centre of mass, across a tip-over axis: only forces in it tip the vehicle over.

    Points in it are along the line from the centre of mass to the axis, and perpendicular to it, down and to the
    inside; a net force keeps the vehicle down if it has a part there.
    """

    mass: Mass
    out: Point  # horizontal unit vector, out of the vehicle
    reach_m: float  # distance of the axis from the centre of mass along `out`
    arm_m: float  # distance of the axis from the centre of mass

    def seen(self, vector: Vector) -> Point:
        """The part of a vector in this plane."""
        out, up = vector[0] * self.out[0] + vector[1] * self.out[1], vector[2]
        reach, height = self.reach_m / self.arm_m, self.mass.height_m / self.arm_m
        return out * reach - up * height, -out * height - up * reach

    def vector(self, point: Point) -> Vector:
        """The vector of a point in this plane."""
        reach, height = self.reach_m / self.arm_m, self.mass.height_m / self.arm_m
        out = point[0] * reach - point[1] * height
        return out * self.out[0], out * self.out[1], -point[0] * height - point[1] * reach


@functools.lru_cache(maxsize=8)
def _edges(points: Tuple[Point, ...]) -> Sequence[Tuple[Point, Point]]:
    corners = hull(points)
    return tuple(zip(corners, corners[1:] + corners[:1]))


def _planes(vehicle: Vehicle) -> List[_Plane]:
    mass, planes = vehicle.whole, []
    for (x, y), (to_x, to_y) in _edges(vehicle.contacts):
        length_m = math.hypot(to_x - x, to_y - y)
        out = (to_y - y) / length_m, (x - to_x) / length_m
        reach_m = (x - mass.x_m) * out[0] + (y - mass.y_m) * out[1]
        planes.append(_Plane(mass, out, reach_m, math.hypot(reach_m, mass.height_m)))
    return planes


def _margin(vehicle: Vehicle, plane: _Plane, acceleration_m_s2: Point, slope: Point, push: Push) -> Margin:
    mass = plane.mass
    weight_n = mass.mass_kg * GRAVITY_M_S2
    net_x, net_y = (weight_n * s - mass.mass_kg * a for s, a in zip(slope, acceleration_m_s2))
    down = math.sqrt(max(0.0, 1 - slope[0] ** 2 - slope[1] ** 2))
    towards, off = plane.seen((net_x, net_y, -weight_n * down))
    direction = NOTHING
    if push.force_n:
        x, y, height = vehicle.tip if push.at_m is None else push.at_m
        at = plane.seen((x - mass.x_m, y - mass.y_m, height - mass.height_m))
        if push.direction is None:
            seen = _worst_direction(plane, (towards, off), push.force_n, at)
            direction = plane.vector(seen)
        else:
            seen, direction = plane.seen(push.direction), push.direction
        # on the centre of mass, this force would tip as the push does
        extra = seen[0], seen[1] - (at[0] * seen[1] - at[1] * seen[0]) / plane.arm_m
        towards, off = towards + push.force_n * extra[0], off + push.force_n * extra[1]
    return Margin(math.atan2(off, towards), direction)


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
