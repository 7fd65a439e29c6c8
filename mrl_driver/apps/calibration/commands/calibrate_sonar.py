"""`mrl calibrate sonar`."""

import contextlib
import csv
import io
import math
import os
from functools import partial
from typing import List, Optional, Sequence, Tuple

import click
import numpy as np

from mrl_driver.apps.calibration import calibration_plots, from_recording, sonar_procedures
from mrl_driver.apps.calibration.manoeuvres import Speeds, Track
from mrl_driver.apps.calibration.sonar_procedures import SonarPlan, approach_wall, readings_at_stops
from mrl_driver.cli.commands.shared import print_message
from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.files import read_plain, replace_file
from mrl_driver.robot import models, sonar_curve
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.sonar_curve import THESIS, Curve

from . import calibrate_job
from .calibrate_job import Job, Result, job_options, value_option
from .calibrate_view import console

Points = Tuple[List[float], List[float]]  # readings and distances [m]
_LONGEST_POINTS = 1 << 22  # longest file of points read [byte]; a calibration makes some thousand


@click.command(short_help="Measure the curve of the sonars, range_cm = a s^b + c.")
@job_options
@value_option("--start", float, 2.0, "Distance of the front sonar from the wall at the start [m].")
@value_option("--stop", float, 0.2, "Smallest distance [m].")
@value_option("--step", float, 0.05, "Distance between two readings [m].")
@click.option(
    "--points", metavar="FILE", help="Instead of driving: a file with lines of distance [m], reading [m]."
)
@calibrate_job.recording_option
def sonar(
    job: Job, start: float, stop: float, step: float, points: Optional[str], recording: Optional[str]
) -> None:
    """Measure the curve of the sonars, range_cm = a s^b + c, in front of a flat wall.

    Asks, then drives up to the wall by its odometry.  Run mrl calibrate straight first.

    \b
    Examples:
      mrl calibrate sonar --robot lab3.yaml --port /dev/ttyACM0 --start 2
      mrl calibrate sonar --robot lab3.yaml --points wall.csv --plot curve.png
    """
    plan = SonarPlan(start, stop, step)
    plan.distances()
    if points is not None or recording is not None:
        model = calibrate_job.recorded_model(job)
        output = calibrate_job.output_for(job, model)
        if points is not None:
            readings = read_points(points)
        else:
            rows = from_recording.read(str(recording), model).rows
            readings = readings_at_stops(rows, model.differential, start)
        calibrate_job.finish(_fitted(readings, _model_curve(model) or THESIS, model, output), job)
        return
    with calibrate_job.robot_of(job) as (driver, model, output):
        sonar_procedures.require_sonars(driver)
        kept = f"{os.path.splitext(output)[0]}.sonar.csv"
        readings = _approach(driver, plan, kept, job)
        result = _fitted(readings, sonar_procedures.curve_in_force(driver), model, output)
        calibrate_job.finish(result, job)
        os.remove(kept)
        calibrate_job.offer_eeprom(driver, result.values, job)


def _approach(driver: Driver, plan: SonarPlan, kept: str, job: Job) -> Points:
    """Drive up to the wall, on from the readings in the file `kept`, and add the new ones to it."""
    assert driver.model is not None
    drive = driver.model.differential
    if job.restart and os.path.exists(kept):
        os.remove(kept)
    earlier = readings = read_points(kept) if os.path.exists(kept) else ([], [])
    nearest_m = min(earlier[1], default=math.inf)
    remaining = [each for each in plan.distances() if each < nearest_m - plan.step_m / 2]
    if earlier[1]:
        console.print(
            f"{len(earlier[1])} of {len(earlier[1]) + len(remaining)} distances are already in {kept}"
        )
    if not remaining:
        return earlier
    calibrate_job.confirm_drive(
        job,
        f"The robot drives {remaining[0] - remaining[-1]:.2f} m forward. Does the front sonar point at a wall "
        f"{remaining[0]:.2f} m away, and is the path free?",
    )

    def keep(rows: np.ndarray) -> None:
        nonlocal readings
        ranges, distances = readings_at_stops(rows, drive, remaining[0])
        readings = earlier[0] + ranges, earlier[1] + distances
        _keep_points(kept, *readings)

    try:
        approach_wall(driver, Track(driver), remaining, Speeds(), console.print, keep)
    except BaseException:
        with contextlib.suppress(MrlError):
            driver.stop()
        if readings[1]:
            print_message(f"{len(readings[1])} distances are kept in {kept}; repeat the command to continue")
        raise
    return readings


def _keep_points(path: str, ranges: Sequence[float], distances: Sequence[float]) -> None:
    """Write the sonar's readings so far, in the format that `read_points` reads."""
    rows = [
        f"{distance:.4f},{'-' if math.isnan(reading) else f'{reading:.4f}'}\n"
        for reading, distance in zip(ranges, distances)
    ]
    replace_file(path, "# distance [m], reading [m]; from mrl calibrate sonar\n" + "".join(rows))


def _model_curve(model: RobotModel) -> Optional[Curve]:
    """Return the model's own curve; None if it has none."""
    coefficients = [model.board.get(name) for name in models.CURVE_KEYS]
    if None in coefficients:
        return None
    return Curve(*(float(value) / 1e4 for value in coefficients if value is not None))


def read_points(path: str) -> Points:
    """Return readings and distances [m] from a file; `-` or `inf` means no reading.  A ConfigError names the line."""
    ranges, distances = [], []
    try:
        text = read_plain(path, _LONGEST_POINTS).decode("utf-8-sig")
        for number, row in enumerate(csv.reader(io.StringIO(text, newline="")), 1):
            if not row or row[0].lstrip().startswith("#"):
                continue
            try:
                distance, reading = float(row[0]), math.nan if row[1].strip() == "-" else float(row[1])
            except (ValueError, IndexError):
                raise ConfigError(
                    f"{path}:{number}: got {','.join(row)[:40]!r}, expected distance,reading in metres"
                ) from None
            distances.append(distance)
            ranges.append(reading if math.isfinite(reading) else math.nan)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path} cannot be read: {error}") from None
    return ranges, distances


def _fitted(readings: Points, present: Curve, model: RobotModel, output: str) -> Result:
    """Fit the curve to readings that were made with the curve `present`."""
    ranges, truth = (np.array(each) for each in readings)
    counts = present.counts(ranges)
    fit = sonar_curve.fit(counts.tolist(), readings[1])
    wire, off_m = fit.curve.on_wire(), float(np.abs(ranges - truth)[fit.used].max())
    lines = [
        f"before: {_formula(present)}, worst error {off_m * 100:.1f} cm",
        f"after:  {_formula(wire)}, worst error {fit.worst_m * 100:.1f} cm, R2 {fit.r2:.5f}, {len(truth)} distances",
    ]
    facts = {"before": present._asdict(), "after": wire._asdict(), "r2": fit.r2, "worst_m": fit.worst_m}
    values = {("board", name): value for name, value in sonar_procedures.curve_values(fit.curve).items()}

    draw = partial(calibration_plots.draw_sonar, counts=counts, ranges_m=truth, fit=fit)
    return Result("sonar", model, output, values, lines, facts, draw)


def _formula(curve: Curve) -> str:
    return f"{curve.a:.4f} s^{curve.b:.4f} {curve.c:+.4f}"
