"""Teams of real and virtual robots: the real ones are mirrored into the world of the virtual ones.

The real robots are in one world.  The virtual ones are in another world with the same walls, and with mirrors that are
placed by the odometry of the real robots.  The sonars of a virtual robot measure the mirrors.  A real robot uses the
smaller of two ranges: that of its own sonar, and that of the same sonar on its mirror, which sees robots and no walls.

Two real robots meet in the real world, all others in the virtual one.  There a robot touches another one if their
bodies overlap, or if one of them is blocked.  "Truly" they touch if their bodies overlap at their true poses: the place
of a virtual robot is then a place on the real floor.
"""

import math
from contextlib import ExitStack
from functools import partial
from itertools import combinations
from typing import Any, ContextManager, Dict, List, NamedTuple, Sequence, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.hardware.mirror import NO_MARGIN, Margin, Mirror
from sim_arduino.world import world_file
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.world import World

from . import disturbances
from .experiment_robot import TICK_S, ExperimentRobot, Pace, Setting, open_robot

WORLD = "room"  # the packaged world of all teams


class Member(NamedTuple):
    """One robot of the team."""

    name: str
    start: Pose
    virtual: bool
    robot: str = "traxbot"


class Player:
    """A member of the team and its robot: an `ExperimentRobot`, or one reached through topics with the same attributes.

    In `world` the robot can touch others: it is the real one, or the virtual one with the mirrors of the real robots.
    If `mirrored`, real and virtual robots see each other.

    Attributes:
        path, odometry_path: True path, and path by odometry.
        bumps: Number of ticks in which the robot touched another one or a wall.
        beyond_m: Largest distance so far of the mirror from the robot, beyond its margin.
    """

    def __init__(
        self,
        member: Member,
        robot: Any,
        world: World,
        virtual_world: World,
        mirrored: bool = True,
        margin: Margin = NO_MARGIN,
    ) -> None:
        self.member, self.robot, self.virtual = member, robot, virtual_world
        self.footprint = footprint_of(member)
        self._world, self._mirrored = world, mirrored
        self._mirror = Mirror(virtual_world.without_walls(), member.name, self.footprint, margin=margin)
        self.path: List[Pose] = []
        self.odometry_path: List[Pose] = []
        self.bumps, self.beyond_m = 0, -math.inf
        robot.reset_pose(member.start)
        self._show(member.start)

    def ranges(self) -> Dict[str, float]:
        """Ranges that the robot uses: sonar name to range [m]; NaN if its own sonar has no reading."""
        ranges = dict(self.robot.ranges)
        if not self._mirrored or self.member.virtual:
            return ranges
        sonars = self.robot.model.sonars
        return {name: self._mirror.closer(range_m, sonars[name]) for name, range_m in ranges.items()}

    def _show(self, pose: Pose) -> None:
        """Moves the mirror of a real robot; without `mirrored`, it only shows whether robots touch each other."""
        if not (self.member.virtual and self._mirrored):
            self._mirror.moved(*pose)

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
        self._show(self.met)
        drift_m = math.dist(self.path[-1][:2], self.odometry_path[-1][:2])
        self.beyond_m = max(self.beyond_m, drift_m - self._mirror.margin_m)
        touching = self._world.touching(self.path[-1], self.footprint, self.member.name)
        self.bumps += bool(touching or self.robot.bumped)


class Team:
    """The robots of a team, and what came out of their run so far.

    Attributes:
        nearest_m: Smallest distance between the centres of two robots.
        truly_nearest_m: The same by their true poses.
        true_touches: Number of ticks in which two robots truly touched each other.
    """

    def __init__(self, players: Sequence[Player]) -> None:
        self.players = players
        self.nearest_m = self.truly_nearest_m = math.inf
        self.true_touches = 0

    def tick(self, speeds: Sequence[Tuple[float, float]]) -> None:
        """Drives all robots for a tick."""
        for player, each in zip(self.players, speeds):
            player.step(each)
        for a, b in combinations(self.players, 2):
            both_real = not (a.member.virtual or b.member.virtual)
            one, other = (a.path[-1], b.path[-1]) if both_real else (a.met, b.met)
            self.nearest_m = min(self.nearest_m, math.dist(one[:2], other[:2]))
            truly_m = math.dist(a.path[-1][:2], b.path[-1][:2])
            self.truly_nearest_m = min(self.truly_nearest_m, truly_m)
            self.true_touches += truly_m < a.footprint.radius_m + b.footprint.radius_m and _overlap(a, b)

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

    @property
    def beyond_m(self) -> float:
        """Largest distance of a mirror from its real robot beyond its margin [m]; negative if it was always within."""
        return max((p.beyond_m for p in self.players if not p.member.virtual), default=-math.inf)


def _overlap(a: Player, b: Player) -> bool:
    """Whether the bodies of two robots overlap at their true poses."""
    sides = b.footprint.outline(b.path[-1]) + b.footprint.inside(b.path[-1])
    return any(map(partial(a.footprint.touches, a.path[-1]), sides))


def footprint_of(member: Member) -> Footprint:
    """The robot's body from above."""
    footprint = footprint_for(models.load(member.robot))
    assert footprint is not None
    return footprint


def _emulated(
    setting: Setting, member: Member, number: int, place: World, slip: float = 0.0
) -> ContextManager[ExperimentRobot]:
    its = setting._replace(robot=member.robot, seed=setting.seed + number)
    pose = world_file.pose_text(disturbances.placed(member.start, setting.seed, member.name))
    error = disturbances.wander(slip)
    return open_robot(its, place, name=member.name, pose=pose, error=error, sonar=disturbances.SONAR)


def _with_port(stack: ExitStack, setting: Setting, members: Sequence[Member]) -> Team:
    """A team of the robot on the port and virtual ones, which keep pace with it.

    The port's robot is the first member.  Its true pose is not known: its odometry stands for it.
    """
    virtual, alone = world_file.load(WORLD), setting._replace(port=None)
    first, others = members[0]._replace(robot=setting.robot), members[1:]
    robot = stack.enter_context(open_robot(setting, virtual))._replace(pace=Pace())
    if not robot.model.sonars:
        raise ConfigError(f"the robot on {setting.port} has no sonars, expected one that sees other robots")
    players = [Player(first, robot, virtual.without_walls(), virtual, margin=Margin())]
    for number, member in enumerate(others, 1):
        made = _emulated(alone, member, number, virtual)
        players.append(Player(member._replace(virtual=True), stack.enter_context(made), virtual, virtual))
    return Team(players)


def gather(
    stack: ExitStack,
    setting: Setting,
    members: Sequence[Member],
    mirrored: bool = True,
    slip: float = 0.0,
    margin: Margin = NO_MARGIN,
) -> Team:
    """Puts a team into its world, and the mirrors of its real robots into the virtual one.

    The robots are calibrated: their odometry has random errors and the error of placing, and no systematic ones but
    `slip`, the share by which the wheels of real robots slip.  If `mirrored`, real and virtual robots see each other.
    ConfigError if a robot on a port has no sonars.
    """
    if setting.port is not None:
        return _with_port(stack, setting, members)
    real, virtual = world_file.load(WORLD), world_file.load(WORLD)
    seen = virtual if mirrored else world_file.load(WORLD)
    players = []
    for number, member in enumerate(members):
        place = seen if member.virtual else real
        made = _emulated(setting, member, number, place, 0.0 if member.virtual else slip)
        robot = stack.enter_context(made)
        players.append(Player(member, robot, virtual if member.virtual else real, virtual, mirrored, margin))
    return Team(players)
