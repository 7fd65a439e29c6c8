"""What sonars and a laser say of the way that is free in any direction.  Pure.

Directions are vectors of length 1 in base_link, points are x and y there [m].
"""

import math
from typing import Callable, Dict, List, NamedTuple, Sequence, Tuple

from mrl_driver.robot.models import Body, SonarMount
from mrl_driver.robot.sonar import FIELD_OF_VIEW_RAD

Point = Tuple[float, float]
AHEAD: Point = (1.0, 0.0)
COVERED_RAD = FIELD_OF_VIEW_RAD / 2 + math.radians(5.0)
"""A sonar is said to look at what is no further than this beside its axis; two that stand 45 deg apart leave no gap."""
_MEMORY = 16
_ROUNDING = 1e-9


class Outline(NamedTuple):
    """A robot's outline seen from above, and what is to stay free beside its way."""

    half_length_m: float
    half_width_m: float
    clearance_m: float

    def room(self, point: Point, way: Point) -> float:
        """How far the outline may move along `way` until it is at a point [m]; infinite where it passes beside it."""
        if point[0] * way[0] + point[1] * way[1] <= 0:
            return math.inf
        enter, leave = -math.inf, math.inf
        halves = self.half_length_m + self.clearance_m, self.half_width_m + self.clearance_m
        for place, along, half in zip(point, way, halves):
            if abs(along) < _ROUNDING:
                if abs(place) > half + _ROUNDING:
                    return math.inf
                continue
            half = math.copysign(half, along)
            enter, leave = max(enter, (place - half) / along), min(leave, (place + half) / along)
        return enter + self.clearance_m if enter <= leave + _ROUNDING else math.inf

    def sides(self, way: Point) -> List[float]:
        """How far the corners are to the left of the middle's way [m]."""
        length, width = self.half_length_m + self.clearance_m, self.half_width_m + self.clearance_m
        return [way[0] * y - way[1] * x for x in (length, -length) for y in (width, -width)]

    def wall_room(self, point: Point, way: Point) -> float:
        """How far it may move until it touches a wall straight across the way at a point [m]."""
        reach_m = self.half_length_m * abs(way[0]) + self.half_width_m * abs(way[1])
        return point[0] * way[0] + point[1] * way[1] - reach_m


def outline_of(body: Body, clearance_m: float) -> Outline:
    """The outline of a body whose middle is that of base_link."""
    return Outline(body.length_m / 2, body.width_m / 2, clearance_m)


class Scan(NamedTuple):
    """Ranges of a laser [m], the angle of the first and between two (counter-clockwise), and where it sits."""

    ranges: Sequence[float]
    first_rad: float
    step_rad: float
    near_m: float
    mount: Tuple[float, float, float]
    """x, y, yaw in base_link [m m rad]."""

    @property
    def valid(self) -> bool:
        """Some ray has a reading; nothing in range is one."""
        return any(range_m >= self.near_m or range_m == -math.inf for range_m in self.ranges)

    def points(self) -> List[Point]:
        """What the rays hit.

        -inf is as near as the laser can measure; other ranges below that, and NaN, are no readings.
        """
        x, y, yaw = self.mount
        points = []
        for number, range_m in enumerate(self.ranges):
            if self.near_m <= range_m < math.inf or range_m == -math.inf:
                range_m, angle = max(range_m, self.near_m), yaw + self.first_rad + number * self.step_rad
                points.append((x + range_m * math.cos(angle), y + range_m * math.sin(angle)))
        return points

    def looks(self, way: Point) -> bool:
        """The direction lies in the fan of the rays."""
        first = self.first_rad + self.mount[2]
        low, high = sorted((first, first + self.step_rad * (len(self.ranges) - 1)))
        return low + (math.atan2(way[1], way[0]) - low) % (2 * math.pi) <= high + _ROUNDING


def off_axis(mount: SonarMount, way: Point) -> float:
    """Angle between a sonar's axis and a direction, 0 to pi [rad]."""
    return abs(math.remainder(math.radians(mount.yaw_deg) - math.atan2(way[1], way[0]), 2 * math.pi))


def looks(mount: SonarMount, way: Point) -> bool:
    """A sonar sees only what is before a robot that moves so: its cone does not reach across the side."""
    return off_axis(mount, way) < (math.pi - FIELD_OF_VIEW_RAD) / 2


def sonar_room(outline: Outline, mount: SonarMount, range_m: float, way: Point) -> float:
    """Free way where something is at that range (REP-117, no NaN), anywhere in a sonar's cone [m]."""
    if math.isinf(range_m):
        return math.inf if range_m > 0 else 0.0
    yaw, heading = math.radians(mount.yaw_deg), math.atan2(way[1], way[0])
    half = FIELD_OF_VIEW_RAD / 2
    angles = [yaw - half, yaw, yaw + half]
    for side_m in outline.sides(way):  # between these, nothing on the arc is nearer than at its ends
        sine = (side_m - way[0] * mount.y_m + way[1] * mount.x_m) / range_m if range_m > 0 else math.inf
        if abs(sine) <= 1:
            angles += [heading + math.asin(sine), heading + math.pi - math.asin(sine)]
    rooms_m = [
        outline.room((mount.x_m + range_m * math.cos(angle), mount.y_m + range_m * math.sin(angle)), way)
        for angle in angles
        if abs(math.remainder(angle - yaw, 2 * math.pi)) <= half + _ROUNDING
    ]
    return min(rooms_m, default=math.inf)


def slant_room(outline: Outline, mount: SonarMount, range_m: float, way: Point) -> float:
    """The same where no sonar looks straight into the direction, so that a wall across it is seen slantwise only: by
    the edge of the cone that is nearest to the direction.
    """
    room_m = sonar_room(outline, mount, range_m, way)
    if math.isinf(range_m):
        return room_m
    yaw, half = math.radians(mount.yaw_deg), FIELD_OF_VIEW_RAD / 2
    aside = math.remainder(math.atan2(way[1], way[0]) - yaw, 2 * math.pi)
    angle = yaw + max(-half, min(half, aside))
    edge = mount.x_m + range_m * math.cos(angle), mount.y_m + range_m * math.sin(angle)
    return min(room_m, outline.wall_room(edge, way))


def scan_room(outline: Outline, points: Sequence[Point], way: Point) -> float:
    """Free way where a laser has seen these points [m]."""
    return min((outline.room(point, way) for point in points), default=math.inf)


Room = Callable[[Point], float]


class Sight:
    """What a sensor said last, and where the robot may have been then."""

    def __init__(self) -> None:
        self.heard_s = self.known_s = -math.inf
        self._rooms: Tuple[Room, ...] = ()
        self._found: Dict[Tuple[Point, bool], float] = {}
        self._places: Sequence[Point] = ((0.0, 0.0),)

    def hear(self, now: float) -> None:
        """It spoke, and had no valid reading."""
        self.heard_s = now

    def know(self, room: Room, slant_room: Room, places: Sequence[Point], now: float) -> None:
        """It told the free way by direction, watched ones and those seen slantwise only, at one of these places."""
        self.heard_s = self.known_s = now
        self._rooms, self._places = (slant_room, room), places
        self._found.clear()

    def room_m(self, way: Point, watched: bool, place: Point) -> float:
        """Free way of the robot at that place [m]."""
        if (way, watched) not in self._found:
            if len(self._found) >= _MEMORY:
                self._found.clear()
            self._found[way, watched] = self._rooms[watched](way)
        least = min(way[0] * x + way[1] * y for x, y in self._places)
        return self._found[way, watched] - (way[0] * place[0] + way[1] * place[1] - least)
