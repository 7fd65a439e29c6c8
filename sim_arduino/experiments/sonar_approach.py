"""Approaches a wall with the front sonar, and fits the power law that converts ADC counts to ranges."""

from typing import List, Sequence, Tuple

import numpy as np

from mrl_driver.calibration import part_procedures, sonar_curve
from mrl_driver.calibration.manoeuvres import Speeds, Track
from mrl_driver.calibration.sonar_curve import THESIS
from sim_arduino.world.shapes import Wall
from sim_arduino.world.world import World

from . import plot_style
from .experiment_report import Figure, Result
from .experiment_robot import NOISE, Setting, open_robot

PLAN = part_procedures.SonarPlan()
APPROACHES = 3
"""Number of approaches to the wall: with a noise of 1 cm, each distance needs more than one reading."""
THESIS_R2 = 0.9992
WIDE_M = 10.0
"""The wall extends this far to both sides."""


def run(setting: Setting) -> Result:
    """Approaches the wall, and fits the curve.  A real robot must start 2 m in front of a wall."""
    counts: List[float] = []
    distances: List[float] = []
    for number in range(APPROACHES if setting.port is None else 1):
        ranges, found = _approach(setting._replace(seed=setting.seed + number))
        counts += THESIS.counts(np.array(ranges)).tolist()
        distances += found
    fit = sonar_curve.fit(counts, distances)
    points = np.arange(0.2, 2.001, 0.05)
    off = np.abs(fit.curve.range_m(THESIS.counts(points)) - points)
    rows = [
        Figure("a", "a of a s^b + c [cm]", fit.curve.a, "", f"{THESIS.a}"),
        Figure("b", "b", fit.curve.b, "", f"{THESIS.b}"),
        Figure("c", "c", fit.curve.c, "", f"{THESIS.c}"),
        Figure("r2", "R2", round(fit.r2, 5), "", f"{THESIS_R2}"),
        Figure(
            "error_cm", "largest difference from the true curve, 20 to 200 cm", 100 * float(off.max()), "cm"
        ),
    ]
    remark = f"Emulated: {APPROACHES} approaches with 1 cm of noise; the sonar's dead zone is 15 cm."
    return Result(
        "sonar-calibration",
        "Sonar in front of a wall",
        rows,
        [_draw(setting, counts, distances, fit)],
        remark,
    )


def _approach(setting: Setting) -> Tuple[Sequence[float], Sequence[float]]:
    """Ranges by the curve in force, and true distances, for each stop [m]."""
    sonar_x_m = 0.1
    wall_m = sonar_x_m + PLAN.start_m
    world = World([Wall(wall_m, -WIDE_M, wall_m, WIDE_M)])
    with open_robot(setting, world, sonar=NOISE, footprint="none") as robot:
        driver = robot.driver
        assert driver.model is not None
        track = Track(driver)
        part_procedures.approach_wall(
            driver, track, PLAN.distances(), Speeds(), lambda _: None, lambda _: None
        )
        return part_procedures.readings_at_stops(track.end(), driver.model.differential, PLAN.start_m)


def _draw(
    setting: Setting, counts: Sequence[float], distances: Sequence[float], fit: sonar_curve.SonarFit
) -> str:
    made, (curve, errors) = plot_style.figure(2, 9.5, 4.5)
    s = np.linspace(10, max(counts), 200)
    curve.plot(
        counts, 100 * np.array(distances), "o", color=plot_style.BLUE, fillstyle="none", label="readings"
    )
    curve.plot(s, 100 * fit.curve.range_m(s), color=plot_style.ORANGE, label=f"fit, R2 {fit.r2:.4f}")
    curve.plot(s, 100 * THESIS.range_m(s), ":", color="black", label="published, R2 0.9992")
    curve.set(xlabel="ADC count", ylabel="distance [cm]")
    curve.legend(loc="upper left")
    errors.plot(100 * np.array(distances), 100 * fit.errors_m, "o", color=plot_style.BLUE, fillstyle="none")
    errors.axhline(0.0, color="black", linewidth=0.8)
    errors.set(xlabel="distance [cm]", ylabel="fit minus distance [cm]")
    return plot_style.save(made, setting.folder, "sonar-calibration")
