"""Free distance in any direction, from sonar ranges and laser scans.  No I/O.

Directions are unit vectors in base_link; points are x and y in base_link [m].
"""

import math
import sys
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.robot.models import Body, SonarMount

Point = Tuple[float, float]
AHEAD: Point = (1.0, 0.0)
BESIDE_RAD = math.radians(5.0)
"""A sonar covers directions up to this angle next to its cone; two MB1300 45 deg apart leave no gap."""
MOST_RAYS = 8192
"""A scan with more rays is not used.  A laser with a ray each 0.05 deg all around has 7200.  For 8192 rays the zones
hold their lock for about 10 ms."""
GAP_RAD = math.radians(3.0)
"""Rays without a reading are a gap if the readings on either side are farther apart than this: 5 cm at 1 m.  Lasers
lose single rays at edges and on dark spots."""
_ROUNDING = 1e-9


class Outline(NamedTuple):
    """A robot's outline seen from above, and the clearance on each side of its path."""

    half_length_m: float
    half_width_m: float
    clearance_m: float

    def room(self, point: Point, direction: Point) -> float:
        """Return how far the outline may move before it reaches a point [m]; infinity if it passes by."""
        if point[0] * direction[0] + point[1] * direction[1] <= 0:
            return math.inf
        enter, leave = -math.inf, math.inf
        halves = self.half_length_m + self.clearance_m, self.half_width_m + self.clearance_m
        for place, along, half in zip(point, direction, halves):
            if abs(along) < _ROUNDING:
                if abs(place) > half + _ROUNDING:
                    return math.inf
                continue
            half = math.copysign(half, along)
            enter, leave = max(enter, (place - half) / along), min(leave, (place + half) / along)
        return enter + self.clearance_m if enter <= leave + _ROUNDING else math.inf

    def sides(self, direction: Point) -> List[float]:
        """Return the distances of the corners to the left of the centre's path [m]."""
        x = direction[1] * (self.half_length_m + self.clearance_m)
        y = direction[0] * (self.half_width_m + self.clearance_m)
        return [y + x, y - x, x - y, -x - y]

    def strip(self, direction: Point, length_m: float) -> List[Point]:
        """Return the corners of the area that the outline enters when it moves that far."""
        near, sides, (x, y) = self._reach_m(direction), self.sides(direction), direction
        far, right, left = near + length_m, min(sides), max(sides)
        corners = (near, left), (far, left), (far, right), (near, right)
        return [(along * x - side * y, along * y + side * x) for along, side in corners]

    def meets(self, start: Point, ray: Point, direction: Point) -> bool:
        """Return whether a ray from a point crosses the area that the outline enters, however far it moves."""
        (x, y), sides = direction, self.sides(direction)
        ahead, aside = ray[0] * x + ray[1] * y, ray[1] * x - ray[0] * y
        if ahead <= 0:
            return False
        way = max(0.0, (self._reach_m(direction) - start[0] * x - start[1] * y) / ahead)
        side = start[1] * x - start[0] * y + way * aside
        return (side >= min(sides) or aside > 0) and (side <= max(sides) or aside < 0)

    def wall_room(self, point: Point, direction: Point) -> float:
        """Return how far the outline may move until it touches a wall across the path at a point [m]."""
        return point[0] * direction[0] + point[1] * direction[1] - self._reach_m(direction)

    def _reach_m(self, direction: Point) -> float:
        return self.half_length_m * abs(direction[0]) + self.half_width_m * abs(direction[1])


def outline_of(body: Body, clearance_m: float) -> Outline:
    """Return the outline of a body whose centre is the origin of base_link."""
    return Outline(body.length_m / 2, body.width_m / 2, clearance_m)


class Scan(NamedTuple):
    """Ranges of a laser [m], angle of the first ray, angle between rays (counter-clockwise), and mounting pose.

    -inf counts as the shortest range `near_m`.  NaN and other ranges below that are not readings; nor are +inf and
    ranges beyond `far_m`, unless `inf_is_free`: then nothing is in range there.
    """

    ranges: Sequence[float]
    first_rad: float
    step_rad: float
    near_m: float
    mount: Pose  # in base_link
    far_m: float = math.inf
    inf_is_free: bool = False

    @property
    def trouble(self) -> str:
        """Why the scan must not be used; empty if it may."""
        if not 0 < len(self.ranges) <= MOST_RAYS:
            return f"it has {len(self.ranges)} rays, expected 1 to {MOST_RAYS}"
        if not math.isfinite(self.first_rad + len(self.ranges) * self.step_rad):
            return f"its rays begin at {self.first_rad:g} rad with steps of {self.step_rad:g}, expected finite numbers"
        if not 0 <= self.near_m < math.inf:
            return f"its shortest range is {self.near_m:g}, expected a number from 0"
        if not all(map(math.isfinite, self.mount)):
            return f"its mount is {self.mount}, expected finite numbers"
        return ""

    def points(self) -> Dict[int, Point]:
        """Return the points that rays hit, by the numbers of the rays."""
        x, y, yaw = self.mount
        points = {}
        for number, range_m in enumerate(self.ranges):
            if self.near_m <= range_m <= self.far_m and range_m < math.inf or range_m == -math.inf:
                range_m, angle = max(range_m, self.near_m), yaw + self.angle_rad(number)
                points[number] = x + range_m * math.cos(angle), y + range_m * math.sin(angle)
        return points

    def gaps(self) -> List[int]:
        """Return the numbers of the rays without a reading, except those of a width of up to `GAP_RAD`.

        In a full circle, the last rays are next to the first ones.
        """
        most_m = math.inf if self.inf_is_free else min(self.far_m, sys.float_info.max)
        known = [n for n, m in enumerate(self.ranges) if self.near_m <= m <= most_m or m == -math.inf]
        count, step_rad = len(self.ranges), abs(self.step_rad)
        if not known:
            return list(range(count))
        ends = (known[-1] - count, known[0] + count) if (count + 1) * step_rad >= math.tau else (-1, count)
        gaps: Set[int] = set()
        for before, after in zip([ends[0], *known], [*known, ends[1]]):
            if (after - before) * step_rad > GAP_RAD + _ROUNDING:
                gaps.update(number % count for number in range(before + 1, after))
        return sorted(gaps)

    def angle_rad(self, number: float) -> float:
        """Return the angle of a ray in the frame of the laser."""
        return self.first_rad + number * self.step_rad

    def number_at(self, angle_rad: float) -> float:
        """Return the number of the ray nearest to an angle; it may be one that the scan does not have."""
        return ((angle_rad - self.first_rad) / self.step_rad + 0.5) // 1 if self.step_rad else 0.0

    def looks(self, direction: Point) -> bool:
        """Return whether the direction lies between the first and the last ray."""
        first = self.first_rad + self.mount.yaw_rad
        low, high = sorted((first, first + self.step_rad * (len(self.ranges) - 1)))
        return low + (math.atan2(direction[1], direction[0]) - low) % (2 * math.pi) <= high + _ROUNDING


def off_axis(mount: SonarMount, direction: Point) -> float:
    """Return the angle between a sonar's axis and a direction, 0 to pi [rad]."""
    return abs(wrap_angle(mount.pose.yaw_rad - math.atan2(direction[1], direction[0])))


def looks(mount: SonarMount, direction: Point) -> bool:
    """Return whether the whole cone of a sonar is ahead of a robot that moves in this direction."""
    return off_axis(mount, direction) < (math.pi - mount.kind.field_of_view_rad) / 2


def covers(mount: SonarMount, direction: Point) -> bool:
    """Return whether a sonar covers a direction."""
    return off_axis(mount, direction) <= mount.kind.field_of_view_rad / 2 + BESIDE_RAD


def sonar_room(outline: Outline, mount: SonarMount, range_m: float, direction: Point) -> float:
    """Return the free distance if there is an object at this range (REP 117, no NaN) anywhere in a sonar's cone [m]."""
    if math.isinf(range_m):
        return max(0.0, range_m)
    yaw, left = math.radians(mount.yaw_deg), math.atan2(direction[0], -direction[1])
    half = mount.kind.field_of_view_rad / 2
    angles = [yaw - half, yaw, yaw + half]  # between these and those of the sides the nearest point is an end
    for side_m in outline.sides(direction) if range_m > 0 else ():
        cosine = (side_m - direction[0] * mount.y_m + direction[1] * mount.x_m) / range_m
        if abs(cosine) <= 1:
            angles += [left - math.acos(cosine), left + math.acos(cosine)]
    seen = (angle for angle in angles if abs(wrap_angle(angle - yaw)) <= half + _ROUNDING)
    points = ((mount.x_m + range_m * math.cos(at), mount.y_m + range_m * math.sin(at)) for at in seen)
    return min(outline.room(point, direction) for point in points)


def slant_room(outline: Outline, mount: SonarMount, range_m: float, direction: Point) -> float:
    """As `sonar_room`, for a direction that no sonar covers: a wall across the path is then seen only at an angle, by
    the edge of the cone nearest to the direction.
    """
    room_m = sonar_room(outline, mount, range_m, direction)
    if math.isinf(range_m):
        return room_m
    yaw, half = math.radians(mount.yaw_deg), mount.kind.field_of_view_rad / 2
    aside = wrap_angle(math.atan2(direction[1], direction[0]) - yaw)
    angle = yaw + max(-half, min(half, aside))
    edge = mount.x_m + range_m * math.cos(angle), mount.y_m + range_m * math.sin(angle)
    return min(room_m, outline.wall_room(edge, direction))


def scan_gap(outline: Outline, scan: Scan, gaps: Sequence[int], direction: Point) -> bool:
    """Return whether one of the rays `gaps` of a scan crosses the path in a direction."""
    x, y, yaw = scan.mount
    angles = (yaw + scan.angle_rad(number) for number in gaps)
    return any(outline.meets((x, y), (math.cos(angle), math.sin(angle)), direction) for angle in angles)


def scan_room(outline: Outline, points: Sequence[Point], direction: Point) -> float:
    """Return the free distance if a laser has seen these points [m]."""
    return min((outline.room(point, direction) for point in points), default=math.inf)


Room = Callable[[Point], float]
Gap = Callable[[Point], bool]


class Sight:
    """The last reading of a sensor, and where the robot may have been then."""

    def __init__(self) -> None:
        self.heard_s = self.known_s = -math.inf
        self._rooms: Tuple[Room, ...] = ()
        self._gap: Optional[Gap] = None
        self._found: Dict[Tuple[Point, bool], float] = {}
        self._gaps: Dict[Point, bool] = {}
        self._places: Sequence[Point] = ()

    def hear(self, now: float) -> None:
        """Note a message without a valid reading."""
        self.heard_s = now

    def know(
        self, room: Room, slant_room: Room, places: Sequence[Point], now: float, gap: Optional[Gap] = None
    ) -> None:
        """Note a valid reading: the free distance by direction, and the possible places of the robot.

        `room` applies to covered directions, `slant_room` to directions seen only at an angle.  `gap` says in which
        directions the reading does not know all that may be in the way; None: in none.
        """
        self.heard_s = self.known_s = now
        self._rooms, self._gap, self._places = (slant_room, room), gap, places
        self._found.clear()
        self._gaps.clear()

    def knows(self, direction: Point) -> bool:
        """Return whether the last message has a valid reading for this direction."""
        if self._gap is not None and direction not in self._gaps:
            self._gaps[direction] = self._gap(direction)
        return self.known_s == self.heard_s and not self._gaps.get(direction, False)

    def room_m(self, direction: Point, watched: bool, place: Point) -> float:
        """Return the free distance of the robot at this place [m]."""
        if (direction, watched) not in self._found:
            self._found[direction, watched] = self._rooms[watched](direction)
        least = min(direction[0] * x + direction[1] * y for x, y in self._places)
        return self._found[direction, watched] - (direction[0] * place[0] + direction[1] * place[1] - least)
