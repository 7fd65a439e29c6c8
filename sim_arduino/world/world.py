"""The world around the robots: fixed walls, moving robots, sources for the sensors.

    world = world_file.load("l-course")                     # a packaged world, a world file, or a map_server map
    world.nearest(pose, math.radians(18), 6.45)             # range of a sonar
    world.scan(pose, -1.57, 0.006136, 512, 4.095)           # what a laser sees

Distances are exact for straight walls.
"""

import math
from typing import Any, Dict, List, Optional, Sequence, Tuple

from mrl_driver.geometry import ORIGIN, Pose

from .radio import RadioMedium
from .robots import Mover, RobotRegistry
from .scene import Scene
from .shapes import Footprint, Wall, distance, encloses, nearest_in_cone

__all__ = ["ORIGIN", "Footprint", "Pose", "Wall", "World"]

FEW = 96  # up to this number of walls a loop is as fast as arrays, and it starts faster


class WallIndex:
    """Exact answers about a fixed set of walls: by a loop for few walls, by arrays for many."""

    def __init__(self, walls: Sequence[Wall]) -> None:
        self.walls = list(walls)
        self._array: Any = None
        self._circles: Any = None

    def array(self) -> Any:
        """The walls as `(N, 4)`, columns x1 y1 x2 y2 [m]."""
        if self._array is None:
            import numpy as np

            self._array = np.array(self.walls, dtype=float).reshape(-1, 4)
        return self._array

    def nearest(self, pose: Pose, half_angle_rad: float, range_m: float) -> float:
        """Distance to the nearest point of any wall in a cone along the pose's x [m]; infinite beyond range."""
        if len(self.walls) <= FEW:
            return nearest_in_cone(self.walls, pose, half_angle_rad, range_m)
        from . import rays

        if self._circles is None:
            self._circles = rays.circles(self.array())
        near = rays.near_cone(self._circles, pose, half_angle_rad, range_m)
        return nearest_in_cone([self.walls[i] for i in near.tolist()], pose, half_angle_rad, range_m)

    def clearance(self, x: float, y: float) -> float:
        """Distance from a point to the nearest wall [m]; infinite without walls."""
        if len(self.walls) <= FEW:
            return min((distance(wall, x, y) for wall in self.walls), default=math.inf)
        from . import rays

        return float(rays.distances(self.array(), x, y).min())

    def near(self, x: float, y: float, radius_m: float) -> List[Wall]:
        """Walls that are closer to a point than `radius_m`."""
        if len(self.walls) <= FEW:
            return [wall for wall in self.walls if distance(wall, x, y) < radius_m]
        from . import rays

        return [self.walls[i] for i in (rays.distances(self.array(), x, y) < radius_m).nonzero()[0].tolist()]


class World:
    """Walls, robots, sources for the sensors, and the pose at which a robot starts."""

    def __init__(
        self, walls: Sequence[Wall] = (), start: Pose = ORIGIN, scene: Optional[Scene] = None
    ) -> None:
        self.start = start
        self.scene = Scene() if scene is None else scene  # heat, gas, dust, light and north
        self.registry = RobotRegistry()
        """The robots, of this process or of all processes that share the world."""
        self.radio = RadioMedium()
        """The air between the robots' radios, of this process or of all processes that share the world."""
        self.standing: Dict[str, Mover] = {}
        """Parked robots by name; each is there until a real robot with its name takes its place."""
        self.solids: List[List[Wall]] = []  # closed lines among the walls that are solid inside: boxes, a map
        self._index = WallIndex(walls)

    @property
    def walls(self) -> List[Wall]:
        """The fixed walls."""
        return self._index.walls

    def place(self, name: str, pose: Pose, footprint: Footprint) -> None:
        """Puts a robot into the world, or moves it."""
        self.registry.place(name, pose, footprint)

    def remove(self, name: str) -> None:
        """Takes a robot out of the world, if it is there."""
        self.registry.remove(name)

    def robots(self, without: str = "") -> List[Mover]:
        """All robots except the one named `without`."""
        there = self.registry.others(without)
        if not self.standing:
            return there
        taken = {without, *(mover.name for mover in there)}
        return there + [mover for name, mover in self.standing.items() if name not in taken]

    def _gaps(self, x: float, y: float, without: str) -> List[Tuple[float, Mover]]:
        """The other robots, each with its distance from a point to the circle around it [m]."""
        hypot, known, radius_m = math.hypot, None, 0.0
        found = []
        for mover in self.robots(without):
            _, at, footprint = mover
            if footprint != known:
                known, radius_m = footprint, footprint.radius_m
            found.append((hypot(at[0] - x, at[1] - y) - radius_m, mover))
        return found

    def without_walls(self) -> "World":
        """The same robots, without walls: for a robot whose own sonars see the real walls."""
        alone = World()
        alone.registry, alone.standing = self.registry, self.standing
        return alone

    def start_of(self, name: str) -> Pose:
        """Start pose of the robot with this name: its own in `standing`, else the world's start pose."""
        return self.standing[name].pose if name in self.standing else self.start

    def nearest(self, pose: Pose, half_angle_rad: float, range_m: float, without: str = "") -> float:
        """Distance from `pose` to the nearest point inside a cone along its x axis [m]; infinite beyond `range_m`.

        Exact for a flat cone: the echo comes from the nearest surface, which nothing can hide.
        """
        least = min(range_m, self._index.nearest(pose, half_angle_rad, range_m))
        for gap_m, mover in self._in_cone(pose, half_angle_rad, least, without):
            if gap_m >= least:
                break
            outline = mover.footprint.outline(mover.pose)
            least = min(least, nearest_in_cone(outline, pose, half_angle_rad, least))
        return least if least < range_m else math.inf

    def _in_cone(
        self, pose: Pose, half_angle_rad: float, range_m: float, without: str
    ) -> List[Tuple[float, Mover]]:
        """Robots whose circle reaches into a cone along the pose's x axis, the nearest circle first."""
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        along, across = math.cos(half_angle_rad), math.sin(half_angle_rad)
        found = []
        for each in self._gaps(pose.x_m, pose.y_m, without):
            gap_m, (_, at, footprint) = each
            if gap_m >= range_m:
                continue
            dx, dy = at[0] - pose.x_m, at[1] - pose.y_m
            u, v = cos * dx + sin * dy, cos * dy - sin * dx
            if abs(v) * along - u * across <= footprint.radius_m >= -u:
                found.append(each)
        return sorted(found)

    def scan(
        self, pose: Pose, first_rad: float, step_rad: float, count: int, range_m: float, without: str = ""
    ) -> Any:
        """Distances along `count` rays from `pose` [m], an array `(count,)`; infinite if nothing is in range.

        The first ray leaves at `first_rad` from the pose's x axis, each next one `step_rad` further to the left.
        """
        from . import rays

        walls, gaps = self._index.array(), self._gaps(pose.x_m, pose.y_m, without)
        near = (mover for gap_m, mover in gaps if gap_m < range_m)
        moving = [side for mover in near for side in mover.footprint.outline(mover.pose)]
        if moving:
            walls = rays.np.concatenate((walls, rays.np.array(moving)))
        return rays.cast(walls, pose, first_rad, step_rad, count, range_m)

    def sees(self, from_x: float, from_y: float, to_x: float, to_y: float) -> bool:
        """Whether no wall stands between two points."""
        way = Wall(from_x, from_y, to_x, to_y)
        return not any(_cross(way, wall) for wall in self.walls)

    def clearance(self, x: float, y: float, without: str = "") -> float:
        """Distance from a point to the nearest wall or robot [m]; a robot counts as the circle around it."""
        gaps = (gap_m for gap_m, _ in self._gaps(x, y, without))
        return min(self._index.clearance(x, y), min(gaps, default=math.inf))

    def touching(self, pose: Pose, footprint: Footprint, without: str = "") -> List[Wall]:
        """Walls, and sides of other robots, that reach into a robot at `pose`."""
        reach = footprint.radius_m
        near = self._index.near(pose.x_m, pose.y_m, reach)
        for gap_m, mover in self._gaps(pose.x_m, pose.y_m, without):
            if gap_m < reach:
                near += mover.footprint.outline(mover.pose) + mover.footprint.inside(mover.pose)
        return [wall for wall in near if footprint.touches(pose, wall)]

    def is_solid(self, x: float, y: float) -> bool:
        """Whether a point is inside a solid."""
        return any(encloses(outline, x, y) for outline in self.solids)

    def bounds(self) -> Tuple[float, float, float, float]:
        """Smallest x and y, largest x and y of walls and start [m]."""
        xs = [self.start.x_m, *(x for wall in self.walls for x in (wall.x1, wall.x2))]
        ys = [self.start.y_m, *(y for wall in self.walls for y in (wall.y1, wall.y2))]
        return min(xs), min(ys), max(xs), max(ys)


def _cross(a: Wall, b: Wall) -> bool:
    """Whether two walls cross."""

    def side(of: Wall, x: float, y: float) -> float:
        return (of.x2 - of.x1) * (y - of.y1) - (of.y2 - of.y1) * (x - of.x1)

    return side(a, b.x1, b.y1) * side(a, b.x2, b.y2) < 0.0 and side(b, a.x1, a.y1) * side(b, a.x2, a.y2) < 0.0
