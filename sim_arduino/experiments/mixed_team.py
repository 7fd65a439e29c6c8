"""Two real robots and a virtual one wander through one arena; the real ones are mirrored into the virtual world.

Then a real robot whose wheels slip, unknown to its odometry, meets a virtual one.  Its margin grows with the distance
driven.  With a port, the first real robot is the one on that port, and the others are virtual.
"""

import math
import random
from contextlib import ExitStack
from functools import partial
from typing import Callable, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.navigation.goal_seeker import room
from mrl_driver.robot.models import Limits
from sim_arduino.hardware.mirror import NO_MARGIN, Margin
from sim_arduino.world import world_file

from . import disturbances, plot_style
from .experiment_report import Figure, Result
from .experiment_robot import TICK_S, Setting
from .team import Member, Player, Team, gather
from .trials import figure, over_seeds

MEMBERS = (
    Member("real1", Pose(-1.2, -1.2, 0.7), virtual=False),
    Member("real2", Pose(1.2, 1.0, -2.0), virtual=False, robot="stingbot"),
    Member("virtual", Pose(1.2, -1.2, 2.2), virtual=True),
)
WORLD = "room"
DURATION_S, CONTROL_S = 300.0, 60.0
"""Duration of a run, and largest duration of one in which the robots do not see each other [s]."""
SLIPPING_S = 120.0
"""Duration of a run with a robot that slips, and of a run with a robot on a port [s]."""
CORNER_M, APART_M = 1.3, 0.4
"""Starts of a pair are drawn up to the first distance from the middle of the room, and at least the second from the
line between them [m].
"""
AIM_RAD = 0.5
"""A robot of a pair starts towards the middle of the room, up to this much off."""
REMARK = (
    "In simulated time. Real robots are emulated boards. In the control, real and virtual robots do not see each "
    "other; its runs end with the first collision. Distances to the virtual robot are those of the mirrors. With "
    f"slip, a real robot (wheels slip {disturbances.SLIP:.0%}, unknown to its odometry) and a virtual one start at "
    f"drawn places; distances are those of their true poses, and the margin is {Margin().start_m:g} m and "
    f"{Margin().share:.0%} of the distance driven."
)
ON_PORT = (
    "In real time, one run. The robot on the port starts at {start} of the virtual room, wherever it stands; the "
    "others are virtual. Its own sonars see the real walls. All distances are by odometry."
)
NEAR_M, STOP_M, SIDE_M = 0.9, 0.45, 0.5
SHARE = 0.5
"""Share of the robot's speed limit: two robots approach each other at twice their speed, and sonars are slow."""


class TeamRun(NamedTuple):
    """What came out of one run of a team.

    Attributes:
        collisions: Number of ticks in which a robot touched another one or a wall.
        nearest_m: Smallest distance between the centres of two robots.
        drift_m: Largest distance of a mirror from its real robot.
        beyond_m: Largest distance of a mirror from its real robot beyond its margin; negative if it was always within.
        true_touches: Number of ticks in which two robots touched each other at their true poses.
        truly_nearest_m: Smallest distance between the centres of two robots at their true poses.
    """

    collisions: int
    nearest_m: float
    driven_m: float
    drift_m: float
    beyond_m: float
    true_touches: int
    truly_nearest_m: float
    players: Sequence[Player]


class Wanderer:
    """Drives straight until an obstacle is near, then turns to the side with more room until the path is free.

    It stands still while a sonar has no reading, because an obstacle may be there.
    """

    def __init__(self, limits: Limits) -> None:
        self._linear, self._angular = SHARE * limits.linear_m_s, SHARE * limits.angular_rad_s
        self._side = 0

    def command(self, ranges: Mapping[str, float]) -> Tuple[float, float]:
        """Speeds for the ranges of the sonars [m]."""
        readings = [ranges.get(name, math.nan) for name in ("front", "left", "right")]
        if any(map(math.isnan, readings)):
            return 0.0, 0.0
        front, left, right = map(room, readings)
        free = front > NEAR_M and min(left, right) > SIDE_M
        if free:
            self._side = 0
            return self._linear, 0.0
        if self._side == 0:
            self._side = 1 if left >= right else -1
        share = max(0.0, min(front, left, right) - STOP_M) / NEAR_M
        return min(0.5, share) * self._linear, self._side * self._angular


def run(setting: Setting, through_ros: Optional[TeamRun] = None) -> Result:
    """Lets the team wander with many seeds, and draws the paths of the first run.

    Args:
        through_ros: A run through ROS, in real time.
    """
    if setting.port is not None:
        return _on_port(setting)
    runs = over_seeds(_mirrored, setting)
    rows = rows_of(runs, over_seeds(_blind, setting))
    rows += [
        figure(
            "distance_m", "distance driven by all robots", [each.driven_m for each in runs], "m", worst=min
        ),
        figure(
            "drift_m", "largest distance of a mirror from its robot", [each.drift_m for each in runs], "m"
        ),
        *_slip_rows(setting),
        *ros_rows(through_ros),
    ]
    title = f"Two real robots and a virtual one wander in one arena for {DURATION_S:g} s"
    picture = draw(setting, runs[0].players, "mixed-team", WORLD)
    return Result("mixed-team", title, rows, [picture], REMARK)


def _on_port(setting: Setting) -> Result:
    with ExitStack() as stack:
        done = wander(gather(stack, setting, WORLD, MEMBERS), SLIPPING_S)
    rows = [*rows_of([done], []), Figure("distance_m", "distance driven by all robots", done.driven_m, "m")]
    title = f"The robot on {setting.port} and two virtual ones wander in one arena for {SLIPPING_S:g} s"
    picture = draw(setting, done.players, "mixed-team", WORLD)
    return Result("mixed-team", title, rows, [picture], on_port(MEMBERS[0]))


def on_port(member: Member) -> str:
    """Remark for a run in which a robot on a port is this member."""
    x_m, y_m, yaw_rad = member.start
    return ON_PORT.format(start=f"{x_m:.2f} m, {y_m:.2f} m, {math.degrees(yaw_rad):.0f} deg")


def _slip_rows(setting: Setting) -> List[Figure]:
    """Figures of a pair whose real robot slips, with a margin and without; the control ignores virtual echoes."""
    runs = over_seeds(partial(slipping, margin=Margin()), setting)
    bare = over_seeds(slipping, setting)
    control = over_seeds(partial(slipping, mirrored=False), setting)
    text, nearest = f"{disturbances.SLIP:.0%} slip, {SLIPPING_S:g} s", [each.truly_nearest_m for each in runs]
    others = [each.truly_nearest_m for each in control]
    return [
        Figure("slip_touched", f"{text}: runs with a contact", _touched(runs), control=_touched(control)),
        figure(
            "slip_nearest_m",
            f"{text}: smallest true distance of the centres",
            nearest,
            "m",
            others,
            worst=min,
        ),
        Figure(
            "slip_each_m",
            f"{text}: smallest true distance [m] of each run",
            _each(nearest),
            control=_each(others),
        ),
        Figure("bare_touched", f"{text}, no margin: runs with a contact", _touched(bare)),
        figure(
            "bare_nearest_m",
            f"{text}, no margin: smallest true distance of the centres",
            [each.truly_nearest_m for each in bare],
            "m",
            worst=min,
        ),
        figure("slip_drift_m", f"{text}: largest drift of the mirror", [each.drift_m for each in runs], "m"),
        figure(
            "slip_beyond_m",
            f"{text}: largest drift beyond the margin (negative: within)",
            [each.beyond_m for each in runs],
            "m",
        ),
    ]


def _each(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.2f}" for value in values)


def _touched(runs: Sequence[TeamRun]) -> str:
    return f"{sum(each.true_touches > 0 for each in runs)} of {len(runs)}"


def pair(seed: int) -> Tuple[Member, Member]:
    """A real and a virtual robot on either side of the room, at places that the seed draws, both towards the middle."""
    rng = random.Random(f"pair {seed}")
    members = []
    for name, side, virtual in (("real", -1, False), ("virtual", 1, True)):
        x_m, y_m = side * rng.uniform(APART_M, CORNER_M), rng.uniform(-CORNER_M, CORNER_M)
        yaw_rad = wrap_angle(math.atan2(-y_m, -x_m) + rng.uniform(-AIM_RAD, AIM_RAD))
        members.append(Member(name, Pose(x_m, y_m, yaw_rad), virtual))
    return members[0], members[1]


def slipping(setting: Setting, margin: Margin = NO_MARGIN, mirrored: bool = True) -> TeamRun:
    """A run of a pair whose real robot slips; if not `mirrored`, at most until the first true contact."""
    with ExitStack() as stack:
        team = gather(stack, setting, WORLD, pair(setting.seed), mirrored, disturbances.SLIP, margin)
        return wander(team, SLIPPING_S, lambda: not mirrored and team.true_touches > 0)


def _mirrored(setting: Setting) -> TeamRun:
    with ExitStack() as stack:
        return wander(gather(stack, setting, WORLD, MEMBERS), DURATION_S)


def _blind(setting: Setting) -> TeamRun:
    """A run in which real and virtual robots do not see each other."""
    with ExitStack() as stack:
        team = gather(stack, setting, WORLD, MEMBERS, mirrored=False)
        return wander(team, CONTROL_S, lambda: team.collisions > 0)


def wander(team: Team, duration_s: float, until: Callable[[], bool] = lambda: False) -> TeamRun:
    """Lets a team wander, at most until `until` returns True after a tick."""
    wanderers = [Wanderer(player.robot.model.limits) for player in team.players]
    for _ in range(round(duration_s / TICK_S)):
        team.tick([each.command(player.ranges()) for each, player in zip(wanderers, team.players)])
        if until():
            break
    return outcome(team)


def outcome(team: Team) -> TeamRun:
    """What came out of the run of a team."""
    return TeamRun(
        team.collisions,
        team.nearest_m,
        team.driven_m,
        team.drift_m,
        team.beyond_m,
        team.true_touches,
        team.truly_nearest_m,
        team.players,
    )


def rows_of(runs: Sequence[TeamRun], control: Sequence[TeamRun]) -> List[Figure]:
    """Collisions and nearest distances of many runs."""
    others = _share(control) if control else None
    return [
        Figure("collided", "runs with a collision", _share(runs), "", "none", control=others),
        figure(
            "nearest_m",
            "smallest distance between two robots' centres",
            [each.nearest_m for each in runs],
            "m",
            [each.nearest_m for each in control],
            worst=min,
        ),
    ]


def _share(runs: Sequence[TeamRun]) -> str:
    return f"{sum(each.collisions > 0 for each in runs)} of {len(runs)}"


def ros_rows(run: Optional[TeamRun]) -> List[Figure]:
    """Figures of a run through ROS, if there was one."""
    if run is None:
        return []
    return [
        Figure("ros_collisions", "through ROS: ticks of 50 ms with a collision", run.collisions, "", "none"),
        Figure("ros_nearest_m", "through ROS: smallest distance between centres", run.nearest_m, "m"),
        Figure("ros_distance_m", "through ROS: distance driven by all robots", run.driven_m, "m"),
    ]


def draw(setting: Setting, players: Sequence[Player], name: str, world: str) -> str:
    """Paths of a team in its world."""
    made, (axes,) = plot_style.figure(1, 6.0, 6.0)
    plot_style.walls(axes, world_file.load(world).walls)
    for index, player in enumerate(players):
        plot_style.band(axes, player.odometry_path, "by odometry" if index == 0 else None)
    for player, colour, line in zip(
        players, (plot_style.BLUE, plot_style.GREEN, plot_style.ORANGE), plot_style.LINES
    ):
        plot_style.path(axes, player.path, colour, f"{player.member.name} ({player.member.robot})", line)
        axes.plot(*player.path[0][:2], "o", color=colour, markersize=5)
    axes.plot([], [], "o", color=plot_style.GREY, markersize=5, label="starts")
    plot_style.floor(axes)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncol=3, fontsize="small")
    return plot_style.save(made, setting.folder, name)
