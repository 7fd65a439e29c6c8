"""Maps the L-shaped course with the two side sonars and with the laser, in one drive."""

from typing import Any, List, NamedTuple, Tuple

import numpy as np

from mrl_driver.driver import Telemetry
from mrl_driver.geometry import Pose
from mrl_driver.navigation.line_follower import Course, FollowerLimits
from sim_arduino.hardware.laser import URG_04LX, LaserScanner
from sim_arduino.hardware.sonars import HALF_CONE_RAD
from sim_arduino.world import grid_map, world_file
from sim_arduino.world.grid_map import OCCUPIED, GridMap
from sim_arduino.world.world import World

from . import plot_style
from .experiment_report import Figure, Result
from .experiment_robot import NOISE, ExperimentRobot, Setting, follow, open_robot
from .occupancy import Grid, points, share_near

SIDES = ("left", "right")
"""The front sonar only serves to avoid obstacles, as in the thesis."""
SONAR_FAR_M = 2.5
"""Largest range used; the course is smaller [m]."""
NEAR_M = 0.05
"""A wall cell counts as mapped if an occupied cell is within this distance [m]."""
MARGIN_M = 0.3
WAYPOINTS = ((1.5, 0.5), (1.5, 1.25), (1.5, 0.5), (0.35, 0.5), (1.0, 0.5))
SLOW = FollowerLimits(linear_m_s=0.12, angular_rad_s=0.35)
"""Slow enough that each sonar, which measures every 0.3 s, does so every few degrees and centimetres."""
OCCUPIED_FROM = {"sonars": 0.9, "laser": 6.0}
"""Smallest log odds of a wall cell: two arcs without contradiction, or six beams."""
VIEW_RAYS = 73


class CourseRecord(NamedTuple):
    """The measurements of the drive; poses are by odometry, in the world's frame."""

    path: List[Pose]
    cones: List[Tuple[Pose, float, Pose]]
    """Pose of a sonar, its reading [m], and its true pose."""
    scans: List[Tuple[Pose, Any, Pose]]


def run(setting: Setting) -> Result:
    """Drives through the course, and draws both maps."""
    world = world_file.load("l-course")
    with open_robot(setting, world, sonar=NOISE) as robot:
        drive = _drive(setting, robot, world)
    by_sonars, by_laser = _grid(world), _grid(world)
    for pose, range_m, _ in drive.cones:
        by_sonars.cone(pose, HALF_CONE_RAD, range_m, SONAR_FAR_M)
    for pose, ranges, _ in drive.scans:
        by_laser.beams(pose, _angles(), ranges, URG_04LX.far_m)
    grids = {"sonars": by_sonars, "laser": by_laser}
    maps = {name: grid.map(OCCUPIED_FROM[name]) for name, grid in grids.items()}
    views = {"sonars": _cones_view(world, drive), "laser": _scans_view(world, drive)}
    for name, made in maps.items():
        grid_map.write(made, f"{setting.folder}/l-course-{name}.yaml")
    rows = [row for name in maps for row in _evaluate(name, maps[name], views[name], world)]
    return Result(
        "l-course",
        "L-shaped course mapped with sonars and with a laser",
        rows,
        [_draw(setting, world, drive, maps)],
        "The maps are in map_server's format. A wall cell counts as found if an occupied cell is within 5 cm.",
    )


def _drive(setting: Setting, robot: ExperimentRobot, world: World) -> CourseRecord:
    start, scanner = world.start, LaserScanner(world, seed=setting.seed)
    driver, drive = robot.driver, CourseRecord([], [], [])
    robot.reset_pose(start)
    assert driver.model is not None
    mounts = driver.model.sonars
    turn = [0]

    def add_cones(telemetry: Telemetry) -> None:
        for name in telemetry.fresh:
            if name in SIDES:
                at = mounts[name].pose
                true = robot.true_pose.compose(*at)
                drive.cones.append((telemetry.pose.compose(*at), telemetry.ranges[name], true))

    def add_scan() -> None:
        drive.path.append(driver.pose)
        turn[0] += 1
        if turn[0] % 2 == 0:
            mount = (URG_04LX.x_m, URG_04LX.y_m)
            scan = scanner.scan(robot.true_pose, "robot")
            drive.scans.append((driver.pose.compose(*mount), scan, robot.true_pose.compose(*mount)))

    driver.on_telemetry(add_cones)
    follow(robot, Course(WAYPOINTS, SLOW), add_scan)
    return drive


def _grid(world: World) -> Grid:
    left, bottom, right, top = world.bounds()
    return Grid((left - MARGIN_M, bottom - MARGIN_M), (right + MARGIN_M, top + MARGIN_M))


def _angles() -> Any:
    return URG_04LX.first_rad + np.arange(URG_04LX.rays) * URG_04LX.step_rad


def _seen(
    world: World, poses: List[Pose], first_rad: float, step_rad: float, count: int, far_m: float
) -> Any:
    """Points at which rays from these poses hit walls, `(N, 2)` [m]."""
    angles = first_rad + np.arange(count) * step_rad
    found = []
    for pose in poses:
        ranges = world.scan(pose, first_rad, step_rad, count, far_m, without="robot")
        hit = np.isfinite(ranges)
        headings = angles[hit] + pose.yaw_rad
        found.append(
            np.column_stack(
                (pose.x_m + ranges[hit] * np.cos(headings), pose.y_m + ranges[hit] * np.sin(headings))
            )
        )
    return np.concatenate(found)


def _cones_view(world: World, drive: CourseRecord) -> Any:
    step = 2 * HALF_CONE_RAD / (VIEW_RAYS - 1)
    return _seen(world, [true for _, _, true in drive.cones], -HALF_CONE_RAD, step, VIEW_RAYS, SONAR_FAR_M)


def _scans_view(world: World, drive: CourseRecord) -> Any:
    laser = URG_04LX
    poses = [true for _, _, true in drive.scans]
    return _seen(world, poses, laser.first_rad, laser.step_rad, laser.rays, laser.far_m)


def _evaluate(name: str, made: GridMap, view: Any, world: World) -> List[Figure]:
    """Share of the wall cells in view that were found, and of the occupied cells that are walls."""
    true = grid_map.draw(world, made.resolution_m, MARGIN_M)
    walls = points(true.cells == OCCUPIED, true)
    occupied = points(made.cells == OCCUPIED, made)
    cells = {tuple(cell) for cell in np.floor(view / made.resolution_m).astype(int)}
    spots = (np.array(sorted(cells)) + 0.5) * made.resolution_m
    in_view = walls[[np.min(np.hypot(*(spots - wall).T)) <= made.resolution_m for wall in walls]]
    found = 100 * share_near(in_view, occupied, NEAR_M)
    sound = 100 * share_near(occupied, walls, NEAR_M)
    return [
        Figure(f"{name}_walls_found_percent", f"wall cells in view found by {name}", found, "%"),
        Figure(f"{name}_cells_on_walls_percent", f"occupied cells of {name} on a wall", sound, "%"),
    ]


def _draw(setting: Setting, world: World, drive: CourseRecord, maps: Any) -> str:
    made, axes = plot_style.figure(2, 9.0, 4.6)
    for each, (name, grid) in zip(axes, maps.items()):
        low = grid.origin
        height, width = grid.cells.shape
        extent = (low.x_m, low.x_m + width * grid.resolution_m, low.y_m, low.y_m + height * grid.resolution_m)
        shade = np.where(grid.cells == OCCUPIED, 0.0, np.where(grid.cells == 0, 1.0, 0.75))
        each.imshow(shade, origin="lower", extent=extent, cmap="gray", vmin=0, vmax=1)
        for number, wall in enumerate(world.walls):
            label = "true walls" if number == 0 else None
            each.plot(
                [wall.x1, wall.x2], [wall.y1, wall.y2], color=plot_style.ORANGE, linewidth=1.0, label=label
            )
        plot_style.path(each, drive.path, plot_style.BLUE, "path by odometry")
        plot_style.floor(each, f"mapped with {name}")
        each.grid(False)
        each.legend(loc="upper left", fontsize="small")
    return plot_style.save(made, setting.folder, "l-course")
