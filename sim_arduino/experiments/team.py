"""Teams of real and virtual robots: the real ones are mirrored into the world of the virtual ones.

The real robots are in one world.  The virtual ones are in another world with the same walls, and with mirrors that are
placed by the odometry of the real robots.  The sonars of a virtual robot measure the mirrors.  A real robot uses the
smaller of two ranges: that of its own sonar, and that of the same sonar on its mirror.
"""

import math
from contextlib import ExitStack
from typing import Callable, Dict, Iterator, List, Mapping, NamedTuple, Protocol, Sequence, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.hardware.sonars import HALF_CONE_RAD, RANGE_M
from sim_arduino.world import world_file
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.world import World

from .experiment_robot import NOISE, TICK_S, Setting, Step, open_robot


class Member(NamedTuple):
    """One robot of the team."""

    name: str
    start: Pose
    virtual: bool
    robot: str = "traxbot"


class RobotInterface(Protocol):
    """The robot interface of the experiments; `ExperimentRobot` has it, and a robot reached through topics."""

    @property
    def model(self) -> models.RobotModel:
        """Model of the robot."""

    @property
    def pose(self) -> Pose:
        """Pose by odometry, in the world's frame."""

    @property
    def true_pose(self) -> Pose:
        """True pose."""

    @property
    def ranges(self) -> Mapping[str, float]:
        """Ranges of the sonars: name to range [m]."""

    @property
    def bumped(self) -> bool:
        """Whether an obstacle blocks the robot."""

    def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Commands these speeds."""

    def wait(self, seconds: float) -> None:
        """Lets time pass."""

    def seek(self, goal: Pose) -> Callable[[Mapping[str, float]], Step]:
        """A function that computes the next step to a goal from the ranges [m]."""

    def reset_pose(self, pose: Pose) -> None:
        """Set the pose at which the odometry begins."""


class Player:
    """A member of the team and its robot.

    Attributes:
        virtual: The world with the mirrors of the real robots.
        path: True path.
        odometry_path: Path by odometry.
        bumps: Number of ticks in which an obstacle blocked the robot.
    """

    def __init__(self, member: Member, robot: RobotInterface, virtual_world: World) -> None:
        self.member, self.robot, self.virtual = member, robot, virtual_world
        self.footprint = footprint_of(member)
        self.path: List[Pose] = []
        self.odometry_path: List[Pose] = []
        self.bumps = 0
        robot.reset_pose(member.start)
        if not member.virtual:
            virtual_world.place(member.name, member.start, self.footprint)

    def ranges(self) -> Dict[str, float]:
        """Ranges that the robot uses: sonar name to range [m]; NaN if its own sonar has no reading."""
        ranges = dict(self.robot.ranges)
        if not self.member.virtual:
            for name, range_m in ranges.items():
                if not math.isnan(range_m):
                    ranges[name] = min(range_m, self._in_virtual(name))
        return ranges

    def _in_virtual(self, name: str) -> float:
        """Range that the mirror's sonar with this name would measure [m]."""
        at = self.robot.pose.compose(*self.robot.model.sonars[name].pose)
        return self.virtual.nearest(at, HALF_CONE_RAD, RANGE_M, self.member.name)

    def step(self, speeds: Tuple[float, float]) -> None:
        """Drives for a tick."""
        self.robot.drive(*speeds)
        self.robot.wait(TICK_S)
        if not self.member.virtual:
            self.virtual.place(self.member.name, self.robot.pose, self.footprint)
        self.bumps += self.robot.bumped
        self.path.append(self.robot.true_pose)
        self.odometry_path.append(self.robot.pose)


class Team:
    """The robots of a team, and the smallest distance between any two of them so far."""

    def __init__(self, players: Sequence[Player]) -> None:
        self.players = players
        self.nearest_m = math.inf

    def tick(self, speeds: Sequence[Tuple[float, float]]) -> None:
        """Drives all robots for a tick."""
        for player, each in zip(self.players, speeds):
            player.step(each)
        for a, b in pairs(self.players):
            gap = math.hypot(a.path[-1].x_m - b.path[-1].x_m, a.path[-1].y_m - b.path[-1].y_m)
            self.nearest_m = min(self.nearest_m, gap)

    @property
    def collisions(self) -> int:
        """Number of ticks in which a robot touched another one or a wall."""
        return sum(player.bumps for player in self.players)


def pairs(players: Sequence[Player]) -> Iterator[Tuple[Player, Player]]:
    """Each pair of robots, once."""
    for index, player in enumerate(players):
        for other in players[index + 1 :]:
            yield player, other


def footprint_of(member: Member) -> Footprint:
    """The robot's body from above."""
    footprint = footprint_for(models.load(member.robot))
    assert footprint is not None
    return footprint


def pose_option(pose: Pose) -> str:
    """The pose in the form of the emulator's option --pose."""
    return f"{pose.x_m},{pose.y_m},{math.degrees(pose.yaw_rad)}"


def gather(stack: ExitStack, setting: Setting, world: str, members: Sequence[Member]) -> Team:
    """Puts a team into a packaged world, and the mirrors of its real robots into the virtual one."""
    real, virtual = world_file.load(world), world_file.load(world)
    players = []
    for number, member in enumerate(members):
        place = virtual if member.virtual else real
        its = setting._replace(robot=member.robot, seed=setting.seed + number)
        pose = pose_option(member.start)
        robot = stack.enter_context(open_robot(its, place, sonar=NOISE, name=member.name, pose=pose))
        players.append(Player(member, robot, virtual))
    return Team(players)
