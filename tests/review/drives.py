"""Recorded drives of emulated robots in simulated time: as a user drives, with stops, turns, arcs and walls."""

import math
import random
from typing import Any, Callable, Dict, NamedTuple, Tuple

from mrl_driver.driver import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import MrlError
from sim_arduino.serve import factory

STEP_S = 0.1
"""Time between two commands of the user [s]."""
CLOSE_M = 0.35
"""The user stops this far from a wall [m]."""


class Drive(NamedTuple):
    """One drive: the robot, what is wrong with it, and how long it drives."""

    name: str
    expected: Tuple[str, ...] = ()
    """Kinds of findings of which one must come first; empty for a good drive."""
    board: Dict[str, Any] = {}
    """Options of the emulated board, see `factory.Options`."""
    options: Dict[str, Any] = {}
    """Options of the driver."""
    robot: Any = "auto"
    """Robot model of the driver."""
    host: Callable[["User"], None] = lambda user: None
    """What the host does wrong, before each command."""
    duration_s: float = 20.0
    seed: int = 1


class User:
    """Somebody who drives the robot."""

    def __init__(self, robot: SteppedDriver, drive: Drive) -> None:
        self.robot, self.drive = robot, drive
        self.rng = random.Random(f"{drive.name} {drive.seed}")
        self.done: Dict[str, float] = {}
        """When something was done once, by its name."""

    def once(self, name: str, at_s: float) -> bool:
        """Return whether it is time for something that happens once."""
        if name in self.done or self.robot.now_s < at_s:
            return False
        self.done[name] = self.robot.now_s
        return True

    def course(self) -> None:
        """Drive legs, with a look around first, until the time is over."""
        self._wait(1.0)
        while self.robot.now_s < self.drive.duration_s:
            self._leg()
        self.robot.stop()
        self._wait(0.7)

    def _leg(self) -> None:
        robot, rng = self.robot, self.rng
        limits = robot.model.limits if robot.model else None
        assert limits is not None
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

    def _stand(self) -> None:
        self.robot.stop()
        self._wait(self.rng.uniform(0.4, 0.9))

    def _go(self, linear: float, angular: float, seconds: float) -> None:
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

    def _wait(self, seconds: float) -> None:
        end_s = self.robot.now_s + seconds
        while self.robot.now_s < end_s:
            self.drive.host(self)
            self.robot.wait(min(STEP_S, max(1e-3, end_s - self.robot.now_s)))


def record(drive: Drive, path: str) -> bool:
    """Drive, and record it to `path`; return whether the robot touched a wall, where its wheels slip."""
    made = {"robot": "traxbot", "name": "reviewed", "seed": drive.seed, **drive.board}
    emulated = factory.make(factory.Options(**made))
    body, touched = emulated.plant.robot.state, []
    robot = SteppedDriver(emulated.engine, drive.robot, Options(record=path, **drive.options))
    robot.on_telemetry(lambda _: touched.append(True) if body.bumped else None)
    try:
        robot.connect()
        User(robot, drive).course()
    except MrlError:
        pass  # the fault ended the drive
    finally:
        try:
            robot.close()
        except MrlError:
            pass
        emulated.close()
    return bool(touched)
