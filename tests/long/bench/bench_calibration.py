"""Calibrates random emulated robots through the driver, in simulated time; build/bench/calibration.json.

Each robot hides wheel, axle and slip errors and is calibrated by two straight runs and UMBmark with two laps each way;
then a 1 m square is driven each way round.  One more robot is noisy: its calibration finds how much, and the normalised
estimation error squared of 100 drives tells whether the uncertainty is right.
"""

import math
import random
from typing import Dict, List, Tuple

import numpy as np

from mrl_driver.apps.calibration import fit, geometry_procedures, manoeuvres
from mrl_driver.apps.calibration.ground_truth import Truth
from mrl_driver.apps.calibration.manoeuvres import Speeds, Track
from mrl_driver.apps.calibration.trial import Trial, errors
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import RobotModel, load
from sim_arduino.serve import factory
from tests.consistency import error_squared

from . import report

ROBOTS = report.either(20, 1)
END_CM, END_DEG = 1.0, 0.5
PERIOD_MS = 100
DRIVES, RUNS = report.either((100, (20, 20, 10)), (1, (2, 2, 2)))
SIDE_M = report.either(1.0, 0.3)
NOISY = "slip=0.05,wheel_ratio=1.002,noise=2e-5,turn_noise=2e-4"
WINDING = ((0.5, 1.0), (0.4, -2.0), (0.3, 0.7))  # Way ahead [m] and turn then [rad]
_SPEEDS = Speeds()
Runs = List[Trial]


class Emulated:
    """A new robot with these errors, which stands in an endless empty room."""

    def __init__(self, model: RobotModel, hidden: str, seed: int = 0) -> None:
        options = factory.Options(robot=model.name, footprint="none", error=hidden, seed=seed)
        self._made = factory.make(options)
        self._driver = SteppedDriver(self._made.engine, model, Options(period_ms=PERIOD_MS))
        self._driver.connect()
        self._track = Track(self._driver)

    def drive(self, legs: List[geometry_procedures.Leg]) -> Runs:
        runs: Runs = []
        ruler = Truth(lambda: Pose(*self._made.plant.true_pose))
        geometry_procedures.gather(self._driver, legs, ruler, runs.append, self._track)
        return runs

    def error_squared(self) -> float:
        """Normalised estimation error squared at the end of a winding drive, by the driver's odometry."""
        driver = self._driver
        for way_m, turn_rad in WINDING:
            manoeuvres.straight(driver, way_m, _SPEEDS)
            manoeuvres.turn(driver, turn_rad, _SPEEDS)
        off = np.subtract(self._made.plant.true_pose, driver.pose)
        off[2] = math.remainder(off[2], math.tau)
        assert driver.telemetry is not None
        return error_squared(driver.telemetry.spread, *off)


def hidden_errors(rng: random.Random) -> str:
    """Errors of the size that puts a square some 8-10 cm off."""
    return (
        f"wheel_ratio={rng.uniform(0.996, 1.004):.5f},wheel_size={rng.uniform(0.98, 1.02):.5f},"
        f"axle={rng.uniform(0.99, 1.01):.5f},slip={rng.uniform(0.0, 0.015):.5f}"
    )


def calibrate(hidden: str) -> Tuple[np.ndarray, np.ndarray, float]:
    """Errors (2, 3) of the odometry after a square each way round before and after, and how far from its start the
    calibrated robot ended, at most [m].
    """
    plain = load("traxbot")
    model = plain
    robot = Emulated(model, hidden)
    runs = robot.drive(geometry_procedures.straight_legs(2, 2 * SIDE_M, _SPEEDS))
    model = model._replace(
        drive=geometry_procedures.evaluate(geometry_procedures.STRAIGHT, runs, model).after
    )
    laps = robot.drive(geometry_procedures.umbmark_legs(2, SIDE_M, _SPEEDS))
    model = model._replace(drive=geometry_procedures.evaluate(geometry_procedures.UMBMARK, laps, model).after)
    tried = Emulated(model, hidden).drive(geometry_procedures.umbmark_legs(1, SIDE_M, _SPEEDS))
    missed_m = max(math.hypot(run.end.x_m, run.end.y_m) for run in tried)
    return errors(plain.drive, [laps[0], laps[-1]]), errors(model.drive, tried), missed_m


def consistency() -> float:
    """Mean of the normalised estimation error squared of `DRIVES` drives, after a calibration of the noise too."""
    model, runs = load("traxbot"), []
    robot = Emulated(model, NOISY)
    for procedure, legs in (
        (geometry_procedures.STRAIGHT, geometry_procedures.straight_legs(RUNS[0], 1.0, _SPEEDS)),
        (geometry_procedures.TURN, geometry_procedures.turn_legs(RUNS[1], 1, _SPEEDS)),
        (geometry_procedures.UMBMARK, geometry_procedures.umbmark_legs(RUNS[2], 0.5, _SPEEDS)),
    ):
        new = robot.drive(legs)
        found = geometry_procedures.evaluate(procedure, new, model, fit.BY_TRUTH, runs)
        model = model._replace(drive=found.after, noise=model.noise._replace(**found.noise))
        runs += new
    print(f"noise {model.noise}, {model.drive}")
    return float(np.mean([Emulated(model, NOISY, 1 + seed).error_squared() for seed in range(DRIVES)]))


def figures() -> Dict[str, report.Measured]:
    """Calibrates `ROBOTS` robots, one line each."""
    rng, rows = random.Random(7), []
    for _ in range(ROBOTS):
        hidden = hidden_errors(rng)
        before, after, missed_m = calibrate(hidden)
        before_cm, after_cm = (100 * float(np.hypot(*each[:, :2].T).max()) for each in (before, after))
        rows.append((before_cm, after_cm, math.degrees(np.abs(after[:, 2]).max()), 100 * missed_m))
        print(
            hidden, "cm before, cm and deg after, cm from its start:", *(f"{each:.3f}" for each in rows[-1])
        )
    befores, afters, turns, _ = zip(*rows)
    good = [max(row[1], row[3]) < END_CM and row[2] < END_DEG for row in rows]
    return {
        "robots_good_share": sum(good) / ROBOTS,
        "square_before_cm_median": float(np.median(befores)),
        "square_after_cm_max": max(afters),
        "square_after_deg_max": max(turns),
        "error_squared_mean_off": abs(consistency() - 3.0),
    }
