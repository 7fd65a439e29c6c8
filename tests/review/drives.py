"""Recorded drives of emulated robots in simulated time: as a user drives, with stops, turns, arcs and walls."""

import contextlib
import math
import random
from typing import Any, Callable, Dict, NamedTuple, Tuple

from mrl_driver.driver import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import MrlError
from sim_arduino.serve import factory

STEP_S = 0.1  # Time between two commands of the user [s]
CLOSE_M = 0.35  # The user stops this far from a wall [m]


class Drive(NamedTuple):
    """One drive: the robot, what is wrong with it, and how long it drives.

    `expected` are kinds of findings of which one must come first, none for a good drive; `board` options of the board;
    `options` of the driver; `robot` its model; `host` does what the host does wrong, before each command.
    """

    name: str
    expected: Tuple[str, ...] = ()
    board: Dict[str, Any] = {}
    options: Dict[str, Any] = {}
    robot: Any = "auto"
    host: Callable[["User"], None] = lambda user: None
    duration_s: float = 20.0
    seed: int = 1


class User:
    """Somebody who drives the robot."""

    def __init__(self, robot, drive):
        self.robot, self.drive = robot, drive
        self.rng = random.Random(f"{drive.name} {drive.seed}")
        self._done = set()

    def once(self, name, at_s):
        """Whether it is time for something that happens once."""
        if name in self._done or self.robot.now_s < at_s:
            return False
        self._done.add(name)
        return True

    def course(self):
        """Drives legs, with a look around first, until the time is over."""
        self._wait(1.0)
        while self.robot.now_s < self.drive.duration_s:
            self._leg()
        self.robot.stop()
        self._wait(0.7)

    def _leg(self):
        rng, limits = self.rng, self.robot.model.limits
        speed = limits.linear_m_s * rng.uniform(0.6, 1.0)
        rate = limits.angular_rad_s * rng.uniform(0.6, 0.9)
        self._go(speed, 0.0, rng.uniform(0.5, 1.3) / speed)
        if rng.random() < 0.3:
            self._go(0.7 * speed, rng.choice((-1, 1)) * 0.5 * rate, rng.uniform(1.0, 2.0))
        self._stand()
        if rng.random() < 0.15:
            self._go(-0.5 * speed, 0.0, 1.0)
            self._stand()
        angle = math.radians(rng.uniform(60, 170)) * rng.choice((-1, 1))
        self._go(0.0, math.copysign(rate, angle), abs(angle) / rate)
        self._stand()

    def _stand(self):
        self.robot.stop()
        self._wait(self.rng.uniform(0.4, 0.9))

    def _go(self, linear, angular, seconds):
        robot = self.robot
        end_s = min(robot.now_s + seconds, self.drive.duration_s)
        while robot.now_s < end_s:
            self.drive.host(self)
            if linear > 0 and robot.ranges.get("front", math.inf) < CLOSE_M:
                return
            if not robot.drive(linear, angular) and robot.mismatch is not None:
                self._wait(0.8)
                robot.drive(0.0, 0.0)
            robot.wait(STEP_S)

    def _wait(self, seconds):
        end_s = self.robot.now_s + seconds
        while self.robot.now_s < end_s:
            self.drive.host(self)
            self.robot.wait(min(STEP_S, max(1e-3, end_s - self.robot.now_s)))


def record(drive, path):
    """Drives, and records it to `path`; returns whether the robot touched a wall, where its wheels slip."""
    made = {"robot": "traxbot", "name": "reviewed", "seed": drive.seed, **drive.board}
    emulated = factory.make(factory.Options(**made))
    body, touched = emulated.plant.robot.state, []
    robot = SteppedDriver(emulated.engine, drive.robot, Options(record=path, **drive.options))
    robot.on_telemetry(lambda _: touched.append(True) if body.bumped else None)
    with contextlib.suppress(MrlError):  # the fault ends the drive
        robot.connect()
        User(robot, drive).course()
    with contextlib.suppress(MrlError):
        robot.close()
    emulated.close()
    return bool(touched)
