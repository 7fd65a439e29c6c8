"""Plane geometry: walls, and the outlines of robots.  Metres and radians; no world, no time."""

import math
from typing import Iterable, List, NamedTuple, Sequence

from mrl_driver.geometry import Pose


class Wall(NamedTuple):
    """A straight wall between two points [m]."""

    x1: float
    y1: float
    x2: float
    y2: float


def in_cone(u: float, v: float, du: float, dv: float, slope: float) -> float:
    """Squared distance from the origin to the part of the segment (u, v) + t (du, dv) where |v| <= slope u."""
    low, high = 0.0, 1.0
    for base, change in ((slope * u - v, slope * du - dv), (slope * u + v, slope * du + dv)):
        if base < 0.0 and base + change < 0.0:
            return math.inf
        if base < 0.0:
            low = max(low, -base / change)
        elif base + change < 0.0:
            high = min(high, -base / change)
    length2 = du * du + dv * dv
    if low > high or length2 == 0.0:
        return math.inf
    t = min(high, max(low, -(u * du + v * dv) / length2))
    return (u + t * du) ** 2 + (v + t * dv) ** 2


def nearest_in_cone(walls: Iterable[Wall], pose: Pose, half_angle_rad: float, range_m: float) -> float:
    """Distance from `pose` to the nearest point of any wall in a cone along its x [m]; infinite beyond `range_m`."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    slope = math.tan(half_angle_rad)
    limit = least = range_m * range_m
    for x1, y1, x2, y2 in walls:
        dx, dy = x1 - pose.x_m, y1 - pose.y_m
        ex, ey = x2 - x1, y2 - y1
        seen = in_cone(
            cos * dx + sin * dy, cos * dy - sin * dx, cos * ex + sin * ey, cos * ey - sin * ex, slope
        )
        least = min(least, seen)
    return math.sqrt(least) if least < limit else math.inf


def distance(wall: Wall, x: float, y: float) -> float:
    """Distance from a point to the nearest point of a wall [m]."""
    ex, ey = wall.x2 - wall.x1, wall.y2 - wall.y1
    length2 = ex * ex + ey * ey
    t = ((x - wall.x1) * ex + (y - wall.y1) * ey) / length2 if length2 else 0.0
    t = min(1.0, max(0.0, t))
    return math.hypot(wall.x1 + t * ex - x, wall.y1 + t * ey - y)


def polygon(corners: Sequence[Sequence[float]]) -> List[Wall]:
    """The closed line through the corners."""
    return [Wall(*corners[i - 1], *corners[i]) for i in range(len(corners))]


def encloses(outlines: Iterable[Wall], x: float, y: float) -> bool:
    """Whether a point is inside closed lines, by the even-odd rule."""
    inside = False
    for x1, y1, x2, y2 in outlines:
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) / (y2 - y1) * (x2 - x1):
            inside = not inside
    return inside


_CIRCLE_CORNERS = 24


class Footprint(NamedTuple):
    """The floor area of a robot: a box around its middle, or a circle of diameter `length_m`."""

    length_m: float
    width_m: float
    is_circle: bool = False

    @property
    def radius_m(self) -> float:
        """Radius of the circle around the footprint [m]."""
        return 0.5 * (self.length_m if self.is_circle else math.hypot(self.length_m, self.width_m))

    def grown(self, margin_m: float) -> "Footprint":
        """The same footprint, larger by `margin_m` on each side."""
        return self._replace(length_m=self.length_m + 2 * margin_m, width_m=self.width_m + 2 * margin_m)

    def outline(self, pose: Pose) -> List[Wall]:
        """The sides that other robots see; a circle becomes a polygon with 24 corners on it."""
        if self.is_circle:
            step = math.tau / _CIRCLE_CORNERS
            corners = [(math.cos(i * step), math.sin(i * step)) for i in range(_CIRCLE_CORNERS)]
        else:
            corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
        half_x, half_y = 0.5 * self.length_m, 0.5 * (self.length_m if self.is_circle else self.width_m)
        return polygon([pose.compose(x * half_x, y * half_y)[:2] for x, y in corners])

    def inside(self, pose: Pose) -> List[Wall]:
        """The diagonals, which a robot inside the outline touches."""
        outline = self.outline(pose)
        half = len(outline) // 2
        return [Wall(*outline[i][:2], *outline[i + half][:2]) for i in range(0, half, max(1, half // 2))]

    def touches(self, pose: Pose, wall: Wall) -> bool:
        """Whether a wall reaches into the footprint."""
        if self.is_circle:
            return distance(wall, pose.x_m, pose.y_m) < self.radius_m
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        dx, dy, ex, ey = wall.x1 - pose.x_m, wall.y1 - pose.y_m, wall.x2 - wall.x1, wall.y2 - wall.y1
        start = cos * dx + sin * dy, cos * dy - sin * dx
        way = cos * ex + sin * ey, cos * ey - sin * ex
        low, high = 0.0, 1.0
        for at, change, half in zip(start, way, (0.5 * self.length_m, 0.5 * self.width_m)):
            if change == 0.0:
                if abs(at) >= half:
                    return False
                continue
            ends = sorted(((-half - at) / change, (half - at) / change))
            low, high = max(low, ends[0]), min(high, ends[1])
        return low < high
