"""Sweeps the 4.0 x 4.6 m arena, and maps where alcohol, dust and heat exceed their alert levels."""

import math
from typing import Any, List, NamedTuple, Tuple

import numpy as np

from mrl_driver.geometry import Pose
from mrl_driver.navigation.line_follower import Course, FollowerLimits
from mrl_driver.protocol.table import BY_NAME
from sim_arduino.world import world_file
from sim_arduino.world.scene import PIXEL_RAD
from sim_arduino.world.world import World

from . import plot_style
from .experiment_report import Figure, Result
from .experiment_robot import ExperimentRobot, Setting, follow, open_robot
from .occupancy import Grid, points

LANE_M = 0.5
EDGE_M = 0.5
"""Distance of the sweep from the walls, which the robot needs for its turns [m]."""
EVERY_TICKS = 6
CELL_M, VIEWS = 0.1, 4
"""Cell size of the thermopile's map [m], and number of hot pixels that must agree on a hot cell."""
SPEEDS = FollowerLimits(linear_m_s=0.3, angular_rad_s=0.8)


class Variable(NamedTuple):
    """A variable that is mapped.

    Attributes:
        request: Name in the command table; the value is the largest field from `first` on.
        alert: Values from here on are drawn (thesis, JINT paper 2013).  None is published for alcohol; here it is a
            quarter more than in clean air.
        scene: Name of its sources in a world.
        remote: Pixels measure it from a distance; many views together give its position.
    """

    title: str
    request: str
    first: int
    alert: float
    unit: str
    scene: str
    colour: str
    remote: bool = False


VARIABLES = (
    Variable("heat", "read_thermopile", 1, 39.0, "degC", "heat", plot_style.ORANGE, remote=True),
    Variable("dust", "read_dust", 0, 5500.0, "pcs/l", "dust", plot_style.GREY),
    Variable("alcohol", "read_alcohol", 0, 154.0, "counts", "gas", plot_style.GREEN),
)


class Sample(NamedTuple):
    """Values of all variables at a pose by odometry."""

    pose: Pose
    values: Tuple[Tuple[int, ...], ...]


def run(setting: Setting) -> Result:
    """Sweeps the arena, and draws the three maps over each other."""
    world = world_file.load("hazards")
    with open_robot(setting, world, environment=True) as robot:
        samples = _sweep(robot, world)
    rows = [row for index, each in enumerate(VARIABLES) for row in _evaluate(index, each, samples, world)]
    remark = "Published: the map of the three variables matches the scene, but not the sources' positions."
    return Result(
        "environment",
        "Map of heat, dust and alcohol in the arena",
        rows,
        [_draw(setting, world, samples)],
        remark,
    )


def _sweep(robot: ExperimentRobot, world: World) -> List[Sample]:
    driver, samples, turn = robot.driver, [], [0]
    robot.reset_pose(world.start)
    codes = [BY_NAME[each.request].code for each in VARIABLES]

    def sample() -> None:
        turn[0] += 1
        if turn[0] % EVERY_TICKS == 0:
            values = [driver.ask(code)[each.first :] for code, each in zip(codes, VARIABLES)]
            samples.append(Sample(Pose(*driver.pose), tuple(values)))

    follow(robot, Course(_lanes(world), SPEEDS), sample)
    return samples


def _lanes(world: World) -> List[Tuple[float, float]]:
    """Waypoints of lanes along y, from left to right, then of lanes along x, so that every place is seen from two
    directions.
    """
    left, bottom, right, top = world.bounds()
    low, high = (left + EDGE_M, bottom + EDGE_M), (right - EDGE_M, top - EDGE_M)
    columns, lines = (np.arange(a, b + 1e-9, LANE_M) for a, b in zip(low, high))
    waypoints = [(x, y) for lane, x in enumerate(columns) for y in (low[1], high[1])[:: 1 - 2 * (lane % 2)]]
    up = waypoints[-1][1] == low[1]
    for lane, y in enumerate(lines if up else lines[::-1]):
        waypoints += [(x, y) for x in (high[0], low[0])[:: 1 - 2 * (lane % 2)]]
    return [(float(x), float(y)) for x, y in waypoints]


def _above(index: int, each: Variable, samples: List[Sample], world: World) -> Any:
    """Places at which a variable is above its alert level, `(N, 2)` [m]."""
    if each.remote:
        return _remote_spots(index, each, samples, world)
    return np.array([s.pose[:2] for s in samples if max(s.values[index]) >= each.alert]).reshape(-1, 2)


def _remote_spots(index: int, each: Variable, samples: List[Sample], world: World) -> Any:
    """Cells that pixels above the level see from several places, and no pixel below it sees."""
    left, bottom, right, top = world.bounds()
    grid = Grid((left, bottom), (right, top), CELL_M)
    for sample in samples:
        pixels = sample.values[index]
        for number, value in enumerate(pixels):
            aside = (len(pixels) / 2 - number - 0.5) * PIXEL_RAD
            view = sample.pose.compose(0.0, 0.0, aside)
            grid.wedge(view, PIXEL_RAD / 2, 0.5 if value >= each.alert else -1.0)
    return points(grid.odds >= VIEWS / 2, grid.map())


def _evaluate(index: int, each: Variable, samples: List[Sample], world: World) -> List[Figure]:
    """Largest value, number of alerts, and their distance from the nearest source."""
    sources = np.array([source[:2] for source in getattr(world.scene, each.scene)])
    spots = _above(index, each, samples, world)
    most = max(max(s.values[index]) for s in samples)
    apart = [min(np.hypot(*(sources - spot).T)) for spot in spots]
    median = float(np.median(apart)) if apart else math.nan
    return [
        Figure(f"{each.title}_most", f"largest {each.title}", most, each.unit, f"alert from {each.alert:g}"),
        Figure(f"{each.title}_alerts", f"places with {each.title} above its alert level", len(spots)),
        Figure(f"{each.title}_distance_m", "their distance from a source, median", median, "m"),
    ]


def _draw(setting: Setting, world: World, samples: List[Sample]) -> str:
    made, (axes,) = plot_style.figure(1, 6.4, 6.4)
    plot_style.walls(axes, world.walls)
    plot_style.path(axes, [s.pose for s in samples], plot_style.BLUE, "path by odometry", ":")
    for index, each in enumerate(VARIABLES):
        spots = _above(index, each, samples, world)
        strengths = [max(s.values[index]) / each.alert for s in samples if max(s.values[index]) >= each.alert]
        axes.scatter(
            spots[:, 0],
            spots[:, 1],
            s=25 if each.remote else [90 * min(4.0, strength) for strength in strengths],
            color=each.colour,
            alpha=0.35,
            edgecolors="black",
            linewidths=0.4,
            label=f"{each.title} from {each.alert:g} {each.unit}",
        )
        sources = getattr(world.scene, each.scene)
        axes.plot([s.x_m for s in sources], [s.y_m for s in sources], "x", color=each.colour, markersize=9)
    axes.plot([], [], "kx", label="sources")
    plot_style.floor(axes)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncol=3, fontsize="small")
    return plot_style.save(made, setting.folder, "environment")
