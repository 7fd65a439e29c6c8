"""Robots visit the same waypoints again and again: how long is each one not visited, with one robot and with three?

Idleness as in Machado et al. 2002.  A team divides the waypoints among its robots.  In the control of one robot, it
drives to the waypoints in random order; in that of the team, each robot drives a tour of all waypoints.
"""

import math
import random
from contextlib import ExitStack
from functools import partial
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence

from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.navigation.waypoint_tour import Idleness, WaypointTour

from .experiment_report import Figure, Measure, Result, figures, over_seeds
from .experiment_robot import TICK_S, Setting
from .mixed_team import result, rows_of
from .team import Member, Team, gather
from .tours import Point, TourDriver, poses_of

DURATION_S = 80.0
POINTS: Sequence[Point] = ((-1.0, -0.9), (0.0, -0.9), (1.0, -0.9), (1.0, 0.9), (0.0, 0.9), (-1.0, 0.9))
"""The waypoints in the order of one robot's round, before the seed moves them."""
MOVED_M = 0.2  # the seed moves each waypoint by at most this, along each axis
SHARES: Dict[str, Sequence[int]] = {"robot1": (0, 1), "robot2": (2, 3), "robot3": (4, 5)}
"""Places in `POINTS` of each robot's waypoints, when three robots divide them."""
NEAR_M = 0.25  # a visit counts if the robot is truly this near to the waypoint
MEASURES = (
    Measure("mean_s", "mean idleness", "s"),
    Measure("worst_s", "worst idleness", "s"),
    Measure("visits", "visits", worst=min),
    Measure("off_m", "largest true distance from a waypoint at its visit", "m"),
)
ORDERS = 200  # length of a random order; longer than any run
REMARK = (
    "In simulated time, on emulated boards. The seed draws where the waypoints are and where robots begin. Idleness is "
    "the time since the last visit of a waypoint (Machado et al. 2002); the mean is that of all waypoints and of the "
    "whole run. In the control of one robot it chooses the next waypoint at random, which any order beats; in "
    "that of the team each robot drives a tour of all waypoints, and nothing is divided."
)


class Beat(NamedTuple):
    """A robot of the patrol."""

    member: Member
    order: Sequence[int]  # places of the waypoints in the order of its visits, again and again
    points: Sequence[Point]  # all waypoints of the patrol

    @property
    def poses(self) -> List[Pose]:
        """The waypoints in the order of its visits."""
        return poses_of([self.points[place] for place in self.order])


def drawn_points(seed: int) -> List[Point]:
    """The waypoints of a seed."""
    rng = random.Random(f"patrol {seed}")
    return [(x + rng.uniform(-MOVED_M, MOVED_M), y + rng.uniform(-MOVED_M, MOVED_M)) for x, y in POINTS]


def one(seed: int) -> List[Beat]:
    """One robot that visits all waypoints."""
    return [_beat("robot1", range(len(POINTS)), seed)]


def one_at_random(seed: int) -> List[Beat]:
    """One robot that visits all waypoints in random order."""
    (beat,) = one(seed)
    return [beat._replace(order=_random_order(beat.order[-1], random.Random(f"patrol order {seed}")))]


def three(seed: int) -> List[Beat]:
    """Three robots that divide the waypoints."""
    return [_beat(name, places, seed) for name, places in SHARES.items()]


def three_alone(seed: int) -> List[Beat]:
    """Three robots, each of which drives a tour of all waypoints; they start as those that divide them."""
    count = len(POINTS)
    return [
        beat._replace(order=[(beat.order[-1] + 1 + i) % count for i in range(count)]) for beat in three(seed)
    ]


def _beat(name: str, places: Sequence[int], seed: int) -> Beat:
    """A robot that starts at one of its waypoints, drawn by the seed."""
    first = random.Random(f"patrol {seed} {name}").randrange(len(places))
    beat = Beat(Member(name, ORIGIN, virtual=False), [*places[first:], *places[:first]], drawn_points(seed))
    return beat._replace(member=beat.member._replace(start=beat.poses[-1]))


def _random_order(place: int, rng: random.Random) -> List[int]:
    """Places at random, none twice in a row, from a start."""
    order = [place]
    while len(order) <= ORDERS:
        order.append((order[-1] + rng.randrange(1, len(POINTS))) % len(POINTS))
    return order[1:]


class Visits:
    """Counts the visits of a patrol.

    Attributes:
        idleness: Idleness of all waypoints.
        off_m: Largest true distance from a waypoint that a robot has reached by odometry.
        team, visits, mean_s, worst_s: The team, and number of visits and idleness [s], after the end.
    """

    def __init__(self, beats: Sequence[Beat]) -> None:
        self._beats, self._seen = beats, [0] * len(beats)
        self.idleness, self.off_m = Idleness(len(POINTS), 0.0), 0.0

    def update(self, index: int, visits: int, true_pose: Pose, now_s: float) -> None:
        """A robot is at this pose, and has reached this number of waypoints."""
        if visits <= self._seen[index]:
            return
        _, order, points = self._beats[index]
        place = order[self._seen[index] % len(order)]
        self._seen[index] += 1
        off_m = math.dist(true_pose[:2], points[place])
        self.off_m = max(self.off_m, off_m)
        if off_m < NEAR_M:
            self.idleness.visit(place, now_s)

    def end(self, team: Team, now_s: float) -> "Visits":
        """Ends the patrol; returns the object itself."""
        found = self.idleness
        self.team, self.visits = team, found.visits
        self.mean_s, self.worst_s = found.mean_s(now_s), found.worst_s(now_s)
        return self


def run(setting: Setting, through_ros: Optional[Visits] = None) -> Result:
    """Patrols with many seeds, and draws the team's first run; `through_ros` is one through ROS, in real time."""
    rows: List[Figure] = []
    for key, title, beats, others in (
        ("one", "one robot", one, one_at_random),
        ("team", "three robots", three, three_alone),
    ):
        runs = over_seeds(partial(patrolled, beats_of=beats), setting)
        control = over_seeds(partial(patrolled, beats_of=others), setting)
        rows += _rows(key, title, runs, control)
    if through_ros:
        rows += [
            Figure("ros_mean_s", "three robots through ROS: mean idleness", through_ros.mean_s, "s"),
            Figure("ros_worst_s", "three robots through ROS: worst idleness", through_ros.worst_s, "s"),
        ]
    title = f"Patrol of {len(POINTS)} waypoints for {DURATION_S:g} s, by one robot and by three"
    return result("patrol", title, rows, runs[0].team, setting, REMARK)


def _rows(key: str, title: str, runs: Sequence[Visits], control: Sequence[Visits]) -> List[Figure]:
    collided = rows_of([each.team for each in runs], [each.team for each in control])[0]
    rows = [*figures(MEASURES, runs, control), collided._replace(published="")]
    return [row._replace(key=f"{key}_{row.key}", text=f"{title}: {row.text}") for row in rows]


def patrolled(setting: Setting, beats_of: Callable[[int], List[Beat]]) -> Visits:
    """A run with the robots that `beats_of` returns for a seed."""
    beats = beats_of(setting.seed)
    visits = Visits(beats)
    with ExitStack() as stack:
        team = gather(stack, setting, [beat.member for beat in beats])
        drivers = [
            TourDriver(player, WaypointTour(repeat=True), beat.poses, 0.0)
            for player, beat in zip(team.players, beats)
        ]
        for tick in range(round(DURATION_S / TICK_S)):
            team.tick([driver.command(tick * TICK_S) for driver in drivers])
            for index, driver in enumerate(drivers):
                visits.update(index, driver.tour.idleness.visits, driver.player.path[-1], tick * TICK_S)
        return visits.end(team, DURATION_S)
