"""Occupancy grid built from sonar readings, and path search on it.  No I/O.

Each cell that a sonar has measured has a score: an echo raises it, the free part of the cone lowers it.  Only near
echoes are drawn, because the cone is narrow there; farther away it would close every door.  Unknown cells are free.
"""

import heapq
import math
from typing import Dict, List, Mapping, Optional, Set, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.robot.models import SonarMount, cycle_s

CELL_M = 0.05
NEAR_M = 0.6  # an echo within this range is drawn; a farther echo only frees the cone up to here [m]
SURE_M = 0.35  # an echo within this range is accepted at once [m]
TOO_NEAR_M = 0.1  # assumed range of an object that is too near to be measured [m]
CLEARED = 0.7
"""Ignore "free" readings beyond this share of the cone: an object at its edge may give no echo."""
SCORE = 3  # largest and (negative) smallest score of a cell
# Distance of the robot's centre from an obstacle [m], and the extra cost of each cell within it [cells].  First zone:
# the body hardly fits.  Second: it passes but cannot turn.  Third: more clearance is worth a small detour.
ZONES: Tuple[Tuple[float, float], ...] = ((0.13, 60.0), (0.20, 5.0), (0.34, 2.0))
FREE_ZONE = 1  # index in `ZONES`: a straight path must stay out of the zones up to this one
MOST_CELLS = 3000  # a search ends after this number of cells; about 10 us each

Cell = Tuple[int, int]
Point = Tuple[float, float]
_STEPS = [(i, j, math.hypot(i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]


def _disc(radius_m: float) -> List[Cell]:
    reach = int(radius_m / CELL_M) + 1
    around = range(-reach, reach + 1)
    return [(i, j) for i in around for j in around if math.hypot(i, j) * CELL_M <= radius_m]


_DISCS = [_disc(radius_m) for radius_m, _ in ZONES]


class FloorMap:
    """The grid, in the frame of the poses; `sonars` maps each name to its mounting pose."""

    def __init__(self, sonars: Mapping[str, SonarMount]) -> None:
        self._sonars = sonars
        self.drawn: Dict[str, Tuple[float, float]] = {}
        """Last valid reading of each sonar, and when it was drawn."""
        self._scores: Dict[Cell, int] = {}
        self._taken: Set[Cell] = set()
        self._around: List[Dict[Cell, int]] = [{} for _ in ZONES]

    @property
    def empty(self) -> bool:
        """No cell is occupied."""
        return not self._taken

    @property
    def taken(self) -> List[Cell]:
        """The occupied cells, sorted."""
        return sorted(self._taken)

    def follow(self, pose: Pose, ranges: Mapping[str, float], now_s: float) -> None:
        """Draw the readings (REP 117) that are new: those that changed, and once per cycle also those that did not."""
        new, cycle = {}, cycle_s(self._sonars)
        for name, range_m in ranges.items():
            before_m, drawn_s = self.drawn.get(name, (math.nan, -math.inf))
            if not math.isnan(range_m) and (range_m != before_m or now_s - drawn_s >= cycle):
                self.drawn[name] = range_m, now_s
                new[name] = range_m
        self.see(pose, new)

    def see(self, pose: Pose, readings: Mapping[str, float]) -> None:
        """Draw new readings (REP 117) of a robot at a pose; NaN is ignored."""
        for name, range_m in readings.items():
            mount = self._sonars.get(name)
            if mount is not None and not math.isnan(range_m):
                self._draw(pose, mount, max(TOO_NEAR_M, range_m))

    def _draw(self, pose: Pose, mount: SonarMount, range_m: float) -> None:
        x, y, yaw = Pose(*pose).compose(*mount.pose)
        sensor = mount.kind
        cos, sin, half = math.cos(yaw), math.sin(yaw), sensor.field_of_view_rad / 2
        echo, free_m = range_m <= NEAR_M, min(NEAR_M, sensor.farthest_m)
        edge_m = range_m - CELL_M / 2 if echo else free_m
        end_m = range_m + CELL_M / 2 if echo else free_m
        reach = int(min(range_m, NEAR_M) / CELL_M) + 2
        middle_i, middle_j = cell_of((x, y))
        for i in range(middle_i - reach, middle_i + reach + 1):
            for j in range(middle_j - reach, middle_j + reach + 1):
                at_x, at_y = middle_of((i, j))
                ahead_m = cos * (at_x - x) + sin * (at_y - y)
                if not 0.0 <= ahead_m < end_m:
                    continue
                left_m = cos * (at_y - y) - sin * (at_x - x)
                distance_m, aside = math.hypot(ahead_m, left_m), math.atan2(abs(left_m), ahead_m)
                if aside > half or (distance_m < edge_m and aside > CLEARED * half):
                    continue
                if distance_m < edge_m:
                    self._score((i, j), -1)
                elif echo and distance_m < end_m:
                    self._score((i, j), 2 * SCORE if range_m < SURE_M else 1)

    def _score(self, cell: Cell, by: int) -> None:
        score = max(-SCORE, min(SCORE, self._scores.get(cell, 0) + by))
        self._scores[cell] = score
        if (score > 0) == (cell in self._taken):
            return
        step = 1 if score > 0 else -1
        (self._taken.add if score > 0 else self._taken.discard)(cell)
        for around, disc in zip(self._around, _DISCS):
            for i, j in disc:
                near = cell[0] + i, cell[1] + j
                around[near] = around.get(near, 0) + step

    def is_near(self, point: Point) -> bool:
        """Return whether the point is too close to an obstacle for the robot's centre."""
        return self._around[FREE_ZONE].get(cell_of(point), 0) > 0

    def is_free(self, start: Point, end: Point) -> bool:
        """Return whether the straight path between two points is free; it is checked for at most `MOST_CELLS` cells."""
        away = math.hypot(end[0] - start[0], end[1] - start[1]) / CELL_M
        steps = int(min(away, MOST_CELLS)) + 1
        dx, dy = (end[0] - start[0]) / max(steps, away), (end[1] - start[1]) / max(steps, away)
        return not any(self.is_near((start[0] + dx * k, start[1] + dy * k)) for k in range(steps + 1))

    def path(self, start: Point, goal: Point) -> Optional[List[Point]]:
        """Return the cheapest path as points from cell to cell, the goal last; None if there is none."""
        first, last = cell_of(start), cell_of(goal)
        before: Dict[Cell, Cell] = {}
        costs = {first: 0.0}
        queue = [(0.0, first)]
        done: Set[Cell] = set()
        while queue and len(done) < MOST_CELLS:
            _, cell = heapq.heappop(queue)
            if cell == last:
                return [middle_of(each) for each in _back(before, cell)[1:-1]] + [goal]
            if cell in done:
                continue
            done.add(cell)
            for i, j, length in _STEPS:
                step = cell[0] + i, cell[1] + j
                # A corner of an occupied cell is closed, too.
                passed = step, (step[0], cell[1]), (cell[0], step[1])
                if step in done or not self._taken.isdisjoint(passed):
                    continue
                cost = costs[cell] + length + self._penalty(step)
                if cost < costs.get(step, math.inf):
                    costs[step], before[step] = cost, cell
                    heapq.heappush(queue, (cost + math.hypot(step[0] - last[0], step[1] - last[1]), step))
        return None

    def _penalty(self, cell: Cell) -> float:
        for around, (_, cost) in zip(self._around, ZONES):
            if around.get(cell, 0) > 0:
                return cost
        return 0.0


def cell_of(point: Point) -> Cell:
    """Return the cell of a point."""
    return math.floor(point[0] / CELL_M), math.floor(point[1] / CELL_M)


def middle_of(cell: Cell) -> Point:
    """Return the centre of a cell."""
    return (cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M


def _back(before: Mapping[Cell, Cell], cell: Cell) -> List[Cell]:
    path = [cell]
    while path[-1] in before:
        path.append(before[path[-1]])
    return path[::-1]
