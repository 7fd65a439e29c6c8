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
from contextlib import closing
from statistics import median
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import MrlError
from mrl_driver.geometry import Pose
from sim_arduino.world import world_file
from sim_arduino.world.shared_robots import SharedRegistry

from . import disturbances, plot_style
from .experiment_report import Figure, Measure, Result, figures, over_seeds
from .experiment_robot import TICK_S, ExperimentRobot, Setting, open_robot

WORLD = "steps"
START = Pose(-1.2, 0.0, 0.0)
GRID = ((0.4, 0.0), (0.4, 0.4), (0.8, 0.4), (0.8, 0.8), (1.2, 0.8), (1.2, 1.2))
"""The published waypoints (Araujo 2012)."""
WAYPOINTS = ((0.0, 0.0), *GRID, (2.4, 1.2))
"""The grid, with a leg before and after it that has room for a box."""
TIME_LIMIT_S = 120.0
POLL_S = 0.001
START_S = 10.0  # the mirror's process must start, and show the last pose, within this time
LOOP_POSES, LOOP_HZ = 100, 20.0  # poses that the loop without a robot sends, and their rate
TITLE = "Steps over a 400 x 400 mm grid, around two boxes, mirrored live"
MEASURES = (
    Measure("touched_s", "time in contact with a box", "s"),
    Measure("end_error_cm", "distance of the true end from the last waypoint", "cm"),
)
REACHED = Measure("reached", f"waypoints of {len(WAYPOINTS)} that were reached by odometry", worst=min)
REMARK = (
    "Drives in simulated time with two boxes on the floor; a waypoint counts as reached within 3 cm by odometry, which "
    "is not calibrated. Their control drives without sonars. The mirror is another process on the same computer; the "
    "published one was Stage on another computer."
)


class StepDrive(NamedTuple):
    """A drive: true path, poses by odometry, ticks in contact with an object, and number of waypoints reached."""

    true: List[Pose]
    odometry: List[Pose]
    touched: int
    reached: int

    @property
    def touched_s(self) -> float:
        """Time in contact with an object [s]."""
        return self.touched * TICK_S

    @property
    def end_error_cm(self) -> float:
        """Distance of the true end from the last waypoint [cm]."""
        return 100 * math.dist(self.true[-1][:2], WAYPOINTS[-1])


class Mirrored:
    """A mirror in another process.  Its delay is the time until a pose that was sent appears in the shared world."""

    def __init__(self, robot: str) -> None:
        self._name = f"step-test-{os.getpid()}"
        words = ("--world-name", self._name, "--name", "mirror", "--robot", robot)
        command = [sys.executable, "-m", "mrl_driver", "mirror", *words]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, text=True)
        assert self._process.stdin is not None
        self._pipe = self._process.stdin
        self._registry = SharedRegistry(self._name)
        self._sent: Dict[Pose, float] = {}
        self._ending = False
        self.poses: List[Pose] = []
        self.delays_s: List[float] = []
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def send(self, pose: Pose, stamp_s: float) -> None:
        """Sends a pose to the mirror; `stamp_s` is its time [s, monotonic]."""
        if pose not in self._sent and self._process.poll() is None:
            self._sent[pose] = stamp_s
            self._pipe.write(json.dumps(pose._asdict()) + "\n")
            self._pipe.flush()

    def _watch(self) -> None:
        last = None
        while not self._ending:
            for mover in self._registry.others(""):
                if mover.pose != last and mover.pose in self._sent:
                    self.delays_s.append(time.monotonic() - self._sent[mover.pose])
                    self.poses.append(mover.pose)
                last = mover.pose
            time.sleep(POLL_S)

    def wait(self) -> None:
        """Waits until the process shows poses; the delays up to then do not count."""
        self.wait_for(lambda: bool(self.poses))
        self.delays_s.clear()

    def wait_for(self, done: Callable[[], bool]) -> None:
        """Waits until `done` returns True, at most `START_S`."""
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


Live = Tuple[StepDrive, Mirrored]  # a drive in real time, and its mirror


def run(setting: Setting, live: Optional[Live] = None) -> Result:
    """Drives the steps, and draws robots and mirror; `live` is a drive through ROS.

    MrlError if the mirror showed no pose, or the robot on the port did not reach a waypoint.
    """
    if setting.port is not None:
        driven, mirror = _real(setting)
        text = "distance of the end by odometry from the last waypoint"
        end = Figure("end_error_cm", text, driven.end_error_cm, "cm")
        picture = _draw(setting, [], [], mirror, live=True)
        return Result("step-test", TITLE, [end, *_delay_rows(mirror, [])], [picture])
    drives = over_seeds(_simulated, setting)
    blind = over_seeds(lambda each: _simulated(each, sonars=False), setting)
    loop = _loop(setting, drives[0].odometry)
    rows = [*figures(MEASURES, drives, blind), REACHED.figure(drives)]
    rows += _live_rows(live, loop) if live else _delay_rows(loop, [])
    picture = _draw(setting, drives, blind, live[1] if live else loop, bool(live))
    return Result("step-test", TITLE, rows, [picture], REMARK)


def _live_rows(live: Live, loop: Mirrored) -> List[Figure]:
    driven, mirror = live
    rows = (Figure(m.key, m.text, getattr(driven, m.key), m.unit) for m in MEASURES)
    through_ros = [row._replace(key=f"live_{row.key}", text=f"{row.text}, through ROS") for row in rows]
    return [*through_ros, *_delay_rows(mirror, loop.delays_s)]


def _delay_rows(mirror: Mirrored, control: Sequence[float]) -> List[Figure]:
    delays, others = ([1000 * delay for delay in each] for each in (mirror.delays_s, control))
    if not delays:
        raise MrlError("the mirror showed no pose; check that the folder of shared worlds has free space")
    what = "delay of the mirror" if others else "delay of the mirror alone, without a robot"
    rows = []
    for name, text, of in (("median", "median", median), ("max", "largest", max)):
        key, text = f"mirror_delay_ms_{name}", f"{what}, {text} of {len(delays)} poses"
        beside = of(others) if others else None
        rows.append(Figure(key, text, of(delays), "ms", "below 1 s", control=beside))
    return rows


# -- drives


def _simulated(setting: Setting, sonars: bool = True) -> StepDrive:
    error, start = disturbances.error(setting.seed), disturbances.placed(START, setting.seed)
    with open_robot(
        setting, WORLD, error=error, sonar=disturbances.SONAR, pose=world_file.pose_text(start)
    ) as robot:
        robot.reset_pose(START)
        return _drive(robot, sonars)


def _drive(robot: ExperimentRobot, sonars: bool = True) -> StepDrive:
    """Drives all waypoints, or up to the first one that is not reached."""
    driven = StepDrive([], [], 0, 0)
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
    seeker, end_s, touched = robot.seeker(_goal(robot.pose, waypoint)), robot.driver.now_s + TIME_LIMIT_S, 0
    while True:
        speeds = seeker.command(robot.pose, robot.ranges if sonars else {}, robot.driver.now_s)
        if seeker.reached:
            return touched, True
        if seeker.blocked or robot.driver.now_s > end_s:
            return touched, False
        robot.drive(*speeds)
        robot.wait(TICK_S)
        touched += robot.bumped
        driven.true.append(robot.true_pose)
        driven.odometry.append(robot.pose)


def goals() -> List[Pose]:
    """All waypoints, each with the heading of the line from the one before."""
    before = [START, *(Pose(*each, 0.0) for each in WAYPOINTS)]
    return [_goal(pose, waypoint) for pose, waypoint in zip(before, WAYPOINTS)]


def _goal(pose: Pose, waypoint: Tuple[float, float]) -> Pose:
    """The waypoint, with the heading of the line to it."""
    return Pose(*waypoint, math.atan2(waypoint[1] - pose.y_m, waypoint[0] - pose.x_m))


# -- in real time


def _loop(setting: Setting, poses: Sequence[Pose]) -> Mirrored:
    """Sends poses to the mirror at a constant rate, without a robot."""
    first, *others = list(dict.fromkeys(poses))[: LOOP_POSES + 1]
    with closing(Mirrored(setting.robot)) as mirror:
        mirror.send(first, time.monotonic())
        mirror.wait()
        for pose in others:
            mirror.send(pose, time.monotonic())
            time.sleep(1 / LOOP_HZ)
        mirror.wait_for(lambda: others[-1] in mirror.poses[-1:])
    return mirror


def _real(setting: Setting) -> Live:
    """Drives the robot on a port; its true poses are those by odometry."""
    # the robot stops before the slow end of the mirror
    with closing(Mirrored(setting.robot)) as mirror, open_robot(setting) as robot:
        robot.reset_pose(START)
        robot.driver.on_telemetry(lambda each: mirror.send(each.pose, each.stamp_s))
        mirror.wait()
        driven = _drive(robot)
        robot.driver.stop()
        robot.wait(0.5)
        require_end(driven.reached, robot.pose)
    return driven, mirror


def require_end(reached: int, pose: Pose) -> None:
    """Raises MrlError if a robot at this pose has not reached all waypoints."""
    if reached < len(WAYPOINTS):
        raise MrlError(
            f"{reached} of {len(WAYPOINTS)} waypoints were reached, the robot is at {pose}; clear the path"
        )


# -- picture


def _draw(
    setting: Setting, drives: Sequence[StepDrive], blind: Sequence[StepDrive], mirror: Mirrored, live: bool
) -> str:
    made, (floor, late) = plot_style.figure(2, 11.0, 4.6)
    boxes = [wall for solid in world_file.load(WORLD).solids for wall in solid]
    plot_style.draw_walls(floor, boxes, "boxes")
    plot_style.paths(floor, [each.true for each in blind], plot_style.GREY, "true paths without sonars", ":")
    plot_style.paths(floor, [each.true for each in drives], plot_style.BLUE, "true paths")
    if live:
        plot_style.path(floor, mirror.poses, plot_style.ORANGE, "mirror", "--")
    floor.plot(
        *zip(*WAYPOINTS), "s", color=plot_style.GREEN, markersize=7, fillstyle="none", label="waypoints"
    )
    plot_style.floor(floor)
    floor.legend(loc="upper left", fontsize="small")
    late.hist(
        [1000 * delay for delay in mirror.delays_s], bins=40, color=plot_style.SKY, edgecolor=plot_style.BLUE
    )
    late.set(xlabel="delay of the mirror [ms]", ylabel="poses")
    return plot_style.save(made, setting.folder, "step-test")
