"""Two real robots and a virtual one wander through one arena; the real ones are mirrored into the virtual world."""

import math
from contextlib import ExitStack
from typing import Mapping, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.navigation.goal_seeker import room
from mrl_driver.robot.models import Limits
from sim_arduino.world import world_file

from . import plot_style
from .experiment_report import Figure, Result
from .experiment_robot import TICK_S, Setting, require_emulated
from .team import Member, Team, gather

MEMBERS = (
    Member("real1", Pose(-1.2, -1.2, 0.7), virtual=False),
    Member("real2", Pose(1.2, 1.0, -2.0), virtual=False, robot="stingbot"),
    Member("virtual", Pose(1.2, -1.2, 2.2), virtual=True),
)
WORLD = "room"
DURATION_S = 300.0
SIMULATED = "In simulated time, without ROS."
NEAR_M, STOP_M, SIDE_M = 0.9, 0.45, 0.5
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


def run(setting: Setting) -> Result:
    """Lets the team wander, and draws its paths."""
    require_emulated(setting, "mixed-team")
    with ExitStack() as stack:
        return drive_team(setting, gather(stack, setting, WORLD, MEMBERS), DURATION_S)


def drive_team(setting: Setting, team: Team, duration_s: float, remark: str = SIMULATED) -> Result:
    """Runs the experiment with an existing team."""
    wanderers = [Wanderer(player.robot.model.limits) for player in team.players]
    for _ in range(round(duration_s / TICK_S)):
        team.tick([each.command(player.ranges()) for each, player in zip(wanderers, team.players)])
    return _result(setting, team, duration_s, remark)


def _result(setting: Setting, team: Team, duration_s: float, remark: str) -> Result:
    driven_m = sum(math.dist(a[:2], b[:2]) for p in team.players for a, b in zip(p.path, p.path[1:]))
    rows = [
        Figure("collisions", "ticks of 50 ms with a collision", team.collisions, "", "none"),
        Figure("nearest_m", "smallest distance between two robots' centres", team.nearest_m, "m"),
        Figure("distance_m", "distance driven by all robots", driven_m, "m"),
        Figure("duration_s", "duration", duration_s, "s"),
    ]
    title = "Two real robots and a virtual one wander in one arena"
    return Result("mixed-team", title, rows, [draw(setting, team, "mixed-team")], remark)


def draw(setting: Setting, team: Team, name: str) -> str:
    """Paths of a team in its world."""
    made, (axes,) = plot_style.figure(1, 6.0, 6.0)
    plot_style.walls(axes, world_file.load(WORLD).walls)
    for index, player in enumerate(team.players):
        plot_style.band(axes, player.odometry_path, "by odometry" if index == 0 else None)
    for player, colour, line in zip(
        team.players, (plot_style.BLUE, plot_style.GREEN, plot_style.ORANGE), plot_style.LINES
    ):
        plot_style.path(axes, player.path, colour, f"{player.member.name} ({player.member.robot})", line)
        axes.plot(*player.path[0][:2], "o", color=colour, markersize=5)
    axes.plot([], [], "o", color=plot_style.GREY, markersize=5, label="starts")
    plot_style.floor(axes)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncol=3, fontsize="small")
    return plot_style.save(made, setting.folder, name)
