"""Robots for the experiments: emulated ones in simulated time, or a real one on a port."""

import time
from contextlib import contextmanager
from typing import Any, Callable, Iterator, Mapping, NamedTuple, Optional, Union

from mrl_driver.apps.calibration import manoeuvres
from mrl_driver.driver import Driver
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.geometry import Pose
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.navigation.line_follower import Course
from mrl_driver.robot.models import Drive, ImuMount, RobotModel
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve import factory
from sim_arduino.world.world import World

TICK_S = 0.05  # behaviours compute new speeds after this time [s]
PERIOD_MS = 50
PATIENCE_S = 900.0  # time limit of a course [s]


class Setting(NamedTuple):
    """Settings of an experiment."""

    folder: str  # folder for pictures and figures
    port: Optional[str] = None  # port of a real robot; None for emulated robots
    robot: str = "traxbot"  # model of the robot
    seed: int = 1  # seed of all random numbers
    ros: bool = False  # run through ROS if the experiment is about ROS
    seeds: int = 0  # number of runs with random numbers of their own; 0 for as many as each experiment has


class Pace:
    """Ticks in real time: each ends its time after the end of the one before, whatever was computed meanwhile."""

    def __init__(self) -> None:
        self._due_s = time.monotonic()

    def rest_s(self, seconds: float) -> float:
        """The time that is left of a tick of `seconds` [s]; 0 if it is over."""
        now_s = time.monotonic()
        self._due_s = max(self._due_s + seconds, now_s)
        return self._due_s - now_s


class ExperimentRobot(NamedTuple):
    """A robot in an experiment."""

    driver: Union[Driver, SteppedDriver]
    plant: Optional[Plant] = None  # hardware of an emulated robot
    pace: Optional[Pace] = None
    """Pace of a real robot in a team whose other robots are emulated; None for a robot alone."""

    @property
    def true_pose(self) -> Pose:
        """True pose of an emulated robot; odometry pose of a real one."""
        return self.plant.true_pose if self.plant else self.driver.pose

    @property
    def pose(self) -> Pose:
        """Pose by odometry."""
        return self.driver.pose

    @property
    def ranges(self) -> Mapping[str, float]:
        """Ranges of the sonars [m]."""
        return self.driver.ranges

    @property
    def model(self) -> RobotModel:
        """Model of the robot."""
        assert self.driver.model is not None
        return self.driver.model

    @property
    def bumped(self) -> bool:
        """Whether an obstacle blocks an emulated robot."""
        return self.plant is not None and self.plant.robot.state.bumped

    def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Commands these speeds."""
        self.driver.drive(linear_m_s, angular_rad_s)

    def wait(self, seconds: float) -> None:
        """Lets time pass."""
        self.driver.wait(self.pace.rest_s(seconds) if self.pace else seconds)

    def seeker(self, goal: Pose) -> GoalSeeker:
        """Drives the robot to a goal."""
        return GoalSeeker(goal, self.model.limits, self.driver.now_s, self.model.sonars)

    def reset_pose(self, pose: Pose) -> None:
        """Sets the pose of the odometry."""
        self.driver.reset_pose(pose)


@contextmanager
def open_robot(
    setting: Setting,
    world: Union[World, str] = "square",
    drive: Optional[Drive] = None,
    period_ms: int = PERIOD_MS,
    command_timeout_s: Optional[float] = 0.5,
    imu_mount: Optional[ImuMount] = None,
    **emulated: Any,
) -> Iterator[ExperimentRobot]:
    """One robot, connected, at the start of a world; `emulated` are options as in `factory.Options`.

    The driver uses `drive` and `imu_mount`, if they are given, instead of the model's.
    """
    options = Options(period_ms=period_ms, command_timeout_s=command_timeout_s)
    if setting.port is not None:
        with Driver(setting.port, setting.robot, options=options) as driver:
            yield ExperimentRobot(driver)
        return
    given = {"robot": setting.robot, "seed": setting.seed, "name": "robot", "world": world, **emulated}
    made = factory.make(factory.Options(**given))
    try:
        model = made.plant.model
        model = model._replace(drive=drive or model.drive, imu=imu_mount or model.imu)
        with SteppedDriver(made.engine, model, options) as stepped:
            yield ExperimentRobot(stepped, made.plant)
    finally:
        made.close()


def follow(robot: ExperimentRobot, course: Course, each_tick: Callable[[], None]) -> None:
    """Drives a course to its end and stops; calls `each_tick` at each tick.  BoardTimeout if it does not arrive."""

    def steer(pose: Pose) -> manoeuvres.Command:
        each_tick()
        speeds = course.command(pose)
        return None if course.done else speeds

    manoeuvres.follow(robot.driver, steer, PATIENCE_S)
    each_tick()
