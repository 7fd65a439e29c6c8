"""Maps the L-shaped course with the two side sonars and with the laser, in one drive.

Each robot drives it twice: with wheels and sonars calibrated before, and without these calibrations.
"""

import math
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mrl_driver.apps.calibration import sonar_procedures
from mrl_driver.driver import Telemetry
from mrl_driver.geometry import Pose
from mrl_driver.navigation.line_follower import Course, FollowerLimits
from mrl_driver.robot.models import Drive
from mrl_driver.robot.sonar_curve import Curve
from sim_arduino.hardware.laser import URG_04LX, LaserScanner
from sim_arduino.hardware.sonars import HALF_CONE_RAD
from sim_arduino.world import grid_map, world_file
from sim_arduino.world.grid_map import OCCUPIED, GridMap
from sim_arduino.world.map_score import MapScore, nearest, points, share_near
from sim_arduino.world.world import World

from . import disturbances, occupancy, sonar_approach, square
from .experiment_report import Figure, Measure, Result, over_seeds
from .experiment_robot import ExperimentRobot, Setting, follow, open_robot
from .occupancy import SONAR_FAR_M, score_rows

WORLD = "l-course"
SIDES = ("left", "right")  # the front sonar only serves to avoid obstacles, as in the thesis
NEAR_M = 0.05  # a wall cell counts as mapped if an occupied cell is within this distance [m]
MARGIN_M, CELL_M = 0.3, 0.025
WAYPOINTS = ((1.5, 0.5), (1.5, 1.25), (1.5, 0.5), (0.35, 0.5), (1.0, 0.5))
SLOW = FollowerLimits(linear_m_s=0.12, angular_rad_s=0.35)
"""Slow enough that each sonar, which measures every 0.3 s, does so every few degrees and centimetres."""
OCCUPIED_FROM = {"sonars": 0.9, "laser": 6.0}
"""Smallest log odds of a wall cell: two arcs without contradiction, or six beams."""
VIEWS = {
    "sonars": (-HALF_CONE_RAD, 2 * HALF_CONE_RAD / 72, 73, SONAR_FAR_M),
    "laser": (URG_04LX.first_rad, URG_04LX.step_rad, URG_04LX.rays, URG_04LX.far_m),
}
"""Rays of each kind of sensor: first direction, step [rad], number, and largest range [m]."""
DRIFT = Measure("drift_cm", "largest error of a position by odometry", "cm")


class CourseRecord(NamedTuple):
    """The measurements of the drive; poses are by odometry, in the world's frame."""

    path: List[Pose]
    cones: List[Tuple[Pose, float, Pose]]  # pose of a sonar, its reading [m], and its true pose
    scans: List[Tuple[Pose, Any, Pose]]
    true_path: List[Pose]

    def by_true_poses(self) -> "CourseRecord":
        """The same measurements, as odometry without errors places them."""
        cones = [(true, range_m, true) for _, range_m, true in self.cones]
        scans = [(true, ranges, true) for _, ranges, true in self.scans]
        return self._replace(path=self.true_path, cones=cones, scans=scans)


class CourseRun(NamedTuple):
    """The maps of a drive and their scores by the kind of sensor, and the largest error of a position by odometry."""

    path: List[Pose]
    maps: Dict[str, GridMap]
    scores: Dict[str, MapScore]
    drift_cm: float


def run(setting: Setting, live: Optional[CourseRecord] = None) -> Result:
    """Drives through the course, and draws the maps of the first robot; `live` is one more drive, through ROS."""
    title = "L-shaped course mapped with sonars and with a laser"
    if setting.port is not None:
        return _of_port(setting, title)
    trialled = over_seeds(_trial, setting)
    calibrated, true, uncalibrated = zip(*trialled)
    rows = [row for sensor in OCCUPIED_FROM for row in _rows(sensor, calibrated, true, uncalibrated)]
    rows.append(DRIFT.figure(calibrated, uncalibrated))
    rows += _live_rows(live) if live else []
    for name, made in calibrated[0].maps.items():
        grid_map.write(made, f"{setting.folder}/l-course-{name}.yaml")
    picture = _draw(setting, {"calibrated": calibrated[0], "not calibrated": uncalibrated[0]})
    remark = (
        f"A wall cell is found if an occupied cell is within {100 * NEAR_M:g} cm; a false cell has no wall within this "
        "distance. Wheels, sonars and the start by hand have errors. The robots were calibrated as by `mrl calibrate "
        f"umbmark` ({square.LAPS} laps in each direction) and `mrl calibrate sonar`. Control: the same robots without "
        "these calibrations. With true poses, only sensors and mapping have errors. The maps of the first robot are in "
        "map_server's format."
    )
    remark += " The run through ROS is in real time, with a start by hand." if live else ""
    return Result("l-course", title, rows, [picture], remark)


def _of_port(setting: Setting, title: str) -> Result:
    """The map of a real robot by its sonars."""
    world = world_file.load(WORLD)
    with open_robot(setting) as robot:
        made = _mapped(_drive(setting, robot, world), world, ("sonars",))
    grid_map.write(made.maps["sonars"], f"{setting.folder}/l-course-sonars.yaml")
    rows = score_rows("sonars", "sonars, poses by odometry", [made.scores["sonars"]])
    return Result("l-course", title, rows, [_draw(setting, {"poses by odometry": made})])


def _rows(sensor: str, *trialled: Sequence[CourseRun]) -> List[Figure]:
    """Figures of one kind of sensor: with the poses by odometry next to the control, and with true poses."""
    calibrated, true, uncalibrated = ([each.scores[sensor] for each in runs] for runs in trialled)
    return [
        *score_rows(sensor, f"{sensor}, poses by odometry", calibrated, uncalibrated),
        *score_rows(f"{sensor}_true", f"{sensor}, true poses", true),
    ]


def _live_rows(live: CourseRecord) -> List[Figure]:
    """Figures of a drive through ROS, with a robot that has random errors alone."""
    made, text = _mapped(live, world_file.load(WORLD)), "one robot with random errors alone, through ROS"
    scores = [score_rows(f"ros_{name}", f"{name}, {text}", [score]) for name, score in made.scores.items()]
    drift = DRIFT.figure([made])._replace(key="ros_drift_cm", text=f"{DRIFT.text}, through ROS")
    return [row._replace(worst=None) for row in (*scores[0], *scores[1], drift)]


def _trial(setting: Setting) -> Tuple[CourseRun, ...]:
    """One robot: after its calibrations, then with true poses in place of the odometry's, and without calibrations."""
    error, curve = disturbances.error(setting.seed), disturbances.sonar_curve(setting.seed)
    drive = square.calibrated(setting, error)
    fitted = sonar_approach.approach(setting, curve, error).fit.curve
    unseen = setting._replace(seed=setting.seed + square.UNSEEN)
    sonar = sonar_approach.sonar_errors(curve)
    world = world_file.load(WORLD)
    calibrated = _emulated(unseen, world, error, sonar, drive, fitted)
    uncalibrated = _emulated(unseen, world, error, sonar)
    records = (calibrated, calibrated.by_true_poses(), uncalibrated)
    return tuple(_mapped(each, world) for each in records)


def _emulated(
    setting: Setting,
    world: World,
    error: str,
    sonar: str,
    drive: Optional[Drive] = None,
    curve: Optional[Curve] = None,
) -> CourseRecord:
    """The drive of an emulated robot, with a drive and a sonar curve in place of the model's if they are not None."""
    pose = world_file.pose_text(disturbances.placed(world.start, setting.seed))
    with open_robot(setting, world, drive, error=error, sonar=sonar, pose=pose) as robot:
        if curve:
            robot.driver.parameters.write(sonar_procedures.curve_values(curve))
        return _drive(setting, robot, world)


def _drive(setting: Setting, robot: ExperimentRobot, world: World) -> CourseRecord:
    scanner, driver = LaserScanner(world, seed=setting.seed), robot.driver
    drive, mounts = CourseRecord([], [], [], []), robot.model.sonars
    robot.reset_pose(world.start)

    def add_cones(telemetry: Telemetry) -> None:
        for name in telemetry.fresh:
            if name in SIDES:
                at = mounts[name].pose
                true = robot.true_pose.compose(*at)
                drive.cones.append((telemetry.pose.compose(*at), telemetry.ranges[name], true))

    def add_scan() -> None:
        drive.path.append(driver.pose)
        drive.true_path.append(robot.true_pose)
        if len(drive.path) % 2 == 0:
            mount = (URG_04LX.mount.x_m, URG_04LX.mount.y_m)
            scan = scanner.scan(robot.true_pose, "robot")
            drive.scans.append((driver.pose.compose(*mount), scan, robot.true_pose.compose(*mount)))

    driver.on_telemetry(add_cones)
    follow(robot, Course(WAYPOINTS, SLOW), add_scan)
    return drive


def _mapped(drive: CourseRecord, world: World, sensors: Sequence[str] = tuple(OCCUPIED_FROM)) -> CourseRun:
    """The maps of a drive."""
    cones, scans = ([(pose, value) for pose, value, _ in each] for each in (drive.cones, drive.scans))
    occupied_from = {sensor: OCCUPIED_FROM[sensor] for sensor in sensors}
    maps = occupancy.maps(world, cones, scans, occupied_from, MARGIN_M, CELL_M)
    readings = {"sonars": drive.cones, "laser": drive.scans}
    views = {sensor: _seen(world, readings[sensor], *VIEWS[sensor]) for sensor in maps}
    scores = {sensor: _score(made, views[sensor], world) for sensor, made in maps.items()}
    off_m = [math.hypot(a.x_m - b.x_m, a.y_m - b.y_m) for a, b in zip(drive.path, drive.true_path)]
    return CourseRun(drive.path, maps, scores, 100 * max(off_m))


def _seen(
    world: World, readings: Sequence[Any], first_rad: float, step_rad: float, count: int, far_m: float
) -> Any:
    """Points at which rays from the true poses of readings hit walls, `(N, 2)` [m]."""
    found, angles = [], first_rad + np.arange(count) * step_rad
    for _, _, pose in readings:
        ranges = world.scan(pose, first_rad, step_rad, count, far_m, without="robot")
        hit = np.isfinite(ranges)
        along, headings = ranges[hit], angles[hit] + pose.yaw_rad
        found.append(
            np.column_stack((pose.x_m + along * np.cos(headings), pose.y_m + along * np.sin(headings)))
        )
    return np.concatenate(found)


def _score(made: GridMap, view: Any, world: World) -> MapScore:
    """How good a map is, given the points `(N, 2)` [m] at which its sensor saw walls; without the farthest cell."""
    true = grid_map.draw(world, made.resolution_m, MARGIN_M)
    walls = points(true.cells == OCCUPIED, true)
    occupied = points(made.cells == OCCUPIED, made)
    cells = {tuple(cell) for cell in np.floor(view / made.resolution_m).astype(int)}
    spots = (np.array(sorted(cells)) + 0.5) * made.resolution_m
    in_view = walls[nearest(walls, spots) <= made.resolution_m]
    found, sound = share_near(in_view, occupied, NEAR_M), share_near(occupied, walls, NEAR_M)
    return MapScore(found, 1 - sound, math.nan)


def _draw(setting: Setting, shown: Dict[str, CourseRun]) -> str:
    """Draws the maps of each run, next to its name."""
    panels = [
        (f"{sensor}, {name}", each.maps[sensor], each.path)
        for sensor in OCCUPIED_FROM
        for name, each in shown.items()
        if sensor in each.maps
    ]
    return occupancy.draw(setting, "l-course", world_file.load(WORLD), panels, 3.5)
