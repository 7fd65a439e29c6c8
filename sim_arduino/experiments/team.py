"""Teams of which some robots are real and some virtual: the real ones are mirrored into the virtual world.

The real ones stand in one world, with boards of their own; the virtual ones in another one with the same walls, and
mirrors of the real ones by their odometry.  A virtual robot hears the mirrors; a real one hears what its own sonars
hear, and what its mirror would.
"""

import math
from contextlib import ExitStack
from typing import Dict, Iterator, List, NamedTuple, Sequence, Tuple

from mrl_driver import robots

from .. import world_file
from ..bumper import footprint_for
from ..shapes import Footprint, Pose
from ..sonars import HALF_CONE_RAD, RANGE_M
from ..world import World
from .stage import NOISE, TICK_S, Actor, Setting, actor


class Member(NamedTuple):
    """One robot of the team."""

    name: str
    start: Pose
    virtual: bool
    robot: str = "traxbot"


class Player:
    """A robot that plays.

    Attributes:
        path: Where it has truly been.
        bumps: Ticks in which something stood in its way.
    """

    def __init__(self, member: Member, robot: Actor, footprint: Footprint, virtual_world: World) -> None:
        self.member, self.robot = member, robot
        self._footprint, self._virtual = footprint, virtual_world
        self.path: List[Pose] = []
        self.bumps = 0
        robot.reset_pose(member.start)

    @property
    def pose(self) -> Pose:
        """By its odometry, in the world's frame."""
        return Pose(*self.robot.driver.pose)

    def ranges(self) -> Dict[str, float]:
        """What it hears: sonar name to range [m]."""
        heard = dict(self.robot.driver.ranges)
        if not self.member.virtual:
            for name, range_m in heard.items():
                virtual_m = self._in_virtual(name)
                heard[name] = virtual_m if math.isnan(range_m) else min(range_m, virtual_m)
        return heard

    def _in_virtual(self, name: str) -> float:
        """What the mirror's sonar of that name would hear of the other robots [m]."""
        model = self.robot.driver.model
        assert model is not None
        mount = model.sonars[name]
        at = self.pose.beside(mount.x_m, mount.y_m, math.radians(mount.yaw_deg))
        return self._virtual.nearest(at, HALF_CONE_RAD, RANGE_M, self.member.name)

    def step(self, speeds: Tuple[float, float]) -> None:
        """Drives for a tick."""
        self.robot.driver.drive(*speeds)
        self.robot.driver.wait(TICK_S)
        if not self.member.virtual:
            self._virtual.place(self.member.name, self.pose, self._footprint)
        assert self.robot.plant is not None
        self.bumps += self.robot.plant.robot.state.bumped
        self.path.append(self.robot.true_pose)


class Team:
    """The players, and the least distance that any two of them had so far."""

    def __init__(self, players: Sequence[Player]) -> None:
        self.players = players
        self.nearest_m = math.inf

    def tick(self, speeds: Sequence[Tuple[float, float]]) -> None:
        """All drive for a tick."""
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


def gather(stack: ExitStack, setting: Setting, world: str, members: Sequence[Member]) -> Team:
    """Puts a team into a packaged world, and the mirrors of its real robots into the virtual one."""
    real, virtual = world_file.load(world), world_file.load(world)
    players = []
    for number, member in enumerate(members):
        place = virtual if member.virtual else real
        pose = f"{member.start.x_m},{member.start.y_m},{math.degrees(member.start.yaw_rad)}"
        its = setting._replace(robot=member.robot, seed=setting.seed + number)
        on_stage = stack.enter_context(actor(its, place, sonar=NOISE, name=member.name, pose=pose))
        footprint = footprint_for(robots.load(member.robot))
        assert footprint is not None
        players.append(Player(member, on_stage, footprint, virtual))
        virtual.place(member.name, member.start, footprint)
    return Team(players)
