"""The arena of the sensor experiment with sources at drawn places, and a path that sweeps it around all obstacles."""

import math
import random
from collections import deque
from typing import Callable, Deque, Dict, Iterator, List, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from sim_arduino.world import world_file
from sim_arduino.world.scene import Scene, Source, Sources
from sim_arduino.world.shapes import Footprint, Wall
from sim_arduino.world.world import World

PITCH_M, LANE = 0.25, 3
"""Distance between the points of the path's lattice [m], and points from one lane to the next."""
EDGE_M = 0.5  # distance of the sweep from the outer walls, which the robot needs for its turns [m]
CLEAR_M = 0.25  # distance of the path from each obstacle [m]; the robot's corners reach 0.15 m
CONTAINER = Footprint(0.12, 0.12)  # a container of alcohol
LAMP_M = 0.15  # distance of a lamp from the wall at which it stands [m]
APART_M, FREE_M = 1.5, 0.45
"""Least distance of sources of one kind from each other, whose fields merge if they are closer, and of a container from
obstacles and the start [m]."""
TRIALS = 1000
Point = Tuple[float, float]
Node = Tuple[int, int]


def drawn(seed: int) -> World:
    """The packaged arena, with as many sources as it has, at places that the seed draws.

    Containers of alcohol and the flow of dust are on the floor, lamps along the walls.  The containers are obstacles.
    """
    plan, rng = world_file.load("hazards"), random.Random(f"arena {seed}")
    gas = _placed(plan.scene.gas, lambda: _on_floor(plan, rng))
    dust = _placed(plan.scene.dust, lambda: _on_floor(plan, rng))
    lamps = _placed(plan.scene.heat, lambda: _at_wall(plan, rng))
    light = tuple(glow._replace(x_m=lamp.x_m, y_m=lamp.y_m) for glow, lamp in zip(plan.scene.light, lamps))
    containers = [CONTAINER.outline(Pose(source.x_m, source.y_m, 0.0)) for source in gas]
    scene = plan.scene._replace(gas=gas, dust=dust, heat=lamps, light=light)
    return _world([*plan.solids, *containers], plan, scene)


def without_sources(world: World) -> World:
    """The same arena with clean air and cold lamps."""
    return _world(world.solids, world, Scene(world.scene.ambient))


def _world(solids: List[List[Wall]], plan: World, scene: Scene) -> World:
    sides = [side for solid in solids for side in solid]
    made = World([wall for wall in plan.walls if wall not in sides] + sides, plan.start, scene)
    made.solids = solids
    return made


def _placed(sources: Sources, draw: Callable[[], Point]) -> Sources:
    """The sources at drawn places, each `APART_M` from the others."""
    placed: List[Source] = []
    for source in sources:
        for _ in range(TRIALS):
            x, y = draw()
            if all(math.hypot(x - other.x_m, y - other.y_m) >= APART_M for other in placed):
                placed.append(source._replace(x_m=x, y_m=y))
                break
        else:
            raise ConfigError(f"no place for a source in {TRIALS} trials, expected a larger arena")
    return tuple(placed)


def _on_floor(plan: World, rng: random.Random) -> Point:
    left, bottom, right, top = plan.bounds()
    while True:
        x, y = rng.uniform(left, right), rng.uniform(bottom, top)
        from_start_m = math.hypot(x - plan.start.x_m, y - plan.start.y_m)
        if plan.clearance(x, y) >= FREE_M <= from_start_m and not plan.is_solid(x, y):
            return x, y


def _at_wall(plan: World, rng: random.Random) -> Point:
    left, bottom, right, top = plan.bounds()
    x, y = rng.uniform(left + EDGE_M, right - EDGE_M), rng.uniform(bottom + EDGE_M, top - EDGE_M)
    walls = ((left + LAMP_M, y), (right - LAMP_M, y), (x, bottom + LAMP_M), (x, top - LAMP_M))
    return rng.choice(walls)


class Lattice:
    """Points at which the robot has room for its turns, and the ways between them."""

    def __init__(self, world: World) -> None:
        left, bottom, right, top = world.bounds()
        self._low = left + EDGE_M, bottom + EDGE_M
        columns, lines = (
            int((high - low - 2 * EDGE_M) / PITCH_M + 1e-6) + 1
            for low, high in ((left, right), (bottom, top))
        )
        self.size = columns, lines
        self._world = world
        self._free = {
            (i, j) for i in range(columns) for j in range(lines) if self._has_room(*self.at((i, j)))
        }

    def at(self, node: Node) -> Point:
        """Position of a point [m]."""
        return self._low[0] + node[0] * PITCH_M, self._low[1] + node[1] * PITCH_M

    def _has_room(self, x: float, y: float) -> bool:
        return self._world.clearance(x, y) >= CLEAR_M and not self._world.is_solid(x, y)

    def _next(self, node: Node) -> Iterator[Node]:
        for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            near = node[0] + i, node[1] + j
            if near in self._free and self._has_room(*self.at((node[0] + i / 2, node[1] + j / 2))):  # type: ignore[arg-type]
                yield near

    def way(self, start: Node, goal: Node) -> Optional[List[Node]]:
        """The shortest way from a point to another, without the first; None if there is none."""
        before: Dict[Node, Node] = {start: start}
        waiting: Deque[Node] = deque([start])
        while waiting and goal not in before:
            node = waiting.popleft()
            for near in self._next(node):
                if near not in before:
                    before[near] = node
                    waiting.append(near)
        if goal not in before:
            return None
        found = [goal]
        while found[-1] != start:
            found.append(before[found[-1]])
        return found[-2::-1]


def sweep(world: World, twice: bool = True) -> List[Point]:
    """Corners of a path in lanes along y, then in lanes along x, so that every place is seen from two directions.

    The arena has no robots: they would be obstacles.  Without `twice`, there are the lanes along y alone.
    """
    lattice = Lattice(world)
    columns, lines = lattice.size
    wanted = [(i, j) for i in range(0, columns, LANE) for j in _there_and_back(lines, i)]
    if twice:
        wanted += [(i, j) for j in range(0, lines, LANE) for i in _there_and_back(columns, j)]
    nodes: List[Node] = [(0, 0)]
    for goal in wanted:
        nodes += lattice.way(nodes[-1], goal) or []
    return [lattice.at(node) for node in _corners(nodes)]


def _there_and_back(count: int, lane: int) -> range:
    return range(count) if lane // LANE % 2 == 0 else range(count - 1, -1, -1)


def _corners(nodes: List[Node]) -> List[Node]:
    """The nodes at which the direction changes, and the last."""
    found = [
        here
        for last, here, after in zip(nodes, nodes[1:], nodes[2:])
        if (here[0] - last[0], here[1] - last[1]) != (after[0] - here[0], after[1] - here[1])
    ]
    return [*found, nodes[-1]]
