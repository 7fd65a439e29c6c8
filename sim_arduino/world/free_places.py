"""Start poses for many robots on the free floor of a world."""

from typing import List, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose

from .world import World

PITCHES_M = (0.5, 0.4, 0.3)
"""Distance between the places [m]; the first at which all robots have a place is used."""
GAP_M = 0.05
"""Free floor between the circles around two robots, and between one and a wall [m]: a robot can turn on its place."""
_AROUND = ((0, 1), (0, -1), (-1, 0), (1, 0))
"""Left, right, behind, ahead of a place: the first robots stand in a row, each with free floor ahead."""


def free_places(world: World, radius_m: float, count: int) -> List[Pose]:
    """`count` poses with the heading of the world's start, the first at the start, each next one as near as possible.

    A robot can drive from the start to each of them: no wall is between neighbouring places.  `radius_m` is that of the
    circle around the largest robot [m].  ConfigError if there is not enough free floor.
    """
    found: List[Pose] = []
    for pitch_m in PITCHES_M:
        if pitch_m >= 2 * radius_m + GAP_M:
            found = max(found, _places(world, radius_m, count, pitch_m), key=len)
        if len(found) == count:
            return found
    raise ConfigError(
        f"{count} robots with a radius of {radius_m:.2f} m are to start in the world, expected at most {len(found)}: "
        "there is no free floor for more; choose a larger world"
    )


def _places(world: World, radius_m: float, count: int, pitch_m: float) -> List[Pose]:
    """At most `count` places on a grid of this pitch [m]."""
    found, known, at_hand = [world.start], {(0, 0)}, [(0, 0)]
    for cell in at_hand:  # it grows meanwhile
        before = _pose(world.start, cell, pitch_m)
        for step in _AROUND:
            beside = cell[0] + step[0], cell[1] + step[1]
            pose = _pose(world.start, beside, pitch_m)
            if len(found) < count and beside not in known and _is_free(world, before, pose, radius_m):
                found.append(pose)
                known.add(beside)
                at_hand.append(beside)
    return found


def _pose(start: Pose, cell: Tuple[int, int], pitch_m: float) -> Pose:
    return start.compose(cell[0] * pitch_m, cell[1] * pitch_m)


def _is_free(world: World, before: Pose, pose: Pose, radius_m: float) -> bool:
    """Whether a robot can stand at `pose`, and no wall is between it and the place before."""
    x_m, y_m = pose.x_m, pose.y_m
    return (
        world.clearance(x_m, y_m) >= radius_m + GAP_M
        and not world.is_solid(x_m, y_m)
        and world.sees(before.x_m, before.y_m, x_m, y_m)
    )
