"""Keeps a robot out of walls and other robots."""

import math
from typing import Callable, Optional, Set

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import RobotModel
from sim_arduino.world.shapes import Footprint, distance
from sim_arduino.world.world import World

OTHERS_M_S = 1.5  # largest speed of other robots [m/s]; it limits how long a measured clearance is valid
BUMPER_M = 0.005  # way of a bumper from its rest to the body [m]
_HALVINGS = 12
_SIZE_M = (0.01, 5.0)


def footprint_for(model: RobotModel, text: str = "box") -> Optional[Footprint]:
    """The outline of a robot: `box` has the model's length and width, `circle:RADIUS` [m] is round, `none`: no body.

    A board without motors has no body of its own, so that its `box` is None too.  Another text raises ConfigError.
    """
    if text == "none" or (text == "box" and not model.drives):
        return None
    if text == "box":
        return Footprint(model.body.length_m, model.body.width_m)
    kind, _, size = text.partition(":")
    try:
        radius = float(size)
    except ValueError:
        radius = math.nan
    if kind != "circle" or not _SIZE_M[0] <= radius <= _SIZE_M[1]:
        raise ConfigError(
            f"footprint is {text!r}, expected box, none or circle:RADIUS, {_SIZE_M[0]} to {_SIZE_M[1]:g} m"
        )
    return Footprint(2 * radius, 2 * radius, True)


def touched(world: World, body: Footprint, name: str, pose: Pose) -> Set[str]:
    """The bumpers of a robot that touch something: strips along its front, a half each, and along its rear."""
    if world.clearance(pose.x_m, pose.y_m, name) > body.radius_m + BUMPER_M:
        return set()
    front_m, quarter_m = 0.5 * body.length_m, 0.25 * body.width_m
    strips = {
        "bumper_left": (front_m, quarter_m, 2.0 * quarter_m),
        "bumper_right": (front_m, -quarter_m, 2.0 * quarter_m),
        "bumper_rear": (-front_m, 0.0, body.width_m),
    }
    return {
        bumper
        for bumper, (x_m, y_m, width_m) in strips.items()
        if world.touching(pose.compose(x_m, y_m), Footprint(2.0 * BUMPER_M, width_m), name)
    }


class Bumper:
    """Computes how far a robot can move before it hits something.

    It remembers the distance that is certainly free, and searches the world only after the robot has used it up.
    """

    def __init__(self, world: World, footprint: Footprint, name: str) -> None:
        self._world, self._footprint, self._name = world, footprint, name
        self._free_m = 0.0

    def share(self, old: Pose, distance_m: float, at: Callable[[float], Pose], dt: float) -> float:
        """Share of a motion from `old` that is possible, 0 to 1; `at` gives the pose after a share of the motion.

        It lasts `dt` [s], and no wheel goes farther than `distance_m`: the robot's middle moves at most twice that [m].
        """
        self._free_m -= 2.0 * distance_m + OTHERS_M_S * dt
        if self._free_m > 0.0 or self._gets_to(old, at(1.0)):
            return 1.0
        if not self._gets_to(old, at(0.5**_HALVINGS)):
            return 0.0  # already in contact (the common case)
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._gets_to(old, at(middle)) else (low, middle)
        return low

    def _gets_to(self, old: Pose, new: Pose) -> bool:
        """Whether `new` is free, or the robot is already in contact and moves away."""
        free = self._world.clearance(new.x_m, new.y_m, self._name) - self._footprint.radius_m
        self._free_m = max(0.0, free)
        if free > 0.0 or not self._world.touching(new, self._footprint, self._name):
            return True
        if not self._world.touching(old, self._footprint, self._name):
            return False
        return self._depth(new) <= self._depth(old)

    def _depth(self, pose: Pose) -> float:
        """Penetration depth, as the negative distance [m] from the middle to the nearest touched wall."""
        touching = self._world.touching(pose, self._footprint, self._name)
        return -min((distance(wall, pose.x_m, pose.y_m) for wall in touching), default=math.inf)
