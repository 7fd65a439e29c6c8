"""Three robots cycle through waypoints and share one of them: the first to claim it gets it, the others wait.

The robots' lanes meet at the shared waypoint at acute angles.  Robots that drive there side by side do not see each
other, because no sonar looks further to the side than 63 degrees.
"""

import math
from contextlib import ExitStack
from functools import partial
from typing import Dict, List, NamedTuple, Optional, Sequence, Set

from mrl_driver.geometry import Pose
from mrl_driver.navigation.claims import LATE_S, Claim
from mrl_driver.navigation.waypoint_tour import CLAIMING, DONE, WaypointTour

from .experiment_report import Figure, Result
from .experiment_robot import TICK_S, Setting
from .mixed_team import TeamRun, draw, on_port, outcome, ros_rows, rows_of
from .team import Member, Team, gather
from .tours import Channel, Point, TourDriver, exchange, poses_of
from .trials import figure, over_seeds

WORLD = "room"
SHARED: Point = (1.0, 0.0)
LANE_M, LANES_DEG = 1.7, {"real1": 200.0, "real2": 180.0, "virtual": 160.0}
"""Length of a lane, and direction of each robot's lane as seen from the shared waypoint."""
ROUNDS = 2
TIME_LIMIT_S = 400.0
LATENCY_S = (0.02, 0.3)
"""Shortest and longest delay of a message [s]: assumed, wireless network."""
LOSS = 0.3
"""Share of the messages that are lost in the runs with loss: assumed."""
REMARK = (
    "In simulated time. Real robots are emulated boards; the action server is our own go_to_goal, not move_base. "
    f"Messages take {LATENCY_S[0]:g} to {LATENCY_S[1]:g} s. In the control every claim is granted at once; its runs "
    "end with the first collision."
)


def home_of(name: str) -> Pose:
    """The end of a robot's lane, from where it looks at the shared waypoint."""
    angle = math.radians(LANES_DEG[name])
    at = Pose(*SHARED, angle).compose(LANE_M, 0.0)
    return Pose(at.x_m, at.y_m, angle - math.pi)


MEMBERS = (
    Member("real1", home_of("real1"), virtual=False),
    Member("real2", home_of("real2"), virtual=False),
    Member("virtual", home_of("virtual"), virtual=True),
)


def tour_of(name: str, rounds: int) -> List[Pose]:
    """Waypoints of a robot: in each round the shared one, and the end of its own lane."""
    return rounds * poses_of([SHARED, home_of(name)[:2]])


def shared_of(poses: Sequence[Pose]) -> Set[int]:
    """Places of the shared waypoints in a tour."""
    return set(range(0, len(poses), 2))


class SharedRun(NamedTuple):
    """What came out of one run; `waited_s` is the time that all robots waited for the shared waypoint together."""

    team: TeamRun
    rounds: int
    waited_s: float
    duration_s: float


def run(setting: Setting, through_ros: Optional[SharedRun] = None) -> Result:
    """Lets all robots drive their rounds with many seeds, and draws the paths of the first run.

    Args:
        through_ros: A run through ROS, in real time.
    """
    if setting.port is not None:
        return _on_port(setting)
    runs, lossy = over_seeds(claimed, setting), over_seeds(partial(claimed, loss=LOSS), setting)
    control = over_seeds(granted_at_once, setting)
    rows = rows_of([each.team for each in runs], [each.team for each in control])
    rows += _times(runs)
    for row in rows_of([each.team for each in lossy], []) + _times(lossy):
        rows.append(row._replace(key=f"lossy_{row.key}", text=f"{LOSS:.0%} of messages lost: {row.text}"))
    if through_ros:
        rows += ros_rows(through_ros.team)
        rows.append(Figure("ros_rounds", "through ROS: rounds of all robots", through_ros.rounds))
    picture = draw(setting, runs[0].team.players, "shared-waypoint", WORLD)
    title = f"Three robots with a shared waypoint, {ROUNDS} rounds each"
    return Result("shared-waypoint", title, rows, [picture], REMARK)


def _on_port(setting: Setting) -> Result:
    done = claimed(setting)
    picture = draw(setting, done.team.players, "shared-waypoint", WORLD)
    title = f"The robot on {setting.port} and two virtual ones with a shared waypoint, {ROUNDS} rounds each"
    rows = rows_of([done.team], []) + _times([done])
    return Result("shared-waypoint", title, rows, [picture], on_port(MEMBERS[0]))


def _times(runs: Sequence[SharedRun]) -> List[Figure]:
    return [
        figure("rounds", "rounds of all robots", [each.rounds for each in runs], worst=min),
        figure("waited_s", "time that robots waited for claims", [each.waited_s for each in runs], "s"),
        figure("duration_s", "duration", [each.duration_s for each in runs], "s"),
    ]


def claimed(setting: Setting, loss: float = 0.0) -> SharedRun:
    """A run in which robots claim the shared waypoint by messages."""
    channel = Channel(LATENCY_S, loss, setting.seed)
    names = [member.name for member in MEMBERS]
    claims = {name: Claim(name, [each for each in names if each != name], -LATE_S) for name in names}
    with ExitStack() as stack:
        return _drive(gather(stack, setting, WORLD, MEMBERS), claims, channel)


def granted_at_once(setting: Setting) -> SharedRun:
    """A run in which every claim is granted at once, until the first collision."""
    with ExitStack() as stack:
        return _drive(gather(stack, setting, WORLD, MEMBERS), {}, Channel(LATENCY_S, 0.0, setting.seed))


def _drive(team: Team, claims: Dict[str, Claim], channel: Channel) -> SharedRun:
    """Runs until each robot has driven its rounds; without claims at most until the first collision."""
    drivers = []
    for player in team.players:
        poses = tour_of(player.member.name, ROUNDS)
        tour = WaypointTour(claim=claims.get(player.member.name), shared=shared_of(poses))
        drivers.append(TourDriver(player, tour, poses, 0.0))
    now_s, waited_s = 0.0, 0.0
    while any(d.tour.state != DONE for d in drivers) and now_s < TIME_LIMIT_S:
        exchange(list(claims.values()), channel, now_s)
        team.tick([driver.command(now_s) for driver in drivers])
        waited_s += TICK_S * sum(driver.tour.state == CLAIMING for driver in drivers)
        now_s += TICK_S
        if team.collisions and not claims:
            break
    return SharedRun(outcome(team), sum(d.tour.idleness.visits // 2 for d in drivers), waited_s, now_s)
