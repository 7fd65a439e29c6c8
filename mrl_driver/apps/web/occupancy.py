"""The occupied cells around the robot, from its sonars, as the page shows them.  No I/O."""

import math
from typing import Dict, List, Mapping, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.navigation.occupancy_grid import FloorMap
from mrl_driver.robot.models import SonarMount
from mrl_driver.robot.sonar import CYCLE_S


class Occupancy:
    """A grid that is fed with new sonar readings; `sonars` has the mounting pose of each, by name."""

    def __init__(self, sonars: Mapping[str, SonarMount]) -> None:
        self._map = FloorMap(sonars)
        self._drawn: Dict[str, Tuple[float, float]] = {}
        self.cells: List[Tuple[int, int]] = []
        """The occupied cells, sorted; a new list whenever they have changed."""

    def see(self, pose: Pose, ranges: Mapping[str, float], now_s: float) -> None:
        """Draw the readings (REP 117) that are new: those that changed, and once per cycle the others.

        `ranges` must be empty while no telemetry arrives.
        """
        new = {}
        for name, range_m in ranges.items():
            before_m, drawn_s = self._drawn.get(name, (math.nan, -math.inf))
            if range_m != before_m or now_s - drawn_s >= CYCLE_S:
                self._drawn[name] = range_m, now_s
                new[name] = range_m
        if new:
            self._map.see(pose, new)
            cells = sorted(self._map.taken)
            if cells != self.cells:
                self.cells = cells
