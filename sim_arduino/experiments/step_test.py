"""Drives from point to point over a grid, avoiding obstacles, with a live mirror in another process."""

import json
import math
import os
import subprocess
import sys
import threading
import time
from typing import Callable, Dict, List, NamedTuple, Tuple

from mrl_driver.driver import Driver
from mrl_driver.driver.options import Options
from mrl_driver.errors import MrlError
from mrl_driver.geometry import Pose
from mrl_driver.navigation.goal_seeker import GoalSeeker
from sim_arduino.testing import EmulatedBoard
from sim_arduino.world.shared_robots import SharedRegistry

from . import plot_style
from .experiment_report import Figure, Result
from .experiment_robot import PERIOD_MS, TICK_S, Setting

WAYPOINTS = ((0.4, 0.0), (0.4, 0.4), (0.8, 0.4), (0.8, 0.8), (1.2, 0.8), (1.2, 1.2))
TIME_LIMIT_S = 120.0
SIMPLE = "In real time, without ROS."
REACHED = "Goals count as reached within 3 cm."
POLL_S = 0.001
START_S = 10.0
"""The mirror's process must start within this time."""


class StepRecord(NamedTuple):
    """Poses by odometry, true poses, poses of the mirror, and the mirror's delays [s]."""

    odometry: List[Tuple[float, ...]]
    true: List[Tuple[float, ...]]
    mirrored: List[Tuple[float, ...]]
    delays_s: List[float]


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
        end_s = time.monotonic() + START_S
        while not self.poses and time.monotonic() < end_s:
            time.sleep(0.05)
        self.delays_s.clear()

    def close(self) -> None:
        """Ends the process."""
        self._ending = True
        self._thread.join()
        self._process.terminate()
        self._process.communicate()
        self._registry.close()


def run(setting: Setting) -> Result:
    """Drives the steps in real time, and draws robot and mirror."""
    return outcome(setting, _real(setting) if setting.port is not None else _emulated(setting), SIMPLE)


def outcome(setting: Setting, drive: StepRecord, remark: str) -> Result:
    """Figures and picture of a drive.

    Raises:
        MrlError: the mirror showed no pose.
    """
    delays = sorted(1000 * delay for delay in drive.delays_s)
    if not delays:
        raise MrlError("the mirror showed no pose; check that the folder of shared worlds has free space")
    end = drive.true[-1]
    error_mm = 1000 * math.hypot(end[0] - WAYPOINTS[-1][0], end[1] - WAYPOINTS[-1][1])
    rows = [
        Figure(
            "mirror_delay_ms_median",
            "delay of the mirror, median",
            delays[len(delays) // 2],
            "ms",
            "below 1 s",
        ),
        Figure("mirror_delay_ms_max", "delay of the mirror, largest", delays[-1], "ms", "below 1 s"),
        Figure("end_error_mm", "distance of the true end from the last waypoint", error_mm, "mm"),
    ]
    title = "Steps over a 400 x 400 mm grid, mirrored live"
    return Result("step-test", title, rows, [_draw(setting, drive)], f"{remark} {REACHED}")


def _emulated(setting: Setting) -> StepRecord:
    with EmulatedBoard(robot=setting.robot, world="square", seed=setting.seed) as board:
        return _drive(setting, board.port, lambda _: tuple(board.true_pose))


def _real(setting: Setting) -> StepRecord:
    assert setting.port is not None
    return _drive(setting, setting.port, lambda driver: tuple(driver.pose))


def _drive(setting: Setting, port: str, truth: Callable[[Driver], Tuple[float, ...]]) -> StepRecord:
    driven = StepRecord([], [], [], [])

    def add_poses(driver: Driver) -> None:
        driven.odometry.append(driver.pose)
        driven.true.append(truth(driver))

    mirror = Mirrored(setting.robot)
    try:  # stop the robot before the slow end of the mirror
        with Driver(port, setting.robot, options=Options(period_ms=PERIOD_MS)) as driver:
            driver.on_telemetry(lambda each: mirror.send(tuple(each.pose), each.stamp_s))
            mirror.wait()
            for waypoint in WAYPOINTS:
                _go(driver, waypoint, add_poses)
            driver.stop()
            driver.wait(0.5)
    finally:
        mirror.close()
    return driven._replace(mirrored=mirror.poses, delays_s=mirror.delays_s)


def _go(driver: Driver, waypoint: Tuple[float, float], after_step: Callable[[Driver], None]) -> None:
    assert driver.model is not None
    heading = math.atan2(waypoint[1] - driver.pose.y_m, waypoint[0] - driver.pose.x_m)
    seeker = GoalSeeker(Pose(*waypoint, heading), driver.model.limits, driver.now_s, driver.model.sonars)
    end_s = driver.now_s + TIME_LIMIT_S
    while not seeker.reached:
        if seeker.blocked or driver.now_s > end_s:
            raise MrlError(
                f"waypoint {waypoint} was not reached, the robot is at {driver.pose}; clear the path"
            )
        driver.drive(*seeker.command(driver.pose, driver.ranges, driver.now_s))
        driver.wait(TICK_S)
        after_step(driver)


def _draw(setting: Setting, drive: StepRecord) -> str:
    made, (floor, late) = plot_style.figure(2, 9.0, 4.6)
    plot_style.path(floor, drive.true, plot_style.BLUE, "true path")
    plot_style.path(floor, drive.mirrored, plot_style.ORANGE, "mirror", "--")
    floor.plot(
        *zip(*WAYPOINTS), "s", color=plot_style.GREEN, markersize=7, fillstyle="none", label="waypoints"
    )
    plot_style.floor(floor)
    floor.legend(loc="upper left", fontsize="small")
    late.hist(
        [1000 * delay for delay in drive.delays_s], bins=40, color=plot_style.SKY, edgecolor=plot_style.BLUE
    )
    late.set(xlabel="delay of the mirror [ms]", ylabel="poses")
    return plot_style.save(made, setting.folder, "step-test")
