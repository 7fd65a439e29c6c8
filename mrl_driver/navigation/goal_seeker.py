"""Drives to a pose around obstacles seen by the sonars.  No I/O: pose, ranges and time go in, speeds come out.

The robot turns towards the goal, drives, and turns to the goal's yaw.  Sonar readings are drawn into a grid.  If the
straight path is blocked, the robot follows the cheapest free path in the grid.  It slows down near obstacles, and turns
on the spot if an obstacle ahead is closer than `STOP_M`.
"""

import math
from collections import deque
from typing import Deque, Dict, List, Mapping, Optional, Tuple

from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.robot.models import Limits, SonarMount, cycle_s
from mrl_driver.robot.sonar import FARTHEST_M

from .occupancy_grid import FloorMap, Point

Speeds = Tuple[float, float]

ARRIVED_M, ALIGNED_RAD = 0.03, math.radians(3.0)
# Front range below which the robot slows down, front range below which it only turns, and distance that it keeps to
# each side [m].
NEAR_M, STOP_M, SIDE_M = 0.55, 0.25, 0.16
SLOW_BESIDE_M = 0.3
"""With an obstacle closer than this on one side, the robot drives at half speed, to see more of it [m]."""
TURN_FIRST_RAD = 0.5  # if the yaw error is larger than this, the robot turns on the spot
HEADING_GAIN = 2.0
SLOWING_M = 0.5
SLOWEST_M_S, SLOWEST_RAD_S = 0.03, 0.15  # at lower speeds the motors may not turn at all
# With an obstacle closer than `TIGHT_M` on one side, the robot's corners have no room to turn on the spot.  It first
# goes back by `RETREAT_M`, if its own trail passes within `BESIDE_TRAIL_M` of that place.
TIGHT_M, RETREAT_M, BESIDE_TRAIL_M = 0.2, 0.2, 0.05
STRIDE_M, TRAIL = 0.03, 20
AHEAD_M = 0.4
"""The robot steers for the farthest point of its path within this distance that it can reach in a straight line [m]."""
REPLAN_S, AGAIN_S = 0.5, 2.0
"""Time between two path searches while the straight path is blocked, and after a search without a result [s]."""
# Give up when the robot has not come this much closer to the goal, or turned further to its yaw, for this long, unless
# the caller says otherwise.
PROGRESS_M, PATIENCE_S = 0.1, 60.0
SECTORS_DEG = ((20.0, 110.0), (-20.0, 20.0), (-110.0, -20.0))
"""Left, front and right of the robot, as directions of sonars."""
BLIND_S = 1.0
"""The robot stops if a sonar has given no valid reading for this time [s], or for three rounds of its sonars."""


class GoalSeeker:
    """Drives to one goal (x, y, yaw) in the frame of the poses; `sonars` may be added to their mapping later.

    The goal counts as blocked after `patience_s` without progress, or when the robot has turned by `look_rad` on the
    spot in search of a free path; without end, it waits for obstacles that go away.
    """

    def __init__(
        self,
        goal: Pose,
        limits: Limits,
        now_s: float,
        sonars: Mapping[str, SonarMount],
        patience_s: float = PATIENCE_S,
        look_rad: float = math.inf,
    ) -> None:
        self._goal, self._limits, self._patience_s = goal, limits, patience_s
        self._sonars, self._map = sonars, FloorMap(sonars)
        self._valid_s: Dict[str, float] = {}
        self._path: List[Point] = []
        self._planned_s = -math.inf
        self._trail: Deque[Point] = deque(maxlen=TRAIL)
        self._retreat: Optional[Point] = None
        self._there = self._enclosed = False
        self._look_rad, self._looked_rad, self._yaw_rad = look_rad, 0.0, math.nan
        self._best_m, self._best_rad, self._best_s = math.inf, math.inf, now_s
        self.reached = self.blocked = False
        self.blind: Tuple[str, ...] = ()
        """Sonars without a valid reading for `BLIND_S`; the robot stands still until they have one."""

    def command(self, pose: Pose, ranges: Mapping[str, float], now_s: float) -> Speeds:
        """Return the speeds (linear [m/s], angular [rad/s]) at a pose.

        `ranges` maps the name of each sonar to its range [m] (REP 117), NaN for a silent one.  A sonar that never
        appeared in it counts as not present.
        """
        pose = Pose(*pose)
        away_m = math.hypot(self._goal[0] - pose[0], self._goal[1] - pose[1])
        self._there = self._there or away_m < ARRIVED_M
        self._watch_progress(away_m, abs(wrap_angle(self._goal[2] - pose[2])), now_s)
        if self.blocked:
            return 0.0, 0.0
        if self._there:
            return self._align(pose)
        self._map.follow(pose, ranges, now_s)
        self._find_blind(ranges, now_s)
        if self.blind:
            return 0.0, 0.0
        if self._retreats(pose):
            return -self._forward(0.4), 0.0
        target = self._target(pose, now_s)
        if target is None:
            return self._look_round(pose)
        self._looked_rad, self._yaw_rad = 0.0, math.nan
        return self._approach(pose, target, away_m)

    def _look_round(self, pose: Pose) -> Speeds:
        """Turn on the spot until the sonars find a free path, or have seen enough."""
        if not math.isnan(self._yaw_rad):
            self._looked_rad += abs(wrap_angle(pose[2] - self._yaw_rad))
        self._yaw_rad = pose[2]
        self.blocked = self._enclosed = self._looked_rad > self._look_rad
        return 0.0, 0.0 if self.blocked else 0.5 * self._limits.angular_rad_s

    def _find_blind(self, ranges: Mapping[str, float], now_s: float) -> None:
        for name, range_m in ranges.items():
            if name not in self._valid_s or not math.isnan(range_m):
                self._valid_s[name] = now_s
        blind_s = max(BLIND_S, 3 * cycle_s(self._sonars))
        self.blind = tuple(name for name, valid_s in self._valid_s.items() if now_s - valid_s > blind_s)

    @property
    def why(self) -> str:
        """Why the goal is blocked."""
        if self._there:
            return f"it is there, but has not turned further to the goal's yaw for {self._patience_s:g} s"
        if self.blind:
            return f"no valid reading of sonar {', '.join(self.blind)}: check its cable"
        if self._enclosed:
            return f"the sonars leave no free path, {self._best_m:.1f} m away"
        no_path = "" if self._path or self._map.empty else ", and the sonars leave no free path"
        return f"{self._best_m:.1f} m away it came no closer for {self._patience_s:g} s{no_path}"

    def _watch_progress(self, away_m: float, error_rad: float, now_s: float) -> None:
        if self._there and error_rad < self._best_rad - ALIGNED_RAD:
            self._best_rad, self._best_s = error_rad, now_s
        elif not self._there and away_m < self._best_m - PROGRESS_M:
            self._best_m, self._best_s = away_m, now_s
        elif now_s - self._best_s > self._patience_s:
            self.blocked = True

    def _align(self, pose: Pose) -> Speeds:
        error = wrap_angle(self._goal[2] - pose[2])
        if abs(error) < ALIGNED_RAD:
            self.reached = True
            return 0.0, 0.0
        return 0.0, self._turn(error)

    def _target(self, pose: Pose, now_s: float) -> Optional[Point]:
        """Return the point to steer for; None if the grid has no free path."""
        here, goal = (pose[0], pose[1]), (self._goal[0], self._goal[1])
        if self._map.empty or self._map.is_free(here, goal):
            self._path, self._planned_s = [], -math.inf
            return goal
        if now_s - self._planned_s > (REPLAN_S if self._path else AGAIN_S):
            self._planned_s = now_s
            self._path = self._map.path(here, goal) or []
        return self._ahead(here)

    def _ahead(self, here: Point) -> Optional[Point]:
        """Return the farthest point of the path within `AHEAD_M` that is free in a straight line."""
        if not self._path:
            return None
        nearest = min(range(len(self._path)), key=lambda k: _away_m(here, self._path[k]))
        self._path = self._path[nearest:]
        found = self._path[min(2, len(self._path) - 1)]
        for point in self._path:
            if _away_m(here, point) > AHEAD_M or not self._map.is_free(here, point):
                break
            found = point
        return found

    def _free_m(self, sector_deg: Tuple[float, float]) -> float:
        """Return the free distance ahead of the sonars that look into a sector."""
        low, high = sector_deg
        names = (name for name, mount in self._sonars.items() if low <= mount.yaw_deg <= high)
        return min((room(self._map.drawn.get(name, (math.nan,))[0]) for name in names), default=FARTHEST_M)

    def _approach(self, pose: Pose, target: Point, away_m: float) -> Speeds:
        left, front, right = (self._free_m(sector_deg) for sector_deg in SECTORS_DEG)
        error = wrap_angle(math.atan2(target[1] - pose[1], target[0] - pose[0]) - pose[2])
        if abs(error) > TURN_FIRST_RAD:
            if min(left, right) < TIGHT_M and self._came_from_behind(pose, RETREAT_M):
                self._retreat = pose[0], pose[1]
            return 0.0, self._turn(error)
        if front < STOP_M:
            return 0.0, math.copysign(
                0.6 * self._limits.angular_rad_s, error if abs(error) > 0.1 else left - right
            )
        share = min(1.0, away_m / SLOWING_M, max(0.0, front - STOP_M) / (NEAR_M - STOP_M)) * math.cos(error)
        if min(left, right) < SLOW_BESIDE_M:
            share *= 0.5
        push = max(0.0, SIDE_M - right) - max(0.0, SIDE_M - left)  # away from an obstacle that is too near
        return self._forward(share), self._bounded(
            HEADING_GAIN * error + 4.0 * self._limits.angular_rad_s * push
        )

    def _retreats(self, pose: Pose) -> bool:
        """Return whether the robot must go back from an obstacle; extend the trail, also while it still rolls on."""
        here = pose[0], pose[1]
        if all(_away_m(here, point) > STRIDE_M for point in self._trail):
            self._trail.append(here)
        if self._retreat is not None:
            if _away_m(here, self._retreat) < RETREAT_M and self._came_from_behind(pose, RETREAT_M / 2):
                return True
            self._retreat = None
            self._trail.clear()
        return False

    def _came_from_behind(self, pose: Pose, distance_m: float) -> bool:
        behind = pose.compose(-distance_m, 0.0)[:2]
        return any(_away_m(behind, point) < BESIDE_TRAIL_M for point in self._trail)

    def _forward(self, share: float) -> float:
        return min(self._limits.linear_m_s, max(SLOWEST_M_S, self._limits.linear_m_s * share))

    def _turn(self, error: float) -> float:
        return math.copysign(self._bounded(max(SLOWEST_RAD_S, HEADING_GAIN * abs(error))), error)

    def _bounded(self, rate: float) -> float:
        return max(-self._limits.angular_rad_s, min(self._limits.angular_rad_s, rate))


def _away_m(one: Point, other: Point) -> float:
    return math.hypot(other[0] - one[0], other[1] - one[1])


def room(range_m: float) -> float:
    """Return the free distance ahead of a sonar [m]: 0 if too near, its full range if it has no reading."""
    if math.isnan(range_m):
        return FARTHEST_M
    return min(FARTHEST_M, max(0.0, range_m))
