"""Two real robots and a virtual one wander through one arena; the real ones are mirrored into the virtual world.

Then a real robot whose wheels slip, unknown to its odometry, meets a virtual one.  Its margin grows with the distance
driven.  With a port, the first real robot is the one on that port, and the others are virtual.
"""

import math
import random
from contextlib import ExitStack
from functools import partial
from typing import Callable, List, Mapping, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.navigation.goal_seeker import room
from mrl_driver.robot.models import Limits
from sim_arduino.hardware.mirror import NO_MARGIN, Margin
from sim_arduino.world import world_file

from . import disturbances, plot_style
from .experiment_report import Figure, Measure, Result, figures, over_seeds
from .experiment_robot import TICK_S, Setting
from .team import WORLD, Member, Team, gather

MEMBERS = (
    Member("real1", Pose(-1.2, -1.2, 0.7), virtual=False),
    Member("real2", Pose(1.2, 1.0, -2.0), virtual=False, robot="stingbot"),
    Member("virtual", Pose(1.2, -1.2, 2.2), virtual=True),
)
DURATION_S, CONTROL_S = 300.0, 60.0
"""Duration of a run, and largest duration of one in which the robots do not see each other [s]."""
SLIPPING_S = 120.0  # duration of a run with a robot that slips, and of a run with a robot on a port [s]
CORNER_M, APART_M = 1.3, 0.4
"""Starts of a pair are drawn up to the first distance from the middle of the room, and at least the second from the
line between them [m]."""
AIM_RAD = 0.5  # a robot of a pair starts towards the middle of the room, up to this much off
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
NEAREST = Measure("nearest_m", "smallest distance between two robots' centres", "m", worst=min)
DRIVEN = Measure("distance_m", "distance driven by all robots", "m", lambda team: team.driven_m, min)
DRIFT = Measure("drift_m", "largest distance of a mirror from its robot", "m")
SHARE = 0.5
"""Share of the robot's speed limit: two robots approach each other at twice their speed, and sonars are slow."""


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


def run(setting: Setting, through_ros: Optional[Team] = None) -> Result:
    """Lets the team wander with many seeds, and draws the first run; `through_ros` is one through ROS, in real time."""
    if setting.port is not None:
        with ExitStack() as stack:
            done = wander(gather(stack, setting, MEMBERS), SLIPPING_S)
        rows = [*rows_of([done]), DRIVEN.figure([done])._replace(worst=None)]
        title = f"The robot on {setting.port} and two virtual ones wander in one arena for {SLIPPING_S:g} s"
        return result("mixed-team", title, rows, done, setting, on_port(MEMBERS[0]))
    runs = over_seeds(_wander, setting)
    rows = rows_of(runs, over_seeds(partial(_wander, mirrored=False), setting))
    rows += [*figures((DRIVEN, DRIFT), runs), *_slip_rows(setting), *ros_rows(through_ros)]
    title = f"Two real robots and a virtual one wander in one arena for {DURATION_S:g} s"
    return result("mixed-team", title, rows, runs[0], setting, REMARK)


def on_port(member: Member) -> str:
    """Remark for a run in which a robot on a port is this member."""
    x_m, y_m, yaw_rad = member.start
    return ON_PORT.format(start=f"{x_m:.2f} m, {y_m:.2f} m, {math.degrees(yaw_rad):.0f} deg")


def _slip_rows(setting: Setting) -> List[Figure]:
    """Figures of a pair whose real robot slips, with a margin and without; the control ignores virtual echoes."""
    runs = over_seeds(partial(slipping, margin=Margin()), setting)
    bare = over_seeds(slipping, setting)
    control = over_seeds(partial(slipping, mirrored=False), setting)
    text = f"{disturbances.SLIP:.0%} slip, {SLIPPING_S:g} s"
    nearest, touched = "smallest true distance of the centres", "runs with a contact"
    each_m, others_m = (
        ", ".join(f"{team.truly_nearest_m:.2f}" for team in teams) for teams in (runs, control)
    )

    def true(key: str, what: str) -> Measure:
        return Measure(key, f"{text}{what}: {nearest}", "m", lambda team: team.truly_nearest_m, min)

    return [
        Figure("slip_touched", f"{text}: {touched}", _touched(runs), control=_touched(control)),
        true("slip_nearest_m", "").figure(runs, control),
        Figure("slip_each_m", f"{text}: smallest true distance [m] of each run", each_m, control=others_m),
        Figure("bare_touched", f"{text}, no margin: {touched}", _touched(bare)),
        true("bare_nearest_m", ", no margin").figure(bare),
        DRIFT.figure(runs)._replace(key="slip_drift_m", text=f"{text}: largest drift of the mirror"),
        Measure("beyond_m", f"{text}: largest drift beyond the margin (negative: within)", "m")
        .figure(runs)
        ._replace(key="slip_beyond_m"),
    ]


def _touched(runs: Sequence[Team]) -> str:
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


def slipping(setting: Setting, margin: Margin = NO_MARGIN, mirrored: bool = True) -> Team:
    """A run of a pair whose real robot slips; if not `mirrored`, at most until the first true contact."""
    with ExitStack() as stack:
        team = gather(stack, setting, pair(setting.seed), mirrored, disturbances.SLIP, margin)
        return wander(team, SLIPPING_S, lambda: not mirrored and team.true_touches > 0)


def _wander(setting: Setting, mirrored: bool = True) -> Team:
    """A run of the team; if real and virtual robots do not see each other, at most until the first collision."""
    with ExitStack() as stack:
        team = gather(stack, setting, MEMBERS, mirrored)
        return wander(
            team, DURATION_S if mirrored else CONTROL_S, lambda: not mirrored and team.collisions > 0
        )


def wander(team: Team, duration_s: float, until: Callable[[], bool] = lambda: False) -> Team:
    """Lets a team wander, at most until `until` returns True after a tick."""
    wanderers = [Wanderer(player.robot.model.limits) for player in team.players]
    for _ in range(round(duration_s / TICK_S)):
        team.tick([each.command(player.ranges()) for each, player in zip(wanderers, team.players)])
        if until():
            break
    return team


def rows_of(runs: Sequence[Team], control: Sequence[Team] = ()) -> List[Figure]:
    """Collisions and nearest distances of many runs."""
    collided, others = (
        f"{sum(each.collisions > 0 for each in teams)} of {len(teams)}" for teams in (runs, control)
    )
    beside = others if control else None
    return [
        Figure("collided", "runs with a collision", collided, "", "none", control=beside),
        NEAREST.figure(runs, control),
    ]


def ros_rows(team: Optional[Team]) -> List[Figure]:
    """Figures of a run through ROS, if there was one."""
    if team is None:
        return []
    return [
        Figure("ros_collisions", "through ROS: ticks of 50 ms with a collision", team.collisions, "", "none"),
        Figure("ros_nearest_m", "through ROS: smallest distance between centres", team.nearest_m, "m"),
        Figure("ros_distance_m", "through ROS: distance driven by all robots", team.driven_m, "m"),
    ]


def result(
    name: str, title: str, rows: Sequence[Figure], shown: Team, setting: Setting, remark: str
) -> Result:
    """The result of an experiment with a team, with a picture of the paths of one run."""
    made, (axes,) = plot_style.figure(1, 6.0, 6.0)
    plot_style.draw_walls(axes, world_file.load(WORLD).walls, "walls")
    plot_style.paths(axes, [each.odometry_path for each in shown.players], "#d0d0d0", "by odometry", "-", 4.0)
    for player, colour, line in zip(
        shown.players, (plot_style.BLUE, plot_style.GREEN, plot_style.ORANGE), plot_style.LINES
    ):
        plot_style.path(axes, player.path, colour, f"{player.member.name} ({player.member.robot})", line)
        axes.plot(*player.path[0][:2], "o", color=colour, markersize=5)
    axes.plot([], [], "o", color=plot_style.GREY, markersize=5, label="starts")
    plot_style.floor(axes)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncol=3, fontsize="small")
    return Result(name, title, rows, [plot_style.save(made, setting.folder, name)], remark)
