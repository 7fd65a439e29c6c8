"""A laser scanner: the Hokuyo URG-04LX as mounted on the robots, or another one."""

import math
from typing import Any, NamedTuple

from mrl_driver.geometry import Pose
from mrl_driver.robot.models import LaserMount
from sim_arduino.world.world import World


class Laser(NamedTuple):
    """Data of a scanner.  Angles are counter-clockwise from its x axis."""

    first_rad: float
    step_rad: float
    rays: int
    rate_hz: float
    near_m: float
    far_m: float
    error_m: float  # largest error at distances up to 1 m [m]
    error_share: float  # largest error beyond 1 m, as a share of the distance
    mount: LaserMount = LaserMount()


URG_04LX = Laser(-256 * math.tau / 1024, math.tau / 1024, 512, 10.0, 0.02, 4.095, 0.010, 0.02)
"""180 of the 240 degrees in 512 readings and 10 Hz: launch file of 2013; errors and ranges: (Araujo 2012)."""


class LaserScanner:
    """Takes scans of a world; `seed` draws the laser's errors."""

    def __init__(self, world: World, laser: Laser = URG_04LX, seed: int = 0) -> None:
        import numpy as np

        self.laser = laser
        self._world = world
        self._rng = np.random.default_rng(seed)

    def scan(self, robot: Pose, without: str = "") -> Any:
        """Ranges [m], `(rays,)`, from a pose of the robot `without`; +inf if nothing is in range, -inf if too near."""
        import numpy as np

        laser = self.laser
        pose = robot.compose(laser.mount.x_m, laser.mount.y_m, math.radians(laser.mount.yaw_deg))
        ranges = self._world.scan(
            pose, laser.first_rad, laser.step_rad, laser.rays, laser.far_m, without=without
        )
        bound = np.where(ranges <= 1.0, laser.error_m, laser.error_share * ranges)
        bound[~np.isfinite(ranges)] = 0.0
        ranges = ranges + bound * np.clip(self._rng.normal(0.0, 0.5, laser.rays), -1.0, 1.0)
        return np.where(ranges < laser.near_m, -np.inf, np.where(ranges > laser.far_m, np.inf, ranges))
