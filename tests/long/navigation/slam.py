"""`python -m tests.long.navigation.slam`: maps of a house by the real gmapping and hector_mapping.

A TraxBot drives through the house by recorded key presses in simulated time, with and without a gyro, with and without
a slip of 10 % in turns.  Its odometry and its scans are replayed to the nodes of slam.launch, with /clock.  Each map's
score goes to build/navigation/slam at once, and a run continues there: delete the folder to begin again.  With KEEP=1
its figures go to docs/figures.
"""

import csv
import itertools
import pathlib
from typing import Any, Callable, Dict, List, NamedTuple, Sequence, Tuple

from mrl_driver.terminal.teleop_keys import HOLD_S, Teleop
from sim_arduino.experiments.experiment_robot import TICK_S, ExperimentRobot, Setting, open_robot
from sim_arduino.hardware.imu import ImuErrors
from sim_arduino.hardware.laser import URG_04LX, LaserScanner
from sim_arduino.hardware.wiring import TRACK_SLIP
from sim_arduino.world import map_score, world_file
from sim_arduino.world.grid_map import GridMap
from sim_arduino.world.world import World
from tests.long.bench import report

from .runs import Runs
from .stack import ROOT, Master, end_with

RUNS = Runs(ROOT / "build" / "navigation" / "slam", "tests.long.navigation.slam", report.either(10, 1))
WORKERS = 2
KEYS = pathlib.Path(__file__).with_name("house_keys.csv")
"""Key presses by sight, made by tests/experiments/record_house_keys.py of the commit 261b5637."""
ROBOT, WORLD = "traxbot", "house"
WANDER = "noise=1e-7,turn_noise=1e-6"
"""Random errors of wheels and turns, by which the runs differ: together 0.5 deg after 10 m and 25 rad."""
PERIOD_MS = 20
SCAN_EVERY = round(1 / URG_04LX.rate_hz / TICK_S)  # ticks
BARS = {"gmapping": (94, 6), "hector": (98, 5)}
"""Least share of the walls that is found, and largest of false cells, after the fit, with a gyro [%]."""


class Condition(NamedTuple):
    """A mapper, and what its robot's odometry is made of."""

    method: str
    gyro: bool
    slip: bool

    @property
    def key(self) -> str:
        return f"{self.method}_{'gyro' if self.gyro else 'wheels'}{'' if self.slip else '_no_slip'}"


CONDITIONS = {
    condition.key: condition
    for condition in itertools.starmap(Condition, itertools.product(BARS, (True, False), (True, False)))
}


class Gripping(ExperimentRobot):
    """A robot without slip, which turns as slowly as one with slip: the presses would lead it into a wall."""

    def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        super().drive(linear_m_s, (1 - TRACK_SLIP) * angular_rad_s)


def measured(condition: Condition, world: World, seed: int) -> List[Tuple[float, Any]]:
    """What the robot measured: telemetry, and ranges of the laser `(rays,)` [m], each with its time [s]."""
    found: List[Tuple[float, Any]] = []
    scanner, ticks = LaserScanner(world, seed=seed), itertools.count(1)
    emulated: Dict[str, Any] = {"slip": condition.slip, "error": WANDER}
    if condition.gyro:
        emulated.update(imu=True, imu_errors=ImuErrors.drawn(seed))
    with open_robot(Setting("", seed=seed), world, period_ms=PERIOD_MS, **emulated) as robot:

        def tick() -> None:
            if next(ticks) % SCAN_EVERY == 0:
                found.append((robot.driver.now_s, scanner.scan(robot.true_pose, "robot")))

        robot.driver.on_telemetry(lambda telemetry: found.append((telemetry.stamp_s, telemetry)))
        driven = robot if condition.slip else Gripping(*robot)
        press_keys(driven, tick)
    return sorted(found, key=lambda each: each[0])


def press_keys(robot: ExperimentRobot, each_tick: Callable[[], None]) -> None:
    """Drive as the recorded keys say, until the last press has ended."""
    with KEYS.open(encoding="utf-8", newline="") as file:
        presses = [(float(row["time_s"]), row["key"]) for row in csv.DictReader(file)]
    teleop, waiting, start_s, now_s = Teleop(), presses[::-1], robot.driver.now_s, 0.0
    while now_s <= presses[-1][0] + HOLD_S:
        while waiting and waiting[-1][0] < now_s + TICK_S / 2:  # the nearest tick, whatever is rounded
            teleop.press(waiting.pop()[1], now_s)
        robot.drive(*teleop.command(now_s))
        robot.wait(TICK_S)
        each_tick()
        now_s = robot.driver.now_s - start_s
    robot.drive(0.0, 0.0)


def scores(made: GridMap, world: World) -> List[float]:
    """Shares [%] of walls that are found, and of false cells, as the map lies; and both after the best fit."""
    fits = world.start, map_score.fitted(made, world, world.start)
    return [100 * share for fit in fits for share in map_score.score(made, world, fit)[:2]]


def drive(condition: Condition) -> None:
    """Make the maps that are missing."""
    world = world_file.load(WORLD)
    with Master(RUNS.folder / condition.key) as master:
        from .mapper import Mapper

        for seed in RUNS.missing(condition.key):
            events = measured(condition, world, seed)
            with Mapper(master, ROBOT, condition.method) as mapper:
                RUNS.add(condition.key, scores(mapper.map_of(events), world))


def figures_of(key: str, results: Sequence[Sequence[float]]) -> Dict[str, report.Measured]:
    """The scores of a condition in all runs."""
    names = ("found", "false", "fit_found", "fit_false")
    return {f"{key}_{name}": values for name, values in zip(names, zip(*results))}


def main(keys: Sequence[str]) -> int:
    """Make the maps of one condition, or of all and show the table; returns the exit code: 1 if a bar is missed."""
    if keys:
        drive(CONDITIONS[keys[0]])
        return 0
    figures: Dict[str, report.Measured] = {}
    for key, results in RUNS.all(list(CONDITIONS), ["gmapping", "hector_mapping"], WORKERS).items():
        figures.update(figures_of(key, results))
    report.conclude("slam", figures)
    missed = False
    for method, (found, false) in BARS.items():
        medians = [
            report.record(figures[f"{method}_gyro_fit_{name}"])["value"] for name in ("found", "false")
        ]
        missed |= medians[0] < found or medians[1] > false
    return int(missed)


if __name__ == "__main__":
    end_with(main)
