"""Drives from point to point over a grid, around two boxes, with a live mirror in another process.

The drives are in simulated time, with the sonars and, as the control, without.  The delay of the mirror is measured in
real time: of a drive through ROS or on a port if there is one, and of a loop without a robot, its control.
"""

import json
import math
import os
import subprocess
import sys
import threading
import time
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.driver import Driver
from mrl_driver.driver.options import Options
from mrl_driver.errors import MrlError
from mrl_driver.geometry import Pose
from mrl_driver.navigation.goal_seeker import GoalSeeker
from sim_arduino.world import world_file
from sim_arduino.world.shared_robots import SharedRegistry

from . import disturbances, plot_style, trials
from .experiment_report import Figure, Result
from .experiment_robot import PERIOD_MS, TICK_S, ExperimentRobot, Setting, open_robot
from .team import pose_option

SEEDS = trials.SEEDS
WORLD = "steps"
START = Pose(-1.2, 0.0, 0.0)
GRID = ((0.4, 0.0), (0.4, 0.4), (0.8, 0.4), (0.8, 0.8), (1.2, 0.8), (1.2, 1.2))
"""The published waypoints (Araujo 2012)."""
WAYPOINTS = ((0.0, 0.0), *GRID, (2.4, 1.2))
"""The grid, with a leg before and after it that has room for a box."""
TIME_LIMIT_S = 120.0
POLL_S = 0.001
START_S = 10.0
"""The mirror's process must start, and show the last pose, within this time."""
LOOP_POSES, LOOP_HZ = 100, 20.0
"""Poses that the loop without a robot sends, and their rate."""
TITLE = "Steps over a 400 x 400 mm grid, around two boxes, mirrored live"
REMARK = (
    "Drives in simulated time with two boxes on the floor; a waypoint counts as reached within 3 cm by odometry, which "
    "is not calibrated. Their control drives without sonars. The mirror is another process on the same computer; the "
    "published one was Stage on another computer."
)


class StepRecord(NamedTuple):
    """Poses by odometry, true poses, poses of the mirror, and the mirror's delays [s]."""

    odometry: List[Tuple[float, ...]]
    true: List[Tuple[float, ...]]
    mirrored: List[Tuple[float, ...]]
    delays_s: List[float]
    touched_s: float = 0.0
    """Time in contact with an object [s]."""


class StepDrive(NamedTuple):
    """A drive in simulated time: true path, poses by odometry, ticks in contact with an object, waypoints reached."""

    true: List[Pose]
    odometry: List[Pose]
    touched: int
    reached: int

    @property
    def touched_s(self) -> float:
        """Time in contact with an object [s]."""
        return self.touched * TICK_S

    @property
    def error_cm(self) -> float:
        """Distance of the true end from the last waypoint [cm]."""
        return 100 * math.dist(self.true[-1][:2], WAYPOINTS[-1])


class Mirrored:
    """A mirror in another process.  Its delay is the time until a pose that was sent appears in the shared world."""

    def __init__(self, robot: str) -> None:
        self._name = f"step-test-{os.getpid()}"
        command = [
            sys.executable,
            "-m",
            "sim_arduino.replay.mirror",
            "--world-name",
            self._name,
            "--name",
            "mirror",
        ]
        self._process = subprocess.Popen([*command, "--robot", robot], stdin=subprocess.PIPE, text=True)
        assert self._process.stdin is not None
        self._pipe = self._process.stdin
        self._registry = SharedRegistry(self._name)
        self._sent: Dict[Tuple[float, ...], float] = {}
        self._ending = False
        self.poses: List[Tuple[float, ...]] = []
        self.delays_s: List[float] = []
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def send(self, pose: Tuple[float, ...], stamp_s: float) -> None:
        """Sends a pose to the mirror; `stamp_s` is its time [s, monotonic]."""
        if pose not in self._sent and self._process.poll() is None:
            self._sent[pose] = stamp_s
            self._pipe.write(json.dumps(dict(zip(("x_m", "y_m", "yaw_rad"), pose))) + "\n")
            self._pipe.flush()

    def _watch(self) -> None:
        last = None
        while not self._ending:
            for mover in self._registry.others(""):
                pose = tuple(mover.pose)
                if pose != last and pose in self._sent:
                    self.delays_s.append(time.monotonic() - self._sent[pose])
                    self.poses.append(pose)
                last = pose
            time.sleep(POLL_S)

    def wait(self) -> None:
        """Waits until the process shows poses; the delays up to then do not count."""
        self._wait_for(lambda: bool(self.poses))
        self.delays_s.clear()

    def wait_for(self, pose: Tuple[float, ...]) -> None:
        """Waits until the process shows a pose that was sent."""
        self._wait_for(lambda: pose in self.poses[-1:])

    def _wait_for(self, done: Callable[[], bool]) -> None:
        end_s = time.monotonic() + START_S
        while not done() and time.monotonic() < end_s:
            time.sleep(0.05)

    def close(self) -> None:
        """Ends the process."""
        self._ending = True
        self._thread.join()
        self._process.terminate()
        self._process.communicate()
        self._registry.close()


def run(setting: Setting, live: Optional[StepRecord] = None) -> Result:
    """Drives the steps, and draws robots and mirror; `live` is a drive in real time through ROS.

    Raises:
        MrlError: the mirror showed no pose.
    """
    if setting.port is not None:
        live = _real(setting)
        end = 100 * math.dist(live.true[-1][:2], WAYPOINTS[-1])
        rows = [Figure("end_error_cm", "distance of the end by odometry from the last waypoint", end, "cm")]
        return Result("step-test", TITLE, rows + _delay_rows(live, []), [_draw(setting, [], [], live)])
    drives = trials.over_seeds(_simulated, setting, SEEDS)
    blind = trials.over_seeds(lambda each: _simulated(each, sonars=False), setting, SEEDS)
    loop = _loop(setting, drives[0].odometry)
    rows = [*_rows(drives, blind), *(_live_rows(live, loop) if live else _delay_rows(loop, []))]
    return Result("step-test", TITLE, rows, [_draw(setting, drives, blind, live or loop)], REMARK)


def _rows(drives: Sequence[StepDrive], blind: Sequence[StepDrive]) -> List[Figure]:
    return [
        trials.figure(
            "touched_s",
            "time in contact with a box",
            [each.touched_s for each in drives],
            "s",
            [each.touched_s for each in blind],
        ),
        trials.figure(
            "end_error_cm",
            "distance of the true end from the last waypoint",
            [each.error_cm for each in drives],
            "cm",
            [each.error_cm for each in blind],
        ),
        trials.figure(
            "reached",
            f"waypoints of {len(WAYPOINTS)} that were reached by odometry",
            [each.reached for each in drives],
            worst=min,
        ),
    ]


def _live_rows(live: StepRecord, loop: StepRecord) -> List[Figure]:
    end = 100 * math.dist(live.true[-1][:2], WAYPOINTS[-1])
    return [
        Figure("live_touched_s", "time in contact with a box, through ROS", live.touched_s, "s"),
        Figure(
            "live_end_error_cm", "distance of the true end from the last waypoint, through ROS", end, "cm"
        ),
        *_delay_rows(live, loop.delays_s),
    ]


def _delay_rows(live: StepRecord, control: Sequence[float]) -> List[Figure]:
    delays = sorted(1000 * delay for delay in live.delays_s)
    if not delays:
        raise MrlError("the mirror showed no pose; check that the folder of shared worlds has free space")
    loop = sorted(1000 * delay for delay in control)
    middle, most = (loop[len(loop) // 2], loop[-1]) if loop else (None, None)
    what = "delay of the mirror" if loop else "delay of the mirror alone, without a robot"
    named = (("median", delays[len(delays) // 2], middle), ("max", delays[-1], most))
    return [
        Figure(
            f"mirror_delay_ms_{name}",
            f"{what}, {'largest' if name == 'max' else name} of {len(delays)} poses",
            value,
            "ms",
            "below 1 s",
            control=beside,
        )
        for name, value, beside in named
    ]


# -- in simulated time


def _simulated(setting: Setting, sonars: bool = True) -> StepDrive:
    """Drives all waypoints, or up to the first one that is not reached."""
    driven = StepDrive([], [], 0, 0)
    error, start = disturbances.error(setting.seed), pose_option(disturbances.placed(START, setting.seed))
    with open_robot(setting, WORLD, error=error, sonar=disturbances.SONAR, pose=start) as robot:
        robot.reset_pose(START)
        for waypoint in WAYPOINTS:
            touched, reached = _seek(robot, waypoint, sonars, driven)
            driven = driven._replace(touched=driven.touched + touched, reached=driven.reached + reached)
            if not reached:
                break
    return driven


def _seek(
    robot: ExperimentRobot, waypoint: Tuple[float, float], sonars: bool, driven: StepDrive
) -> Tuple[int, bool]:
    """Drives to a waypoint; returns the ticks in contact, and whether it was reached."""
    seek, end_s, touched = robot.seek(_goal(robot.pose, waypoint)), robot.driver.now_s + TIME_LIMIT_S, 0
    step = seek(robot.ranges if sonars else {})
    while not step.reached:
        if step.blocked or robot.driver.now_s > end_s:
            return touched, False
        robot.drive(*step.speeds)
        robot.wait(TICK_S)
        touched += robot.bumped
        driven.true.append(robot.true_pose)
        driven.odometry.append(robot.pose)
        step = seek(robot.ranges if sonars else {})
    return touched, True


def goals() -> List[Pose]:
    """All waypoints, each with the heading of the line from the one before."""
    before = [START, *(Pose(*each, 0.0) for each in WAYPOINTS)]
    return [_goal(pose, waypoint) for pose, waypoint in zip(before, WAYPOINTS)]


def _goal(pose: Pose, waypoint: Tuple[float, float]) -> Pose:
    """The waypoint, with the heading of the line to it."""
    return Pose(*waypoint, math.atan2(waypoint[1] - pose.y_m, waypoint[0] - pose.x_m))


# -- in real time


def _loop(setting: Setting, poses: Sequence[Pose]) -> StepRecord:
    """Sends poses to the mirror at a constant rate, without a robot."""
    sent = list(dict.fromkeys(tuple(pose) for pose in poses))[: LOOP_POSES + 1]
    mirror = Mirrored(setting.robot)
    try:
        mirror.send(sent[0], time.monotonic())
        mirror.wait()
        for pose in sent[1:]:
            mirror.send(pose, time.monotonic())
            time.sleep(1 / LOOP_HZ)
        mirror.wait_for(sent[-1])
    finally:
        mirror.close()
    return StepRecord([], [], mirror.poses, mirror.delays_s)


def _real(setting: Setting) -> StepRecord:
    """Drives the robot on a port; its true poses are those by odometry."""
    assert setting.port is not None
    path: List[Tuple[float, ...]] = []
    mirror = Mirrored(setting.robot)
    try:  # stop the robot before the slow end of the mirror
        with Driver(setting.port, setting.robot, options=Options(period_ms=PERIOD_MS)) as driver:
            driver.reset_pose(START)
            driver.on_telemetry(lambda each: mirror.send(tuple(each.pose), each.stamp_s))
            mirror.wait()
            for waypoint in WAYPOINTS:
                _go(driver, waypoint, path)
            driver.stop()
            driver.wait(0.5)
    finally:
        mirror.close()
    return StepRecord(path, path, mirror.poses, mirror.delays_s)


def _go(driver: Driver, waypoint: Tuple[float, float], path: List[Tuple[float, ...]]) -> None:
    assert driver.model is not None
    seeker = GoalSeeker(_goal(driver.pose, waypoint), driver.model.limits, driver.now_s, driver.model.sonars)
    end_s = driver.now_s + TIME_LIMIT_S
    while not seeker.reached:
        if seeker.blocked or driver.now_s > end_s:
            raise MrlError(
                f"waypoint {waypoint} was not reached, the robot is at {driver.pose}; clear the path"
            )
        driver.drive(*seeker.command(driver.pose, driver.ranges, driver.now_s))
        driver.wait(TICK_S)
        path.append(tuple(driver.pose))


# -- picture


def _draw(setting: Setting, drives: Sequence[StepDrive], blind: Sequence[StepDrive], live: StepRecord) -> str:
    made, (floor, late) = plot_style.figure(2, 11.0, 4.6)
    plot_style.walls(floor, [wall for solid in world_file.load(WORLD).solids for wall in solid], "boxes")
    for number, each in enumerate(blind):
        label = "true paths without sonars" if number == 0 else ""
        plot_style.path(floor, each.true, plot_style.GREY, label, ":")
    for number, each in enumerate(drives):
        plot_style.path(floor, each.true, plot_style.BLUE, "true paths" if number == 0 else "")
    if live.true:
        plot_style.path(floor, live.mirrored, plot_style.ORANGE, "mirror", "--")
    floor.plot(
        *zip(*WAYPOINTS), "s", color=plot_style.GREEN, markersize=7, fillstyle="none", label="waypoints"
    )
    plot_style.floor(floor)
    floor.legend(loc="upper left", fontsize="small")
    late.hist(
        [1000 * delay for delay in live.delays_s], bins=40, color=plot_style.SKY, edgecolor=plot_style.BLUE
    )
    late.set(xlabel="delay of the mirror [ms]", ylabel="poses")
    return plot_style.save(made, setting.folder, "step-test")
