"""A real robot in a virtual world: others meet it there, and its own ranges become the closer of real and virtual.

The robot is placed by its odometry, whose errors grow with the distance driven.  The margin grows with them: it is
`Margin.start_m` and `Margin.share` of the distance since the place was known.  The virtual robots meet a body that is
larger by the margin on each side, and the robot's own virtual ranges are shorter by the margin.
"""

import math
from typing import Any, NamedTuple, Optional

from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot.models import SonarMount
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.world import World


class Margin(NamedTuple):
    """How far a robot may be from the place by its odometry.

    The defaults are for a robot whose wheels slip by 1 %, unknown to its odometry, and that a person put on its mark.
    `mrl experiment mixed-team` has the largest drift beyond this margin.
    """

    start_m: float = 0.1  # while the robot has not moved since its place was known [m]
    share: float = 0.03  # share of the distance driven since then


NO_MARGIN = Margin(0.0, 0.0)


class Mirror:
    """The place of one real robot in a world, until `close`; the world's walls count as obstacles of the robot.

    Its odometry began at the pose `origin` in the world; `margin` says how the margin grows.
    """

    def __init__(
        self, world: World, name: str, footprint: Footprint, origin: Pose = ORIGIN, margin: Margin = NO_MARGIN
    ) -> None:
        self._world, self._name, self._footprint = world, name, footprint
        self._margin = margin
        self.locate(origin)

    def locate(self, origin: Pose) -> None:
        """Takes the pose in the world at which the odometry is 0, as just measured; the margin begins again."""
        self._origin, self.margin_m = origin, self._margin.start_m
        self.pose: Optional[Pose] = None  # pose in the world; the robot may be `margin_m` from it

    def moved(self, x_m: float, y_m: float, yaw_rad: float) -> Pose:
        """Takes the robot's odometry pose; returns its pose in the world."""
        pose = self._origin.compose(x_m, y_m, yaw_rad)
        if self.pose is not None:
            self.margin_m += self._margin.share * math.dist(pose[:2], self.pose[:2])
        self.pose = pose
        self._world.place(self._name, pose, self._footprint.grown(self.margin_m))
        return pose

    def closer(self, range_m: float, mount: SonarMount) -> float:
        """The closer of a sonar's own range and its virtual one [m], as in REP 117; NaN if it has no valid range."""
        if math.isnan(range_m) or self.pose is None:
            return math.nan
        at, sensor = self.pose.compose(*mount.pose), mount.kind
        half_rad = sensor.field_of_view_rad / 2
        virtual_m = self._world.nearest(at, half_rad, sensor.farthest_m, self._name) - self.margin_m
        return min(range_m, virtual_m if virtual_m >= sensor.nearest_m else -math.inf)

    def scan(
        self, mount: Pose, first_rad: float, step_rad: float, rays: int, far_m: float, near_m: float
    ) -> Any:
        """Virtual ranges [m] of a laser at `mount` in base_link, an array `(rays,)`, as in REP 117."""
        from sim_arduino.world.rays import np

        assert self.pose is not None
        at = self.pose.compose(*mount)
        ranges = self._world.scan(at, first_rad, step_rad, rays, far_m, self._name) - self.margin_m
        return np.where(ranges < near_m, -np.inf, ranges)

    def close(self) -> None:
        """Removes the robot from the world."""
        self._world.remove(self._name)
