"""Teams of which some robots are real and some virtual: the real ones are mirrored into the virtual world.

The real ones stand in one world, with boards of their own; the virtual ones in another one with the same walls, and
mirrors of the real ones by their odometry.  A virtual robot hears the mirrors; a real one hears what its own sonars
hear, and what its mirror would.
"""

import math
from contextlib import ExitStack
from typing import Callable, Dict, Iterator, List, Mapping, NamedTuple, Protocol, Sequence, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.hardware.sonars import HALF_CONE_RAD, RANGE_M
from sim_arduino.world import world_file
from sim_arduino.world.geometry import Footprint
from sim_arduino.world.world import World

from .stage import NOISE, TICK_S, Setting, Step, actor


class Member(NamedTuple):
    """One robot of the team."""

    name: str
    start: Pose
    virtual: bool
    robot: str = "traxbot"


class OnStage(Protocol):
    """A robot as the experiments need it: `stage.Actor` is one, and so is a robot behind topics."""

    @property
    def model(self) -> models.RobotModel:
        """Of the robot."""

    @property
    def pose(self) -> Pose:
        """By its odometry, in the world's frame."""

    @property
    def true_pose(self) -> Pose:
        """Where it really is."""

    @property
    def ranges(self) -> Mapping[str, float]:
        """Ranges of the sonars: name to range [m]."""

    @property
    def bumped(self) -> bool:
        """An obstacle blocks the robot."""

    def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Takes these speeds."""

    def wait(self, seconds: float) -> None:
        """Lets time pass."""

    def seek(self, goal: Pose) -> Callable[[Mapping[str, float]], Step]:
        """A function that takes the robot to a goal, tick by tick."""

    def reset_pose(self, pose: Pose) -> None:
        """Set the pose at which the odometry begins."""


class Player:
    """A robot that plays.

    Attributes:
        virtual: The world with the mirrors of the real robots.
        path: True path.
        told: Path by odometry.
        bumps: Number of ticks in which an obstacle blocked the robot.
    """

    def __init__(self, member: Member, robot: OnStage, virtual_world: World) -> None:
        self.member, self.robot, self.virtual = member, robot, virtual_world
        self.footprint = footprint_of(member)
        self.path: List[Pose] = []
        self.told: List[Pose] = []
        self.bumps = 0
        robot.reset_pose(member.start)
        if not member.virtual:
            virtual_world.place(member.name, member.start, self.footprint)

    def ranges(self) -> Dict[str, float]:
        """Ranges that the robot uses: sonar name to range [m]; NaN if its own sonar has no reading."""
        heard = dict(self.robot.ranges)
        if not self.member.virtual:
            for name, range_m in heard.items():
                if not math.isnan(range_m):
                    heard[name] = min(range_m, self._in_virtual(name))
        return heard

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
        self.told.append(self.robot.pose)


class Team:
    """The players, and the least distance that any two of them had so far."""

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
        """Ticks in which a robot touched another one or a wall."""
        return sum(player.bumps for player in self.players)


def pairs(players: Sequence[Player]) -> Iterator[Tuple[Player, Player]]:
    """Each two of them, once."""
    for index, player in enumerate(players):
        for other in players[index + 1 :]:
            yield player, other


def footprint_of(member: Member) -> Footprint:
    """The robot's body from above."""
    footprint = footprint_for(models.load(member.robot))
    assert footprint is not None
    return footprint


def spelt_pose(pose: Pose) -> str:
    """As the emulator's options take it."""
    return f"{pose.x_m},{pose.y_m},{math.degrees(pose.yaw_rad)}"


def gather(stack: ExitStack, setting: Setting, world: str, members: Sequence[Member]) -> Team:
    """Puts a team into a packaged world, and the mirrors of its real robots into the virtual one."""
    real, virtual = world_file.load(world), world_file.load(world)
    players = []
    for number, member in enumerate(members):
        place = virtual if member.virtual else real
        its = setting._replace(robot=member.robot, seed=setting.seed + number)
        pose = spelt_pose(member.start)
        on_stage = stack.enter_context(actor(its, place, sonar=NOISE, name=member.name, pose=pose))
        players.append(Player(member, on_stage, virtual))
    return Team(players)
