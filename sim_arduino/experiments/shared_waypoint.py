"""Three robots cycle through waypoints and share one of them: the first to claim it gets it, the others wait."""

import math
from contextlib import ExitStack
from typing import Callable, Dict, List, Mapping, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose

from .experiment_report import Figure, Result
from .experiment_robot import TICK_S, Setting, Step, require_emulated
from .mixed_team import SIMULATED, WORLD, draw
from .team import Member, Player, Team, gather

Point = Tuple[float, float]
SHARED: Point = (0.0, 0.0)
ROUNDS = 3
TIME_LIMIT_S = 900.0
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

    def ask(self, name: str) -> bool:
        """Claims the waypoint; False while another robot holds it."""
        if self.holder is None:
            self.holder = name
        return self.holder == name

    def release(self, name: str) -> None:
        """Releases the waypoint, if `name` holds it."""
        if self.holder == name:
            self.holder = None


class Cycle:
    """One robot's cycle: the shared waypoint, then its own ones, then again from the start.

    The robot holds the shared waypoint until it has reached the first of its own.
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
        """Selects the next waypoint, or tries the same one again if the path was blocked."""
        self._seek = None
        if not reached:
            return
        if self._next == 1:
            self._claims.release(name)
        self._next = (self._next + 1) % len(self._points)
        self.rounds += self._next == 0


def run(setting: Setting) -> Result:
    """Lets all robots drive their rounds, and draws their paths."""
    require_emulated(setting, "shared-waypoint")
    with ExitStack() as stack:
        return drive_team(setting, gather(stack, setting, WORLD, MEMBERS), ROUNDS, TIME_LIMIT_S)


def drive_team(
    setting: Setting, team: Team, rounds: int, time_limit_s: float, remark: str = SIMULATED
) -> Result:
    """Runs the experiment with an existing team, until each robot has driven its rounds or the time is over."""
    claims = Claims()
    cycles = [Cycle(player, claims, rounds) for player in team.players]
    ticks = 0
    while any(cycle.rounds < rounds for cycle in cycles) and ticks * TICK_S < time_limit_s:
        team.tick([cycle.command() for cycle in cycles])
        ticks += 1
    return _result(setting, team, cycles, ticks * TICK_S, remark)


def _result(setting: Setting, team: Team, cycles: Sequence[Cycle], duration_s: float, remark: str) -> Result:
    rows = [
        Figure("collisions", "ticks of 50 ms with a collision", team.collisions, "", "none"),
        Figure("rounds", "rounds of all robots", sum(cycle.rounds for cycle in cycles)),
        Figure("nearest_m", "smallest distance between two robots' centres", team.nearest_m, "m"),
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
