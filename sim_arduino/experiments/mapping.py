"""Maps a house by recorded key presses, with sonars and with the laser, by poses with and without a gyro.

The robot is a TraxBot whose tracks lose a tenth of each turn, which its model does not know.  The same key presses
drive it in each run; they were made once, by sight.  The maps come from occupancy grids alone: nothing corrects the
poses.
"""

import csv
import math
import os
from bisect import bisect_left
from typing import Any, Callable, Dict, List, NamedTuple, Sequence, Tuple

from mrl_driver.driver import Telemetry
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.robot import models
from mrl_driver.terminal.teleop_keys import HOLD_S, Teleop
from sim_arduino.hardware.imu import ImuErrors
from sim_arduino.hardware.laser import URG_04LX, LaserScanner
from sim_arduino.world import grid_map, map_score, world_file
from sim_arduino.world.grid_map import GridMap
from sim_arduino.world.map_score import MapScore
from sim_arduino.world.world import World

from . import disturbances, occupancy
from .experiment_report import SEEDS, Figure, Measure, Result, over_seeds
from .experiment_robot import TICK_S, ExperimentRobot, Setting, open_robot

KEYS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "house_keys.csv")
"""Key presses by sight, made by tests/experiments/record_house_keys.py of the commit 261b5637."""
ROBOT, WORLD = "traxbot", "house"
WANDER = "noise=1e-7,turn_noise=1e-6"
"""Random errors of wheels and turns, by which the runs differ: together 0.5 deg after 10 m and 25 rad.  They are white:
no gyro can follow them, and much larger ones would hide what it does."""
PERIOD_MS = 20
SCAN_EVERY = 8  # a scan counts after this many ticks: 2.5 a second
STEADY_RAD_S = 0.3
"""Ranges of the sonars count while the robot turns more slowly: their time is uncertain by the 0.3 s of a round."""
MARGIN_M, CELL_M = 1.0, 0.05
OCCUPIED_FROM = {"sonars": 0.9, "laser": 4.0}
"""Smallest log odds of a wall cell: two arcs without contradiction, or four beams."""
POSES = {
    "wheels": "wheels alone",
    "gyro": "wheels and gyro",
    "calibrated": "wheels and calibrated gyro",
    "true": "true poses",
}
"""Kinds of poses.  The gyro has bias, scale, drift and noise of the data sheet, and is the same with its scale
calibrated."""
DRIVEN = ("wheels", "gyro", "calibrated")
SHOWN = ("wheels", "gyro")


class KeyPress(NamedTuple):
    """One press of a key, at a time since the start of the recording [s]."""

    time_s: float
    key: str


class HouseDrive(NamedTuple):
    """The measurements of one drive, each with the time at which it was made [s]."""

    path: List[Tuple[float, Pose]]  # poses by the driver, at the times when the counters were read
    true: List[Tuple[float, Pose]]  # true poses at each tick
    ranges: List[Tuple[float, str, float, float]]
    """Name of a sonar, its range [m] and the rate of turn [rad/s]."""
    scans: List[Tuple[float, Any]]  # ranges of the laser, `(rays,)` [m]


class HouseRun(NamedTuple):
    """The drives of one seed: largest heading error by kind of poses, and maps and scores by sensor and kind."""

    heading_deg: Dict[str, float]
    maps: Dict[Tuple[str, str], GridMap]
    scores: Dict[Tuple[str, str], MapScore]


def run(setting: Setting) -> Result:
    """Drives with and without a gyro, and draws the maps of the first drives."""
    if setting.robot != ROBOT:
        raise ConfigError(
            f"experiment mapping repeats key presses for {ROBOT}, got --robot {setting.robot}; leave it out"
        )
    world, presses = world_file.load(WORLD), read_presses(KEYS)
    runs = over_seeds(lambda each: _mapped(each, world, presses), setting)
    shown = {f"{sensor}, {POSES[kind]}": made for (sensor, kind), made in runs[0].maps.items()}
    for name, made in shown.items():
        file = name.replace(", ", "-").replace(" ", "-")
        grid_map.write(made, os.path.join(setting.folder, f"mapping-{file}.yaml"))
    rows = [_heading(poses, runs) for poses in DRIVEN]
    rows += [row for sensor, kind in runs[0].maps for row in _score_rows(sensor, kind, runs)]
    remark = (
        f"{SEEDS} drives of {presses[-1].time_s:.0f} s. A wall cell is found if an occupied cell is within "
        f"{100 * map_score.NEAR_M:g} cm, and a false cell has no wall within the same distance. TraxBot loses 10 % of "
        "each turn by slip, unknown to its model; this is put in. Control: the wheels alone. `compare_map` gives the "
        "same figures for a saved map of a mapper."
    )
    title = "House mapped by recorded key presses, without and with a gyro"
    panels = [
        (name, shown[name], None) for name in (f"{s}, {POSES[k]}" for s in OCCUPIED_FROM for k in SHOWN)
    ]
    return Result("mapping", title, rows, [occupancy.draw(setting, "mapping", world, panels, 4.2)], remark)


def read_presses(path: str) -> List[KeyPress]:
    """The recorded presses in a CSV file with the columns `time_s` and `key`, in the order of their times."""
    with open(path, encoding="utf-8", newline="") as file:
        return [KeyPress(float(row["time_s"]), row["key"]) for row in csv.DictReader(file)]


def _mapped(setting: Setting, world: World, presses: Sequence[KeyPress]) -> HouseRun:
    """The drives of one seed, and their maps."""
    found = HouseRun({}, {}, {})
    for poses in DRIVEN:
        drive = _drive(setting, world, presses, poses)
        found.heading_deg[poses] = _heading_error_deg(drive)
        paths = {poses: drive.path}
        if poses == "wheels":
            paths["true"] = drive.true
        for kind, path in paths.items():
            for sensor, made in _maps(drive, world, path).items():
                found.maps[sensor, kind], found.scores[sensor, kind] = made, map_score.score(made, world)
    return found


def _drive(setting: Setting, world: World, presses: Sequence[KeyPress], poses: str) -> HouseDrive:
    """One drive, with the seed of the setting and the IMU that gives such poses."""
    drive, scanner = HouseDrive([], [], [], []), LaserScanner(world, seed=setting.seed)
    errors: Dict[str, Any] = {"sonar": disturbances.SONAR, "slip": True, "error": WANDER}
    with open_robot(setting, world, period_ms=PERIOD_MS, **errors, **_imu(poses, setting.seed)) as robot:
        robot.reset_pose(world.start)

        def keep(telemetry: Telemetry) -> None:
            drive.path.append((telemetry.stamp_s, telemetry.pose))
            turn, ranges = abs(telemetry.twist[-1]), telemetry.ranges
            drive.ranges.extend((telemetry.stamp_s, name, ranges[name], turn) for name in telemetry.fresh)

        def tick() -> None:
            now_s = robot.driver.now_s
            drive.true.append((now_s, robot.true_pose))
            if len(drive.true) % SCAN_EVERY == 0:
                drive.scans.append((now_s, scanner.scan(robot.true_pose, "robot")))

        robot.driver.on_telemetry(keep)
        replay(robot, presses, tick)
        _require_round(robot, world)
    return drive


def replay(robot: ExperimentRobot, presses: Sequence[KeyPress], each_tick: Callable[[], None]) -> None:
    """Drive as the keys say, until the last press has ended; calls `each_tick` at each tick."""
    teleop, waiting, start_s = Teleop(), list(reversed(presses)), robot.driver.now_s
    end_s = (presses[-1].time_s if presses else 0.0) + HOLD_S
    now_s = 0.0
    while now_s <= end_s:
        while waiting and waiting[-1].time_s < now_s + TICK_S / 2:  # the nearest tick, whatever is rounded
            teleop.press(waiting.pop().key, now_s)
        robot.drive(*teleop.command(now_s))
        robot.wait(TICK_S)
        each_tick()
        now_s = robot.driver.now_s - start_s
    robot.drive(0.0, 0.0)


def _imu(poses: str, seed: int) -> Dict[str, Any]:
    """Options of the emulated robot, and the mount of the IMU that its driver knows."""
    if poses == "wheels":
        return {}
    errors = ImuErrors.drawn(seed)  # the same chip in both, with the same drift
    mount = disturbances.calibrated_imu(errors, seed) if poses == "calibrated" else None
    return {"imu": True, "imu_errors": errors, "imu_mount": mount}


def _require_round(robot: ExperimentRobot, world: World) -> None:
    """Raises ConfigError if the robot has not come back to the room in which it began."""
    end = robot.true_pose
    if math.dist(end[:2], world.start[:2]) > 1.0:
        raise ConfigError(
            f"the drive by {KEYS} ends at {end.x_m:.1f}, {end.y_m:.1f}, expected the room of the start: robot or world "
            "have changed; record the key presses again"
        )


def _heading_error_deg(drive: HouseDrive) -> float:
    """The largest error of the heading in the drive [deg]."""
    off_rad = (wrap_angle(pose_at(drive.path, time_s).yaw_rad - true.yaw_rad) for time_s, true in drive.true)
    return math.degrees(max(map(abs, off_rad)))


def pose_at(path: Sequence[Tuple[float, Pose]], time_s: float) -> Pose:
    """The pose at a time, between the two poses around it; the first or last one beyond the ends."""
    index = bisect_left(path, (time_s,))
    if index in (0, len(path)):
        return path[min(index, len(path) - 1)][1]
    (before_s, before), (after_s, after) = path[index - 1], path[index]
    share = (time_s - before_s) / (after_s - before_s)
    turn = wrap_angle(after.yaw_rad - before.yaw_rad)
    return Pose(
        before.x_m + share * (after.x_m - before.x_m),
        before.y_m + share * (after.y_m - before.y_m),
        before.yaw_rad + share * turn,
    )


def _maps(drive: HouseDrive, world: World, path: Sequence[Tuple[float, Pose]]) -> Dict[str, GridMap]:
    """The map of each kind of sensor, from poses on a path."""
    mounts, laser = models.load(ROBOT).sonars, URG_04LX.mount
    cones = [
        (pose_at(path, time_s).compose(*mounts[name].pose), range_m)
        for time_s, name, range_m, turn_rad_s in drive.ranges
        if turn_rad_s < STEADY_RAD_S
    ]
    scans = ((pose_at(path, time_s).compose(laser.x_m, laser.y_m), ranges) for time_s, ranges in drive.scans)
    return occupancy.maps(world, cones, scans, OCCUPIED_FROM, MARGIN_M, CELL_M)


def _heading(poses: str, runs: Sequence[HouseRun]) -> Figure:
    wheels = poses == "wheels"
    text = f"largest heading error in the drive, {POSES[poses]}"
    errors, control = ([run.heading_deg[kind] for run in runs] for kind in (poses, "wheels"))
    measure = Measure(f"heading_{poses}_deg", text, "deg", float, put_in=wheels)
    return measure.figure(errors, () if wheels else control)


def _score_rows(sensor: str, kind: str, runs: Sequence[HouseRun]) -> List[Figure]:
    """Figures of the maps by one kind of sensor and of poses; true poses have no control."""
    scores, wheels = ([run.scores[sensor, each] for run in runs] for each in (kind, "wheels"))
    control = () if kind in ("wheels", "true") else wheels
    return occupancy.score_rows(f"{sensor}_{kind}", f"{sensor}, {POSES[kind]}", scores, control)
