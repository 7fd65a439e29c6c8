"""Approaches a wall with the front sonar, and fits the power law that converts ADC counts to ranges.

Each emulated robot has a sonar with a curve of its own, which the calibration has to find.
"""

from typing import Dict, List, NamedTuple, Optional, Sequence

import numpy as np

from mrl_driver.apps.calibration import sonar_procedures
from mrl_driver.geometry import ORIGIN
from mrl_driver.robot import sonar_curve
from mrl_driver.robot.sonar_curve import THESIS, Curve
from sim_arduino.world.shapes import Wall
from sim_arduino.world.world import World
from sim_arduino.world.world_file import pose_text

from . import disturbances, plot_style
from .experiment_report import Figure, Measure, Result, over_seeds
from .experiment_robot import Setting, open_robot

START_M = sonar_procedures.START_M
SONAR_X_M = 0.1
THESIS_R2 = 0.9992
WIDE_M = 10.0  # the wall extends this far to both sides
CHECKED_M = np.arange(0.2, 2.001, 0.05)  # distances at which curves are compared [m]


class SonarRun(NamedTuple):
    """One calibration; `hidden` is the curve of an emulated sonar."""

    counts: Sequence[float]
    distances: Sequence[float]
    fit: sonar_curve.SonarFit
    hidden: Optional[Curve] = None


def run(setting: Setting) -> Result:
    """Approaches the wall, and fits the curve; a real robot must start 2 m in front of a wall."""
    title = "Sonar in front of a wall"
    if setting.port is not None:
        found = approach(setting)
        return Result("sonar-calibration", title, _coefficient_rows(found.fit), [_draw(setting, found, [])])
    runs = over_seeds(_calibrated, setting)
    remark = (
        f"Each robot has a sonar with a curve of its own and {100 * disturbances.SONAR_NOISE_M:g} cm of noise, wheels "
        "with errors, and a start by hand; it approaches the wall once. Control: the published curve in place of the "
        "calibrated one. The assumed noise sets R2. The distances begin at 20 cm, the published ones at 5 cm: the "
        "dead zone of the sonar is 15 cm."
    )
    return Result("sonar-calibration", title, _rows(runs), [_draw(setting, runs[0], runs)], remark)


def _coefficient_rows(fit: sonar_curve.SonarFit) -> List[Figure]:
    rows = [
        Figure(name, f"{name} of a s^b + c [cm]", ours, "", f"{getattr(THESIS, name)}")
        for name, ours in fit.curve._asdict().items()
    ]
    return [*rows, Figure("r2", "R2", round(fit.r2, 5), "", f"{THESIS_R2}")]


def _rows(runs: Sequence[SonarRun]) -> List[Figure]:
    """How well the hidden curves were found; the control is the published curve."""
    found = [(run.fit.curve.on_wire(), run.hidden) for run in runs if run.hidden]
    control = [(THESIS, hidden) for _, hidden in found]
    error = Measure(
        "error_cm", "largest error of a range, 20 to 200 cm", "cm", lambda pair: _largest_cm(*pair)
    )
    rows = [error.figure(found, control)]
    for number, name in enumerate(Curve._fields):
        off, others = ([abs(a[number] - b[number]) for a, b in pairs] for pairs in (found, control))
        rows.append(
            Measure(f"{name}_error", f"error of {name} of a s^b + c [cm]", "", float).figure(off, others)
        )
    r2 = Measure("r2", "R2", "", lambda run: round(run.fit.r2, 5), min, f"{THESIS_R2}", put_in=True)
    return [*rows, r2.figure(runs)]


def _largest_cm(curve: Curve, hidden: Curve) -> float:
    return float(np.abs(_errors_cm(curve, hidden)).max())


def _errors_cm(curve: Curve, hidden: Optional[Curve]) -> np.ndarray:
    """Ranges by a curve at `CHECKED_M`, minus the true ones, of a sonar with a hidden curve [cm]."""
    assert hidden is not None
    return 100 * (curve.range_m(hidden.counts(CHECKED_M)) - CHECKED_M)


def _calibrated(setting: Setting) -> SonarRun:
    curve = disturbances.sonar_curve(setting.seed)
    found = approach(setting, curve, disturbances.error(setting.seed))
    gain, exponent, offset_m = (curve[key] for key in ("gain", "exponent", "offset"))
    return found._replace(hidden=Curve(THESIS.a * gain, THESIS.b * exponent, THESIS.c + 100 * offset_m))


def sonar_errors(curve: Dict[str, float]) -> str:
    """Noise and curve of an emulated robot's sonars, in the form of `factory.Options.sonar`."""
    return disturbances.option(noise=disturbances.SONAR_NOISE_M, **curve)


def approach(setting: Setting, curve: Optional[Dict[str, float]] = None, error: str = "") -> SonarRun:
    """Approaches the wall with an emulated robot's sonar curve and wheel errors, and fits the readings at the stops."""
    wall_m = SONAR_X_M + START_M
    world = World([Wall(wall_m, -WIDE_M, wall_m, WIDE_M)])
    pose, sonar = pose_text(disturbances.placed(ORIGIN, setting.seed)), sonar_errors(curve or {})
    with open_robot(setting, world, error=error, sonar=sonar, pose=pose, footprint="none") as robot:
        planned = sonar_procedures.distances()
        ranges, distances = sonar_procedures.approach_wall(
            robot.driver, planned, lambda _: None, lambda _: None
        )
        counts = sonar_procedures.curve_in_force(robot.driver).counts(np.array(ranges)).tolist()
    return SonarRun(counts, distances, sonar_curve.fit(counts, distances))


def _draw(setting: Setting, shown: SonarRun, runs: Sequence[SonarRun]) -> str:
    made, (curve, errors) = plot_style.figure(2, 9.5, 4.5)
    fit, distances_cm = shown.fit, 100 * np.array(shown.distances)
    s = np.linspace(10, max(shown.counts), 200)
    curve.plot(shown.counts, distances_cm, "o", color=plot_style.BLUE, fillstyle="none", label="readings")
    curve.plot(s, 100 * fit.curve.range_m(s), color=plot_style.ORANGE, label=f"fit, R2 {fit.r2:.4f}")
    curve.plot(s, 100 * THESIS.range_m(s), ":", color="black", label="published, R2 0.9992")
    curve.set(xlabel="ADC count", ylabel="distance [cm]", title="one sonar")
    curve.legend(loc="upper left")
    errors.axhline(0.0, color="black", linewidth=0.8)
    if not runs:
        errors.plot(distances_cm, 100 * fit.errors_m, "o", color=plot_style.BLUE, fillstyle="none")
    looks = (
        (THESIS, plot_style.ORANGE, "by the published curve"),
        (None, plot_style.BLUE, "by the calibrated curve"),
    )
    for used, colour, label in looks:
        offs = [_errors_cm(used or each.fit.curve.on_wire(), each.hidden) for each in runs]
        plot_style.paths(errors, [list(zip(100 * CHECKED_M, off)) for off in offs], colour, label)
    errors.set(xlabel="distance [cm]", ylabel="error of the range [cm]", title=f"{len(runs)} sonars")
    if runs:
        errors.legend(loc="upper left", fontsize="small")
    return plot_style.save(made, setting.folder, "sonar-calibration")
