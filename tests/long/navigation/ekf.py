"""`python -m tests.long.navigation.ekf`: poses of the real ekf_localization_node beside the odometry that it gets.

Robots with errors that are drawn from their model's `noise` drive for 100 s in simulated time.  What `robot_node` makes
of their odometry is replayed to the node of ekf.launch, with /clock, as fast as the node follows.  Each robot's errors
go to build/navigation/ekf at once, and a run continues there: delete the folder to begin again.  A run of all takes
about an hour.  With KEEP=1 its figures go to docs/figures.
"""

import itertools
import math
import random
import statistics
from typing import Dict, List, NamedTuple, Sequence, Tuple

from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.robot.covariance import Spread
from mrl_driver.robot.odometry import Wheels
from mrl_driver.robot.robot_state import Telemetry
from tests.consistency import error_squared
from tests.driver.test_covariance import PERIOD_S, Drawn
from tests.long.bench import report

from .runs import Runs
from .stack import ROOT, Master, end_with

ROBOTS = report.either(20, 1)
RUNS = Runs(ROOT / "build" / "navigation" / "ekf", "tests.long.navigation.ekf", ROBOTS)
WORKERS = 4  # filters at a time; each waits for its clock most of the time
SLIP = 0.1  # share of each turn that tracks lose, and their model does not know
DRIVE_S = 98.0  # a way lasts this long; `Drawn` begins and ends it with a rest of 1 s [s]
GAP_S, GAPS_EVERY_S = 0.3, 5.0
LINEAR_M_S, TURN_RAD_S, ARC_RAD_S = 0.2, 0.8, 0.4
RATIO = 1.02
"""Largest median of the filter's errors over those of the odometry."""


class Condition(NamedTuple):
    """Robots of one kind, and what happens to their readings."""

    robot: str
    gyro: bool  # it measures the turns; otherwise the wheels do
    slip: bool  # each turn loses `SLIP`; otherwise a share that is drawn from the model's noise
    gaps: bool  # no reading reaches the driver for `GAP_S`, once in `GAPS_EVERY_S`

    @property
    def key(self) -> str:
        parts = ("gyro" if self.gyro else "wheels", "slip" * self.slip, "gaps" * self.gaps)
        return "_".join((self.robot, *filter(None, parts)))


CONDITIONS = {
    condition.key: condition
    for robot, slips in (("traxbot", (False, True)), ("stingbot", (False,)))
    for condition in (
        Condition(robot, *rest) for rest in itertools.product((True, False), slips, (False, True))
    )
}


class Tracked(Drawn):
    """A robot whose odometry is written down."""

    def __init__(self, condition: Condition, seed: int) -> None:
        super().__init__(condition.robot, seed, condition.gyro, SLIP if condition.slip else None)
        self.messages: List[Telemetry] = []
        rng, count = random.Random(f"gaps {seed}"), int(DRIVE_S / GAPS_EVERY_S) if condition.gaps else 0
        self._gaps_s = [GAPS_EVERY_S * (number + 0.2 + 0.6 * rng.random()) for number in range(count)]

    def step(self) -> None:
        if any(begin_s <= self.time_s < begin_s + GAP_S for begin_s in self._gaps_s):
            self.body.step(PERIOD_S)
            self.time_s += PERIOD_S
            return
        super().step()
        pose, twist, sure = self.odometry.pose, self.odometry.twist, self.odometry.uncertainty
        message = Telemetry(self.time_s, self.time_s, pose, twist, {}, (), Wheels(0, 0), None)
        self.messages.append(message._replace(spread=sure.spread, twist_variances=sure.variances))

    def error(self, pose: Pose, spread: Spread) -> "Error":
        """That of a pose which should be the true one."""
        true = self.body.state
        away = true.x_m - pose.x_m, true.y_m - pose.y_m, wrap_angle(true.yaw_rad - pose.yaw_rad)
        return Error(math.hypot(*away[:2]), abs(away[2]), error_squared(spread, *away))


class Error(NamedTuple):
    """How far a pose is from the true one."""

    m: float
    rad: float
    nees: float  # normalised error squared; its mean is 3 if the covariance is right


def way_of(seed: int) -> List[Tuple[float, float, float]]:
    """Speeds of a robot that drives straight on, in arcs, and turns on the spot [m/s, rad/s], each for so long [s]."""
    rng, left_s, moves = random.Random(f"way {seed}"), DRIVE_S, []
    while left_s > 0:
        side = rng.choice((-1, 1))
        kinds = [
            (LINEAR_M_S, 0.0, 4),
            (0.0, side * TURN_RAD_S, 3),
            (LINEAR_M_S, side * ARC_RAD_S, 4),
            (0, 0, 1),
        ]
        linear, angular, longest_s = rng.choices(kinds, (9, 5, 4, 2))[0]
        seconds = min(rng.uniform(1, longest_s), left_s)
        left_s -= seconds
        moves.append((linear, angular, seconds))
    return moves


def drive(condition: Condition) -> None:
    """Drive the robots that are missing."""
    with Master(RUNS.folder / condition.key) as master:
        from .replay import Filter

        with Filter(master, condition.robot, condition.gyro) as node:
            for seed in RUNS.missing(condition.key):
                robot = Tracked(condition, seed)
                robot.drive(way_of(seed))
                last = robot.messages[-1]
                ends = (last.pose, last.spread), node.replay(robot.messages)
                RUNS.add(condition.key, [robot.error(*end) for end in ends])


def figures_of(key: str, errors: Sequence[Tuple[Error, Error]]) -> Dict[str, float]:
    """Figures of a condition, from the errors of odometry and filter of each robot."""
    odometry, filtered = zip(*errors)
    return {
        f"{key}_odom_cm": 100 * statistics.median(each.m for each in odometry),
        f"{key}_odom_nees": statistics.mean(each.nees for each in odometry),
        f"{key}_ekf_cm": 100 * statistics.median(each.m for each in filtered),
        f"{key}_ekf_nees": statistics.mean(each.nees for each in filtered),
        f"{key}_ratio": statistics.median(after.m / before.m for before, after in errors),
        f"{key}_turn_ratio": statistics.median(after.rad / before.rad for before, after in errors),
    }


def nees_bounds(robots: int, conditions: int) -> Tuple[float, float]:
    """The means of `robots` normalised errors are all within these in 95 % of all tables of so many conditions."""
    degrees = 3 * robots
    spread = 2 / (9 * degrees)  # after Wilson and Hilferty: chi squared of many degrees of freedom
    least = statistics.NormalDist().inv_cdf(0.025 / conditions)
    low, high = (degrees * (1 - spread + z * math.sqrt(spread)) ** 3 for z in (least, -least))
    return low / robots, high / robots


def main(keys: Sequence[str]) -> int:
    """Drive the robots of one condition, or of all and show the table; returns the exit code: 1 if a bar is missed."""
    if keys:
        drive(CONDITIONS[keys[0]])
        return 0
    figures: Dict[str, float] = {}
    for key, results in RUNS.all(list(CONDITIONS), ["robot_localization"], WORKERS).items():
        figures.update(figures_of(key, [(Error(*one), Error(*other)) for one, other in results]))
    report.conclude("ekf", figures)
    low, high = nees_bounds(ROBOTS, len(CONDITIONS))
    missed = [key for key in CONDITIONS if not low <= figures[f"{key}_ekf_nees"] <= high]
    missed += [key for key in CONDITIONS if figures[f"{key}_ratio"] > RATIO]
    print(
        f"bars: NEES {low:.2f} to {high:.2f}, paired ratio up to {RATIO:g}; missed: {', '.join(missed) or 'none'}"
    )
    return int(bool(missed))


if __name__ == "__main__":
    end_with(main)
