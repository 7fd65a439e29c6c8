"""The robots in a world as other robots meet them, and the list of them in one process."""

import re
from typing import Dict, List, NamedTuple

from mrl_driver.geometry import Pose

from .shapes import Footprint

NAME = re.compile(r"[A-Za-z0-9_-]{1,40}")
NAME_TEXT = "1 to 40 letters, digits, - or _"


class Mover(NamedTuple):
    """A robot among others."""

    name: str
    pose: Pose
    footprint: Footprint


class RobotRegistry:
    """The robots in a world and their poses, in one process."""

    def __init__(self) -> None:
        self._movers: Dict[str, Mover] = {}

    def place(self, name: str, pose: Pose, footprint: Footprint) -> None:
        """Puts a robot into the world, or moves it."""
        self._movers[name] = Mover(name, pose, footprint)

    def remove(self, name: str) -> None:
        """Takes a robot out of the world, if it is there."""
        self._movers.pop(name, None)

    def others(self, name: str) -> List[Mover]:
        """All robots but that one."""
        return [mover for mover in self._movers.values() if mover.name != name]
