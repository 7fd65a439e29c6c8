"""Sweeps the 4.0 x 4.6 m arena, and maps where alcohol, dust and heat exceed their alert levels.

The sources are at other places with each seed.  The robot is steered by its true pose around the obstacles, as a person
with a Wiimote steers it by eye; the map has the poses of its odometry.
"""

import math
import random
from functools import partial
from operator import itemgetter
from typing import Any, Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from mrl_driver.apps.calibration import manoeuvres
from mrl_driver.geometry import Pose, wrap_angles
from mrl_driver.navigation.line_follower import Course, FollowerLimits
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.view.environment_cells import ALCOHOL, DUST, HEAT, VARIABLES, Cells, Variable
from sim_arduino.hardware.environment_sensors import EnvironmentErrors
from sim_arduino.hardware.imu import ImuErrors
from sim_arduino.world import map_score
from sim_arduino.world.scene import PIXEL_RAD
from sim_arduino.world.world import World
from sim_arduino.world.world_file import pose_text

from . import arena, disturbances, plot_style
from .experiment_report import Figure, Measure, Result, over_seeds
from .experiment_robot import PATIENCE_S, ExperimentRobot, Setting, open_robot

EVERY_TICKS = 6
CELL_M, VIEWS, SHARE = 0.1, 6, 0.5
"""Cell size of the thermopile's map [m], number of views that a hot cell needs, and share of them that must be hot."""
PEAK_M, GROUP_M, LEAST_CELLS = 1.0, 0.8, 3
"""A reading is a peak if none within the first distance is larger [m].  Readings within the second of a peak, or of a
hot cell, belong to the same object [m].  A group of fewer hot cells is not an object."""
FALSE_M = 1.25
"""An alert farther from all sources than this is false [m]; the fields reach the alert level at up to 1.05 m."""
IGNORED = -math.inf
"""Alert level of the control, in which each reading counts as an alert, all with the same weight."""
STAND_S = 2.0
SPEEDS = FollowerLimits(linear_m_s=0.3, angular_rad_s=1.2)
ERRORS = EnvironmentErrors(
    heat_offset_c=1.0,
    heat_scale=0.01,
    heat_noise_c=0.5,
    dust_scale=0.1,
    dust_noise=0.1,
    alcohol_offset=5.0,
    alcohol_noise=2.0,
)
"""Standard deviations; their sources are in docs/experiments.md, "Heat, dust and alcohol"."""


SOURCES = {HEAT: "heat", DUST: "dust", ALCOHOL: "gas"}
"""Names of the variables' sources in a world.  Pixels measure heat from a distance; many views together place it."""


class Sample(NamedTuple):
    """Values of all variables at a time [s] and at a pose by odometry."""

    time_s: float
    pose: Pose
    values: Tuple[Tuple[int, ...], ...]


class Drive(NamedTuple):
    """A sweep of an arena."""

    world: World
    samples: List[Sample]
    bumps: int  # ticks in which an obstacle stopped the robot
    off_m: float  # distance of the odometry from the true position at the end [m]


class Spots(NamedTuple):
    """Places at which a variable is above its alert level, `(N, 2)` [m], and by how much, `(N,)`."""

    places: Any
    excess: Any


def run(setting: Setting) -> Result:
    """Sweeps arenas with sources and without, and draws the map and the readings of the first."""
    drives = over_seeds(_sweep, setting)
    empty = over_seeds(partial(_sweep, sources=False), setting)
    rows = [row for index in range(len(VARIABLES)) for row in _evaluate(index, drives, empty)]
    collisions = Measure("collisions", "collisions with obstacles", of=lambda drive: drive.bumps)
    off = Measure("off_cm", "odometry, wheels and gyro, at the end", "cm", lambda drive: 100 * drive.off_m)
    rows += [collisions.figure(drives + empty), off.figure(drives)]
    remark = (
        "Control: each reading counts as an alert. The fields around the sources, their values and the alert level of "
        "alcohol are assumed; the levels of heat and dust are published. The sweep is autonomous, with the plan of the "
        "arena known; the paper's robot was driven with a Wiimote. Published: the map of the three variables matches "
        "the scene, but not the sources' positions."
    )
    title = "Map of heat, dust and alcohol in the arena"
    return Result("environment", title, rows, [_draw(setting, drives[0])], remark)


# -- the drive


def _sweep(setting: Setting, sources: bool = True) -> Drive:
    """A sweep of a robot that a person put on the arena's mark, with errors of its own in wheels and sensors.

    Without sources nothing is mapped, so that lanes in one direction and the wheels alone are enough.
    """
    seed, world = setting.seed, arena.drawn(setting.seed)
    given: Dict[str, Any] = {"imu": True, "imu_errors": _calibrated_gyro(seed)} if sources else {}
    world = world if sources else arena.without_sources(world)
    course = Course(arena.sweep(world, sources), SPEEDS)
    error, pose = disturbances.error(seed), pose_text(disturbances.placed(world.start, seed))
    given.update(environment=True, environment_errors=ERRORS, error=error, pose=pose)
    with open_robot(setting, world, **given) as robot:
        robot.wait(STAND_S)
        robot.reset_pose(world.start)
        samples, bumps = _follow(robot, course)
        return Drive(world, samples, bumps, math.dist(robot.pose[:2], robot.true_pose[:2]))


def _calibrated_gyro(seed: int) -> ImuErrors:
    """Errors of an IMU whose gyro was calibrated with `mrl calibrate imu`."""
    scale = random.Random(f"gyro {seed}").gauss(1.0, disturbances.GYRO_SCALE_SD)
    return ImuErrors.drawn(seed)._replace(gyro_scale=(1.0, 1.0, scale))


def _follow(robot: ExperimentRobot, course: Course) -> Tuple[List[Sample], int]:
    """The samples of the sweep, and the number of ticks in which the robot bumped."""
    driver, samples, ticks, bumps = robot.driver, [], 0, 0
    codes = [BY_NAME[f"read_{each.sensor}"].code for each in VARIABLES]
    begin_s = driver.now_s

    def steer(_: Pose) -> manoeuvres.Command:
        nonlocal ticks, bumps
        ticks, bumps = ticks + 1, bumps + robot.bumped
        if ticks % EVERY_TICKS == 0:
            values = map(driver.ask, codes)
            samples.append(Sample(driver.now_s - begin_s, Pose(*driver.pose), tuple(values)))
        speeds = course.command(robot.true_pose)
        return None if course.done else speeds

    manoeuvres.follow(driver, steer, PATIENCE_S)
    return samples, bumps


# -- what it found


def spots(index: int, drive: Drive, alert: float) -> Spots:
    """Places at which a variable is at least at a level."""
    if VARIABLES[index] is HEAT:
        return _hot_cells(index, drive, alert)
    values = np.array([max(sample.values[index]) for sample in drive.samples])
    places = np.array([sample.pose[:2] for sample in drive.samples])
    above = values >= alert
    excess = np.ones(len(values)) if alert == IGNORED else values - alert + 1.0
    return Spots(places[above], excess[above])


def _hot_cells(index: int, drive: Drive, alert: float) -> Spots:
    """Cells that look hot in most of many views; the plan of the arena says which cells a pixel sees."""
    left, bottom, right, top = drive.world.bounds()
    x, y = np.meshgrid(
        np.arange(left + CELL_M / 2, right, CELL_M), np.arange(bottom + CELL_M / 2, top, CELL_M)
    )
    seen, hot = np.zeros(x.shape, int), np.zeros(x.shape, int)
    for sample in drive.samples:
        pixels = np.array(sample.values[index])
        half = len(pixels) / 2
        bearing = wrap_angles(np.arctan2(y - sample.pose.y_m, x - sample.pose.x_m) - sample.pose.yaw_rad)
        number = np.floor(half - bearing / PIXEL_RAD).astype(int)
        inside = (number >= 0) & (number < len(pixels))
        rays = drive.world.scan(sample.pose, (0.5 - half) * PIXEL_RAD, PIXEL_RAD, len(pixels), 10.0)[::-1]
        number = np.where(inside, number, 0)
        inside &= np.hypot(y - sample.pose.y_m, x - sample.pose.x_m) <= rays[number] + CELL_M
        seen += inside
        hot += inside & (pixels[number] >= alert)
    found = (seen >= VIEWS) & (hot >= SHARE * seen)
    return Spots(np.column_stack((x[found], y[found])), hot[found] / np.maximum(seen[found], 1))


def objects(each: Variable, found: Spots) -> Any:
    """Positions of the sources that the spots speak of, `(N, 2)` [m]: peaks of the readings, or groups of hot cells."""
    left, made = list(range(len(found.places))), []
    while left:
        first = max(left, key=lambda number: found.excess[number])
        away = np.hypot(*(found.places - found.places[first]).T)
        near = away <= GROUP_M
        peak = found.excess[first] >= found.excess[away <= PEAK_M].max()
        if near.sum() >= LEAST_CELLS if each is HEAT else peak:
            made.append(np.average(found.places[near], axis=0, weights=found.excess[near]))
        left = [number for number in left if not near[number]]
    return np.array(made).reshape(-1, 2)


def apart_m(sources: Any, found: Any) -> float:
    """Largest distance of a source from the nearest place found, or of a place from the nearest source [m].

    So a source that is missed counts, and a place that is not one.  Infinite if nothing is found.
    """
    if not len(found):
        return math.inf
    return float(max(map_score.nearest(sources, found).max(), map_score.nearest(found, sources).max()))


def _score(each: Variable, drive: Drive, found: Spots) -> Tuple[float, int]:
    """Distance of the sources from the places found, as `apart_m`, and number of spots far from all sources."""
    sources = _sources(each, drive)
    false = (map_score.nearest(found.places, sources) > FALSE_M).sum()
    return apart_m(sources, objects(each, found)), int(false)


def _sources(each: Variable, drive: Drive) -> Any:
    return np.array([source[:2] for source in getattr(drive.world.scene, SOURCES[each])]).reshape(-1, 2)


def cells(index: int, drive: Drive) -> Cells:
    """The cells of a variable, as the ROS node `environment_map` draws them: each reading is where the robot is."""
    made = Cells()
    for sample in drive.samples:
        made.put(sample.pose.x_m, sample.pose.y_m, VARIABLES[index].value(sample.values[index]))
    return made


def _evaluate(index: int, drives: Sequence[Drive], empty: Sequence[Drive]) -> List[Figure]:
    """Distance of the sources from what was found, false alerts, and alerts in the arenas without sources."""
    each, title = VARIABLES[index], VARIABLES[index].title
    published = f"alert from {each.alert:g}" if each is not ALCOHOL else ""
    away = f"{title}: largest distance between sources and places found"
    false = f"{title}: alerts more than {FALSE_M:g} m from all sources"
    none = f"{title}: alerts in an arena without sources"
    cell = f"{title}: distance of the cell with the largest value from a source; control: of all cells"

    def most(drive: Drive) -> int:
        return max(max(sample.values[index]) for sample in drive.samples)

    def alerts(drive: Drive) -> int:
        return len(spots(index, drive, each.alert).places)

    def peak_m(drive: Drive) -> float:
        return float(map_score.nearest(np.array([cells(index, drive).peak]), _sources(each, drive))[0])

    def chance_m(drive: Drive) -> float:
        return float(
            map_score.nearest(np.array(cells(index, drive).between(-math.inf)), _sources(each, drive)).mean()
        )

    scores, control = (
        [_score(each, drive, spots(index, drive, level)) for drive in drives]
        for level in (each.alert, IGNORED)
    )
    return [
        Measure(f"{title}_most", f"largest {title}", each.unit, most, min, published, True).figure(drives),
        Measure(f"{title}_distance_m", away, "m", itemgetter(0)).figure(scores, control),
        Measure(f"{title}_cell_m", cell, "m", itemgetter(0)).figure(
            [(peak_m(drive),) for drive in drives], [(chance_m(drive),) for drive in drives]
        ),
        Measure(f"{title}_false", false, "", itemgetter(1)).figure(scores, control),
        Measure(f"{title}_without_sources", none, "", alerts).figure(empty),
    ]


# -- the picture


def _draw(setting: Setting, drive: Drive) -> str:
    from mrl_driver import figures

    made = figures.figure(12.0, 7.4)
    grid = made.add_gridspec(len(VARIABLES), 2, width_ratios=(1.0, 1.15))
    _draw_map(made.add_subplot(grid[:, 0]), drive)
    for index, each in enumerate(VARIABLES):
        axes = made.add_subplot(grid[index, 1])
        points = [(sample.time_s, max(sample.values[index])) for sample in drive.samples]
        plot_style.path(axes, points, each.colour, each.title)
        axes.axhline(
            each.alert, color="black", linestyle="--", linewidth=0.9, label=f"alert from {each.alert:g}"
        )
        axes.set(ylabel=f"{each.title} [{each.unit}]", xlim=(0, None), ylim=(0, None))
        axes.margins(y=0.25)
        axes.grid(True, color="#dddddd", linewidth=0.6)
        axes.legend(loc="upper right", fontsize="small")
    axes.set(xlabel="time [s]")
    return plot_style.save(made, setting.folder, "environment")


def _draw_map(axes: Any, drive: Drive) -> None:
    plot_style.draw_walls(axes, drive.world.walls, "walls")
    plot_style.path(axes, [sample.pose for sample in drive.samples], plot_style.GREY, "path by odometry", ":")
    for index, each in enumerate(VARIABLES):
        found, made = spots(index, drive, each.alert), cells(index, drive)
        for size, opacity, low, high in ((12, 0.5, each.notice, each.alert), (36, 1.0, each.alert, math.inf)):
            places = np.array(made.between(low, high)).reshape(-1, 2) + (each.third * made.size_m / 3, 0.0)
            label = f"{each.title} from {low:g}"
            axes.scatter(
                *places.T, s=size, marker="s", color=each.colour, alpha=opacity, linewidths=0, label=label
            )
        axes.plot(*_sources(each, drive).T, "x", color=each.colour, markersize=10, markeredgewidth=2)
        axes.plot(*objects(each, found).T, "+", color=each.colour, markersize=12, markeredgewidth=2)
    axes.plot([], [], "kx", label="sources")
    axes.plot([], [], "k+", label="found")
    plot_style.floor(axes)
    axes.set_anchor("N")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncol=4, fontsize="x-small")
