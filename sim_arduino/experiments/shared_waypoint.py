"""Three robots cycle through waypoints and share one of them: the first to claim it gets it, the others wait.

The robots' lanes meet at the shared waypoint at acute angles.  Robots that drive there side by side do not see each
other, because no sonar looks further to the side than 63 degrees.
"""

import math
from contextlib import ExitStack
from functools import partial
from typing import List, Optional, Sequence, Set

from mrl_driver.geometry import Pose
from mrl_driver.navigation.claims import LATE_S, Claim
from mrl_driver.navigation.waypoint_tour import WaypointTour

from .experiment_report import Figure, Measure, Result, over_seeds
from .experiment_robot import Setting
from .mixed_team import on_port, result, ros_rows
from .team import Member, gather
from .tours import DURATION, Channel, Point, TourDriver, TourRun, drive_tours, exchange, poses_of, tour_rows

SHARED: Point = (1.0, 0.0)
LANE_M, LANES_DEG = 1.7, {"real1": 200.0, "real2": 180.0, "virtual": 160.0}
"""Length of a lane, and direction of each robot's lane as seen from the shared waypoint."""
ROUNDS = 2
TIME_LIMIT_S = 400.0
LATENCY_S = (0.02, 0.3)  # shortest and longest delay of a message [s]: assumed, wireless network
LOSS = 0.3  # share of the messages that are lost in the runs with loss: assumed
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


MEMBERS = tuple(Member(name, home_of(name), name == "virtual") for name in LANES_DEG)


def tour_of(name: str, rounds: int) -> List[Pose]:
    """Waypoints of a robot: in each round the shared one, and the end of its own lane."""
    return rounds * poses_of([SHARED, home_of(name)[:2]])


def shared_of(poses: Sequence[Pose]) -> Set[int]:
    """Places of the shared waypoints in a tour."""
    return set(range(0, len(poses), 2))


def rounds_of(run: TourRun) -> int:
    """Number of rounds that all robots have driven together."""
    return sum(visits // 2 for visits in run.visits)


MEASURES = (
    Measure("rounds", "rounds of all robots", of=rounds_of, worst=min),
    Measure("waited_s", "time that robots waited for claims", "s"),
    DURATION,
)


def run(setting: Setting, through_ros: Optional[TourRun] = None) -> Result:
    """Drives all rounds with many seeds, and draws the first run; `through_ros` is a run through ROS, in real time."""
    name = "shared-waypoint"
    if setting.port is not None:
        done = [drive(setting)]
        title = (
            f"The robot on {setting.port} and two virtual ones with a shared waypoint, {ROUNDS} rounds each"
        )
        return result(name, title, tour_rows(MEASURES, done), done[0].team, setting, on_port(MEMBERS[0]))
    runs, lossy = over_seeds(drive, setting), over_seeds(partial(drive, loss=LOSS), setting)
    rows = tour_rows(MEASURES, runs, over_seeds(partial(drive, claims=False), setting))
    for row in tour_rows(MEASURES, lossy):
        rows.append(row._replace(key=f"lossy_{row.key}", text=f"{LOSS:.0%} of messages lost: {row.text}"))
    if through_ros:
        rows += ros_rows(through_ros.team)
        rows.append(Figure("ros_rounds", "through ROS: rounds of all robots", rounds_of(through_ros)))
    title = f"Three robots with a shared waypoint, {ROUNDS} rounds each"
    return result(name, title, rows, runs[0].team, setting, REMARK)


def drive(setting: Setting, loss: float = 0.0, claims: bool = True) -> TourRun:
    """A run in which robots claim the shared waypoint by messages, of which the share `loss` is lost.

    Without `claims`, each claim is granted at once, until the first collision.
    """
    channel = Channel(LATENCY_S, loss, setting.seed)
    names = [member.name for member in MEMBERS] if claims else []
    claimed = {name: Claim(name, [each for each in names if each != name], -LATE_S) for name in names}
    with ExitStack() as stack:
        team, drivers = gather(stack, setting, MEMBERS), []
        for player in team.players:
            poses = tour_of(player.member.name, ROUNDS)
            tour = WaypointTour(claim=claimed.get(player.member.name), shared=shared_of(poses))
            drivers.append(TourDriver(player, tour, poses, 0.0))
        before = partial(exchange, list(claimed.values()), channel)
        return drive_tours(team, drivers, TIME_LIMIT_S, not claims, before)
