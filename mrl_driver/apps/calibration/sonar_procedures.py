"""Calibrates the sonars' curve.  It drives; `robot.sonar_curve` computes."""

from typing import Callable, Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.robot import sonar_curve
from mrl_driver.robot.models import Drive
from mrl_driver.robot.sonar_curve import Curve

from . import manoeuvres
from .manoeuvres import Speeds, Track

STOP_S, FRESH_S = 1.5, 0.7
"""Duration of a stop in front of the wall, and time after which the readings belong to this stop [s]."""
READINGS, MIN_RANGE_SHARE = 5, 0.7
"""Number of readings at each distance, and smallest plausible range as a share of the distance."""


class SonarPlan(NamedTuple):
    """Distances from the wall at which the robot stops: from `start_m` to `stop_m` in steps of `step_m`."""

    start_m: float = 2.0
    stop_m: float = 0.2
    step_m: float = 0.05

    def distances(self) -> List[float]:
        """All distances [m]; raise ConfigError if they are too few, or do not approach the wall."""
        good = 0.15 <= self.stop_m < self.start_m <= 6.0 and 0.01 <= self.step_m <= 0.5
        count = int((self.start_m - self.stop_m) / self.step_m + 1e-6) + 1 if good else 0
        if count < sonar_curve.LEAST_DISTANCES:
            raise ConfigError(
                f"--start {self.start_m:g} --step {self.step_m:g} --stop {self.stop_m:g} gives {count} distances, "
                f"expected at least {sonar_curve.LEAST_DISTANCES} between 6 m and 0.15 m"
            )
        return [self.start_m - i * self.step_m for i in range(count)]


def approach_wall(
    robot: Driver,
    track: Track,
    distances: Sequence[float],
    speeds: Speeds,
    report: Callable[[str], None],
    keep: Callable[[np.ndarray], None],
) -> None:
    """Drive towards the wall and stop at each distance [m]; the robot starts at the first one.

    After each distance, `keep` gets the rows of the track since the first distance.

    Raises:
        ConfigError: the wall, or another object, is much closer than expected.
    """
    line = robot.pose
    track.begin()
    for number, distance_m in enumerate(distances, 1):
        if number > 1:
            manoeuvres.straight(robot, distances[0] - distance_m, speeds, line)
        report(f"{number} of {len(distances)}: {distance_m:.2f} m")
        _require_free_path(_front_range(robot), distance_m)
        keep(track.so_far())


def require_sonars(robot: Driver) -> None:
    """Raise ConfigError if the robot has no front sonar, without which it would drive blindly."""
    if robot.model is None or "front" not in robot.model.sonars:
        raise ConfigError("this board has no front sonar, expected one: nothing was measured")


def _front_range(robot: Driver) -> float:
    """Median range of the front sonar while the robot stands still [m]; NaN without a reading."""
    readings = []
    for _ in range(READINGS):
        robot.wait(STOP_S / READINGS)
        readings.append(robot.telemetry.ranges.get("front", np.nan) if robot.telemetry else np.nan)
    return float(np.median(readings))


def _require_free_path(range_m: float, distance_m: float) -> None:
    """Refuse to drive on if the wall is much closer than expected; a sonar error cannot be that large."""
    if range_m < MIN_RANGE_SHARE * distance_m:
        raise ConfigError(
            f"the front sonar measures {max(range_m, 0.0):.2f} m, expected about {distance_m:.2f} m to the wall: "
            "measure --start from the sonar to the wall, and clear the path"
        )


def readings_at_stops(rows: np.ndarray, drive: Drive, start_m: float) -> Tuple[List[float], List[float]]:
    """Ranges of the front sonar [m], NaN for none, and distances by odometry [m], for each stop of a track.

    `rows` are those of `Track.end`; the first one is `start_m` away from the wall.
    """
    times_s = rows[:, 0]
    travelled_m = (rows[:, 1:3] - rows[0, 1:3]) @ (drive.right_m_per_count / 2, drive.left_m_per_count / 2)
    moved = np.flatnonzero(np.any(np.diff(rows[:, 1:3], axis=0) != 0, axis=1)) + 1
    edges = [0, *moved.tolist(), len(rows)]
    ranges, distances = [], []
    for begin, end in zip(edges, edges[1:]):
        stopped_s = times_s[begin:end] - times_s[begin]
        if not len(stopped_s) or stopped_s[-1] < STOP_S - 0.2:
            continue
        ranges_here = rows[begin:end, 3][stopped_s >= FRESH_S]
        ranges.append(float(np.median(np.where(np.isfinite(ranges_here), ranges_here, np.nan))))
        distances.append(start_m - float(travelled_m[begin]))
    return ranges, distances


def curve_in_force(robot: Driver) -> Curve:
    """The curve that converts counts to ranges now; ranges of 2013 boards are corrected to the thesis's curve."""
    if not robot.parameters.can_save:
        return sonar_curve.THESIS
    values = robot.parameters.read("sonar_a", "sonar_b", "sonar_c")
    return Curve(*(value / 1e4 for value in values.values()))


def curve_values(curve: Curve) -> Dict[str, int]:
    """The board's parameters for a curve."""
    return {f"sonar_{name}": round(value * 1e4) for name, value in curve.on_wire()._asdict().items()}
