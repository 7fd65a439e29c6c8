"""Three robots cycle through waypoints, one of which they share: who claims it first gets it, the others wait."""

import math
from contextlib import ExitStack
from typing import Callable, Dict, List, Mapping, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose

from .mixed_team import SIMULATED, WORLD, draw
from .report import Figure, Result
from .stage import TICK_S, Setting, Step, require_emulated
from .team import Member, Player, Team, gather

Point = Tuple[float, float]
SHARED: Point = (0.0, 0.0)
ROUNDS = 3
MOST_S = 900.0
MEMBERS = (
    Member("real1", Pose(-1.4, -1.4, math.pi / 4), virtual=False),
    Member("real2", Pose(1.4, 1.4, -3 * math.pi / 4), virtual=False, robot="stingbot"),
    Member("virtual", Pose(1.4, -1.4, 3 * math.pi / 4), virtual=True),
)
OWN: Dict[str, Sequence[Point]] = {
    "real1": ((-1.4, -0.3), (-1.4, -1.4)),
    "real2": ((1.4, 0.5), (1.4, 1.4)),
    "virtual": ((0.4, -1.4), (1.4, -1.4)),
}
"""Waypoints of each robot, after the shared one."""


class Claims:
    """The holder of the shared waypoint."""

    def __init__(self) -> None:
        self.holder: Optional[str] = None
        self.waits = 0

    def ask(self, name: str) -> bool:
        """Claims it; False while another one has it."""
        if self.holder is None:
            self.holder = name
        return self.holder == name

    def release(self, name: str) -> None:
        """Gives it back, if `name` has it."""
        if self.holder == name:
            self.holder = None


class Cycle:
    """One robot's way: the shared waypoint, its own ones, and again.

    It holds the shared one until it has reached the first of its own.
    """

    def __init__(self, player: Player, claims: Claims, rounds: int) -> None:
        self._player, self._claims, self._most = player, claims, rounds
        self._points: List[Point] = [SHARED, *OWN[player.member.name]]
        self._next, self.rounds = 0, 0
        self._seek: Optional[Callable[[Mapping[str, float]], Step]] = None
        self.waited_s = 0.0

    def command(self) -> Tuple[float, float]:
        """Speeds for the next tick."""
        if self.rounds == self._most:
            return 0.0, 0.0
        name = self._player.member.name
        if self._seek is None:
            if self._next == 0 and not self._claims.ask(name):
                self.waited_s += TICK_S
                return 0.0, 0.0
            self._seek = self._begin(self._points[self._next])
        step = self._seek(self._player.ranges())
        if step.reached or step.blocked:
            self._arrive(name, step.reached)
            return 0.0, 0.0
        return step.speeds

    def _begin(self, point: Point) -> Callable[[Mapping[str, float]], Step]:
        pose = self._player.robot.pose
        heading = math.atan2(point[1] - pose.y_m, point[0] - pose.x_m)
        return self._player.robot.seek(Pose(*point, heading))

    def _arrive(self, name: str, reached: bool) -> None:
        """On to the next waypoint, or, from a way that was blocked, another try."""
        self._seek = None
        if not reached:
            return
        if self._next == 1:
            self._claims.release(name)
        self._next = (self._next + 1) % len(self._points)
        self.rounds += self._next == 0


def run(setting: Setting) -> Result:
    """Lets all robots do their rounds, and draws where they have been."""
    require_emulated(setting, "shared-waypoint")
    with ExitStack() as stack:
        return play(setting, gather(stack, setting, WORLD, MEMBERS), ROUNDS, MOST_S)


def play(setting: Setting, team: Team, rounds: int, most_s: float, remark: str = SIMULATED) -> Result:
    """The same with a team that is there: so many rounds of each robot, if they are done in time."""
    claims = Claims()
    cycles = [Cycle(player, claims, rounds) for player in team.players]
    ticks = 0
    while any(cycle.rounds < rounds for cycle in cycles) and ticks * TICK_S < most_s:
        team.tick([cycle.command() for cycle in cycles])
        ticks += 1
    return _result(setting, team, cycles, ticks * TICK_S, remark)


def _result(setting: Setting, team: Team, cycles: Sequence[Cycle], duration_s: float, remark: str) -> Result:
    rows = [
        Figure("collisions", "ticks of 50 ms with a collision", team.collisions, "", "none"),
        Figure("rounds", "rounds of all robots", sum(cycle.rounds for cycle in cycles)),
        Figure("nearest_m", "least distance of two middles", team.nearest_m, "m"),
        Figure(
            "waited_s",
            "time that robots waited for the shared waypoint",
            sum(c.waited_s for c in cycles),
            "s",
        ),
        Figure("duration_s", "duration", duration_s, "s"),
    ]
    title = "Three robots with a shared waypoint"
    return Result("shared-waypoint", title, rows, [draw(setting, team, "shared-waypoint")], remark)
