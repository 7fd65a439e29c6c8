"""Teams of real and virtual robots: the real ones are mirrored into the world of the virtual ones.

The real robots are in one world.  The virtual ones are in another world with the same walls, and with mirrors that are
placed by the odometry of the real robots.  The sonars of a virtual robot measure the mirrors.  A real robot uses the
smaller of two ranges: that of its own sonar, and that of the same sonar on its mirror.

Two real robots meet in the real world, all others in the virtual one.  There a robot touches another one if their
bodies overlap, or if one of them is blocked.
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

from . import disturbances
from .experiment_robot import TICK_S, Setting, Step, open_robot


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

    Args:
        world: The world in which the robot can touch others: the real one, or the one with the mirrors.
        virtual_world: The world with the virtual robots and the mirrors of the real ones.
        mirrored: Whether real and virtual robots see each other.

    Attributes:
        virtual: The world with the mirrors of the real robots.
        path: True path.
        odometry_path: Path by odometry.
        bumps: Number of ticks in which the robot touched another one or a wall.
    """

    def __init__(
        self, member: Member, robot: RobotInterface, world: World, virtual_world: World, mirrored: bool = True
    ) -> None:
        self.member, self.robot, self.virtual = member, robot, virtual_world
        self.footprint = footprint_of(member)
        self._world, self._mirrored = world, mirrored
        self.path: List[Pose] = []
        self.odometry_path: List[Pose] = []
        self.bumps = 0
        robot.reset_pose(member.start)
        self._mirror(member.start)

    def ranges(self) -> Dict[str, float]:
        """Ranges that the robot uses: sonar name to range [m]; NaN if its own sonar has no reading."""
        ranges = dict(self.robot.ranges)
        if self._mirrored and not self.member.virtual:
            for name, range_m in ranges.items():
                if not math.isnan(range_m):
                    ranges[name] = min(range_m, self._in_virtual(name))
        return ranges

    def _in_virtual(self, name: str) -> float:
        """Range that the mirror's sonar with this name would measure [m]."""
        at = self.robot.pose.compose(*self.robot.model.sonars[name].pose)
        return self.virtual.nearest(at, HALF_CONE_RAD, RANGE_M, self.member.name)

    def _mirror(self, pose: Pose) -> None:
        """Moves the mirror of a real robot; without `mirrored`, it only shows whether robots touch each other."""
        if not (self.member.virtual and self._mirrored):
            self.virtual.place(self.member.name, pose, self.footprint)

    @property
    def met(self) -> Pose:
        """Pose at which virtual robots meet this one: by odometry if it is real, else the true one."""
        return self.path[-1] if self.member.virtual else self.odometry_path[-1]

    def step(self, speeds: Tuple[float, float]) -> None:
        """Drives for a tick."""
        self.robot.drive(*speeds)
        self.robot.wait(TICK_S)
        self.path.append(self.robot.true_pose)
        self.odometry_path.append(self.robot.pose)
        self._mirror(self.met)
        touching = self._world.touching(self.path[-1], self.footprint, self.member.name)
        self.bumps += bool(touching or self.robot.bumped)


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
            both_real = not (a.member.virtual or b.member.virtual)
            one, other = (a.path[-1], b.path[-1]) if both_real else (a.met, b.met)
            self.nearest_m = min(self.nearest_m, math.dist(one[:2], other[:2]))

    @property
    def collisions(self) -> int:
        """Number of ticks in which a robot touched another one or a wall."""
        return sum(player.bumps for player in self.players)

    @property
    def driven_m(self) -> float:
        """Distance driven by all robots [m]."""
        return sum(math.dist(a[:2], b[:2]) for p in self.players for a, b in zip(p.path, p.path[1:]))

    @property
    def drift_m(self) -> float:
        """Largest distance of a mirror from its real robot [m]."""
        real = [p for p in self.players if not p.member.virtual]
        return max(
            (math.dist(a[:2], b[:2]) for p in real for a, b in zip(p.path, p.odometry_path)), default=0.0
        )


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


def gather(
    stack: ExitStack, setting: Setting, world: str, members: Sequence[Member], mirrored: bool = True
) -> Team:
    """Puts a team into a packaged world, and the mirrors of its real robots into the virtual one.

    The robots are calibrated: their odometry has random errors and the error of placing, and no systematic ones.

    Args:
        mirrored: Whether real and virtual robots see each other.
    """
    real, virtual = world_file.load(world), world_file.load(world)
    seen = virtual if mirrored else world_file.load(world)
    players = []
    for number, member in enumerate(members):
        place = seen if member.virtual else real
        its = setting._replace(robot=member.robot, seed=setting.seed + number)
        pose = pose_option(disturbances.placed(member.start, setting.seed, member.name))
        made = open_robot(
            its, place, name=member.name, pose=pose, error=disturbances.WANDER, sonar=disturbances.SONAR
        )
        robot = stack.enter_context(made)
        players.append(Player(member, robot, virtual if member.virtual else real, virtual, mirrored))
    return Team(players)
