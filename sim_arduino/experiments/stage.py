"""Robots for the experiments: emulated ones in simulated time, or a real one on a port."""

from contextlib import contextmanager
from typing import Any, Callable, Iterator, Mapping, NamedTuple, Optional, Tuple, Union

from mrl_driver.calibration import manoeuvres
from mrl_driver.driver import Driver
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.navigation.line_follower import Course
from mrl_driver.robot.models import Drive, RobotModel
from mrl_driver.robot.odometry import Pose as OdometryPose
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve import factory
from sim_arduino.world.geometry import Pose
from sim_arduino.world.world import World

TICK_S = 0.05
"""Behaviours are asked for speeds so often [s]."""
PERIOD_MS = 50
NOISE = "noise=0.01"
"""Of all sonars, as `boards.Options` spells it: 1 cm."""
PATIENCE_S = 900.0
"""No course takes longer than this."""


class Setting(NamedTuple):
    """How experiments are run.

    Attributes:
        folder: Gets pictures and figures.
        port: A real robot's; None for emulated ones.
        robot: Model of the robot.
        seed: Of everything that is drawn at random.
        ros: Through ROS, where the experiment is about ROS.
    """

    folder: str
    port: Optional[str] = None
    robot: str = "traxbot"
    seed: int = 1
    ros: bool = False


class Step(NamedTuple):
    """Of a robot on its way to a goal."""

    speeds: Tuple[float, float]
    reached: bool
    blocked: bool


class Actor(NamedTuple):
    """A robot on the stage; `plant` is what an emulated one is made of."""

    driver: Union[Driver, SteppedDriver]
    plant: Optional[Plant] = None

    @property
    def true_pose(self) -> Pose:
        """Where an emulated robot really is; for a real one, what its odometry says."""
        return self.plant.true_pose if self.plant else Pose(*self.driver.pose)

    @property
    def pose(self) -> Pose:
        """By its odometry."""
        return Pose(*self.driver.pose)

    @property
    def ranges(self) -> Mapping[str, float]:
        """What its sonars hear [m]."""
        return self.driver.ranges

    @property
    def model(self) -> RobotModel:
        """Of the robot."""
        assert self.driver.model is not None
        return self.driver.model

    @property
    def bumped(self) -> bool:
        """Something stands in an emulated robot's way."""
        return self.plant is not None and self.plant.robot.state.bumped

    def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Takes these speeds."""
        self.driver.drive(linear_m_s, angular_rad_s)

    def wait(self, seconds: float) -> None:
        """Lets time pass."""
        self.driver.wait(seconds)

    def seek(self, goal: Pose) -> Callable[[Mapping[str, float]], "Step"]:
        """What takes it to a goal, tick by tick: ranges in [m], the next step out."""
        seeker = GoalSeeker(goal, self.model.limits, self.driver.now_s, self.model.sonars)

        def step(ranges: Mapping[str, float]) -> Step:
            speeds = seeker.command(self.pose, ranges, self.driver.now_s)
            return Step(speeds, seeker.reached, seeker.blocked)

        return step

    def reset_pose(self, pose: Pose) -> None:
        """Lets the odometry go on from here."""
        self.driver.reset_pose(OdometryPose(*pose))

    def place(self, pose: Pose) -> None:
        """Puts an emulated robot somewhere else."""
        assert self.plant is not None
        state = self.plant.robot.state
        state.x_m, state.y_m, state.yaw_rad = pose


@contextmanager
def actor(
    setting: Setting,
    world: Union[World, str] = "square",
    drive: Optional[Drive] = None,
    period_ms: int = PERIOD_MS,
    command_timeout_s: Optional[float] = 0.5,
    **emulated: Any,
) -> Iterator[Actor]:
    """One robot, connected, at the start of a world.

    Args:
        drive: What the driver takes for its drive, instead of the model's.
        emulated: Options of `boards.Options`.
    """
    options = Options(period_ms=period_ms, command_timeout_s=command_timeout_s)
    if setting.port is not None:
        with Driver(setting.port, setting.robot, options=options) as driver:
            yield Actor(driver)
        return
    emulated = {"robot": setting.robot, "seed": setting.seed, "name": "robot", **emulated}
    if isinstance(world, World):
        made = factory.make(factory.Options(**emulated), world)
    else:
        made = factory.make(factory.Options(world=world, **emulated))
    try:
        model = made.plant.model if drive is None else made.plant.model._replace(drive=drive)
        with SteppedDriver(made.engine, model, options) as stepped:
            yield Actor(stepped, made.plant)
    finally:
        made.close()


def demand_emulated(setting: Setting, name: str) -> None:
    """Refuses a port where an experiment is about emulated robots.

    Raises:
        ConfigError: a port is given.
    """
    if setting.port is not None:
        raise ConfigError(
            f"experiment {name} runs on emulated robots, got --port {setting.port}; leave it out"
        )


def follow(robot: Actor, course: Course, look: Callable[[], None]) -> None:
    """Drives a course to its end and stands; `look` is called at each tick.

    Raises:
        BoardTimeout: the robot takes no command, or does not arrive.
    """

    def steer(pose: OdometryPose) -> manoeuvres.Command:
        look()
        speeds = course.command(pose)
        return None if course.done else speeds

    manoeuvres.follow(robot.driver, steer, PATIENCE_S)
    look()
