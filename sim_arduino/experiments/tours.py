"""Robots of a team that drive tours of waypoints, and the messages between them."""

import heapq
import math
import random
from typing import Any, Callable, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.navigation.claims import Claim, ClaimMessage
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.navigation.waypoint_tour import CLAIMING, DONE, Target, WaypointTour

from .experiment_report import Figure, Measure, figures
from .experiment_robot import TICK_S
from .mixed_team import rows_of
from .team import Player, Team

Point = Tuple[float, float]
DURATION = Measure("duration_s", "duration", "s")


def poses_of(points: Sequence[Point]) -> List[Pose]:
    """Waypoints with the direction from the one before; the first follows the last."""
    before = [points[-1], *points[:-1]]
    return [Pose(*b, math.atan2(b[1] - a[1], b[0] - a[0])) for a, b in zip(before, points)]


class Channel:
    """Messages that arrive late, perhaps after later ones, or not at all: `loss` is the share of those that are lost.

    Each delay from the smallest to the largest `latency_s` [s] is equally likely.
    """

    def __init__(self, latency_s: Tuple[float, float], loss: float, seed: int) -> None:
        self._latency_s, self._loss = latency_s, loss
        self._rng = random.Random(f"channel {seed}")
        self._under_way: List[Tuple[float, int, str]] = []
        self._sent = 0

    def send(self, text: str, now_s: float) -> None:
        """Sends a text to all robots."""
        due_s = now_s + self._rng.uniform(*self._latency_s)
        self._sent += 1
        if self._rng.random() >= self._loss:
            heapq.heappush(self._under_way, (due_s, self._sent, text))

    def arrived(self, now_s: float) -> List[str]:
        """The texts that have arrived since the last call."""
        texts = []
        while self._under_way and self._under_way[0][0] <= now_s:
            texts.append(heapq.heappop(self._under_way)[2])
        return texts


def exchange(claims: Sequence[Claim], channel: Channel, now_s: float) -> None:
    """Sends the messages of all robots that are due, and passes on those that have arrived."""
    for claim in claims:
        for message in claim.messages(now_s):
            channel.send(message.text, now_s)
    for text in channel.arrived(now_s):
        for claim in claims:
            claim.receive(ClaimMessage.parse(text), now_s)


class TourDriver:
    """Drives a robot from waypoint to waypoint of its tour, by odometry and sonars."""

    def __init__(self, player: Player, tour: WaypointTour, poses: Sequence[Pose], now_s: float) -> None:
        self.player, self.tour = player, tour
        self._poses = poses
        self._target: Optional[Target] = None
        self._seeker: Optional[GoalSeeker] = None
        tour.begin(len(poses), now_s)

    def command(self, now_s: float) -> Tuple[float, float]:
        """Speeds for the next tick; zero while the tour has no target."""
        self.tour.tick(now_s)
        target = self.tour.target
        if target is None:
            self._target = None
            return 0.0, 0.0
        robot = self.player.robot
        if self._seeker is None or target != self._target:
            self._target, self._seeker = target, robot.seeker(self._poses[target.place])
        speeds = self._seeker.command(robot.pose, self.player.ranges(), robot.driver.now_s)
        if self._seeker.reached:
            self.tour.reached(target.attempt, now_s)
        elif self._seeker.blocked:
            self.tour.failed(target.attempt, "the path is blocked")
        return (0.0, 0.0) if self._seeker.reached or self._seeker.blocked else speeds


class TourRun(NamedTuple):
    """What came out of tours."""

    team: Team
    visits: Sequence[int]  # number of waypoints that each robot has reached
    waited_s: float  # time that all robots waited for claims together [s]
    duration_s: float
    arrived: int  # number of robots that finished their tour


def tour_rows(measures: Sequence[Measure], runs: Sequence[Any], control: Sequence[Any] = ()) -> List[Figure]:
    """Figures of tours, and of their teams next to those of the control."""
    teams, others = ([each.team for each in some] for some in (runs, control))
    return [*rows_of(teams, others), *figures(measures, runs)]


def drive_tours(
    team: Team,
    drivers: Sequence[TourDriver],
    limit_s: float,
    crash_ends: bool,
    before: Callable[[float], None],
    after: Callable[[float], None] = lambda now_s: None,
) -> TourRun:
    """Drives until all robots have finished their tours, at most for a time, or until the first collision.

    `before` and `after` are called with the time [s] before and after each tick.
    """
    now_s = waited_s = 0.0
    while any(driver.tour.state != DONE for driver in drivers) and now_s < limit_s:
        before(now_s)
        team.tick([driver.command(now_s) for driver in drivers])
        after(now_s)
        waited_s += TICK_S * sum(driver.tour.state == CLAIMING for driver in drivers)
        now_s += TICK_S
        if team.collisions and crash_ends:
            break
    arrived = sum(driver.tour.state == DONE for driver in drivers)
    return TourRun(team, [driver.tour.idleness.visits for driver in drivers], waited_s, now_s, arrived)
