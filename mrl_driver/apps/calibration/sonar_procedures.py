"""`mrl calibrate sonar`: drives up to a wall; `robot.sonar_curve` fits the sonars' curve."""

import contextlib
import csv
import io
import math
import os
from functools import partial
from typing import Callable, Dict, List, Optional, Sequence, Tuple

import click
import numpy as np

from mrl_driver import figures
from mrl_driver.cli.commands.shared import print_message
from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.files import read_plain, replace_file
from mrl_driver.robot import models, sonar_curve
from mrl_driver.robot.models import Drive, RobotModel
from mrl_driver.robot.sonar import FARTHEST_M, NAMES
from mrl_driver.robot.sonar_curve import THESIS, Curve, SonarFit

from . import from_recording, manoeuvres
from .commands.calibrate_job import (
    Job,
    Result,
    job_options,
    recording_option,
    value_option,
    warn_of_distances,
)
from .ground_truth import tell
from .manoeuvres import Speeds, Track

Points = Tuple[List[float], List[float]]  # readings and distances [m]
_LONGEST_POINTS = 1 << 22  # longest file of points read [byte]; a calibration makes some thousand
START_M, STOP_M, STEP_M = 2.0, 0.2, 0.05  # distances from the wall, unless the user says otherwise [m]
STOP_S, FRESH_S = 1.5, 0.7
"""Duration of a stop in front of the wall, and time after which the readings belong to this stop [s]."""
READINGS, MIN_RANGE_SHARE = 5, 0.7
"""Number of readings at each distance, and smallest plausible range as a share of the distance."""


def distances(start_m: float = START_M, stop_m: float = STOP_M, step_m: float = STEP_M) -> List[float]:
    """Distances from the wall at which the robot stops [m]; ConfigError if they are too few, or do not approach it."""
    good = 0.15 <= stop_m < start_m <= 6.0 and 0.01 <= step_m <= 0.5
    count = int((start_m - stop_m) / step_m + 1e-6) + 1 if good else 0
    if count < sonar_curve.LEAST_DISTANCES:
        raise ConfigError(
            f"--start {start_m:g} --step {step_m:g} --stop {stop_m:g} gives {count} distances, expected at least "
            f"{sonar_curve.LEAST_DISTANCES} between 6 m and 0.15 m"
        )
    return [start_m - i * step_m for i in range(count)]


def approach_wall(
    robot: Driver, planned: Sequence[float], keep: Callable[[Points], None], report: Callable[[str], None]
) -> Points:
    """Drive towards the wall from the first distance [m], and stop at each one; `keep` gets the readings after each.

    ConfigError if the wall, or another object, is much closer than expected.
    """
    assert robot.model is not None
    line, track = robot.pose, Track(robot)
    readings: Points = [], []
    track.begin()
    for number, distance_m in enumerate(planned, 1):
        if number > 1:
            manoeuvres.straight(robot, planned[0] - distance_m, Speeds(), line)
        report(f"{number} of {len(planned)}: {distance_m:.2f} m")
        _require_free_path(robot, distance_m)
        readings = readings_at_stops(track.rows(), robot.model.differential, planned[0])
        keep(readings)
    return readings


def require_sonars(robot: Driver) -> None:
    """Raise ConfigError if the robot has no front sonar with such a curve; without one it would drive blindly."""
    sonars = robot.model.sonars if robot.model else {}
    if "front" not in sonars or sonars["front"].input_of("front") not in NAMES:
        raise ConfigError("this board has no front sonar of type MB1300, expected one: nothing was measured")


def _require_free_path(robot: Driver, distance_m: float) -> None:
    """Refuse to drive on if the wall is much closer than expected, by more than any error of a sonar, or unseen."""
    readings = []
    for _ in range(READINGS):
        robot.wait(STOP_S / READINGS)
        readings.append(robot.telemetry.ranges.get("front", np.nan) if robot.telemetry else np.nan)
    valid = sorted(each for each in readings if not math.isnan(each))
    range_m = valid[len(valid) // 2] if valid else math.nan
    if not MIN_RANGE_SHARE * distance_m <= range_m or (range_m == math.inf and 2 * distance_m < FARTHEST_M):
        got = f"measures {max(range_m, 0.0):.2f} m" if valid else "gives no reading"
        raise ConfigError(
            f"the front sonar {got}, expected about {distance_m:.2f} m to the wall: "
            "measure --start from the sonar to the wall, and clear the path"
        )


def readings_at_stops(rows: np.ndarray, drive: Drive, start_m: float) -> Points:
    """Ranges of the front sonar [m], NaN for none, and distances by odometry [m], for each stop of a track.

    `rows` are those of `Track.rows`; the first one is `start_m` away from the wall.
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
        range_m = float(np.median(np.where(np.isfinite(ranges_here), ranges_here, np.inf)))
        ranges.append(range_m if math.isfinite(range_m) else math.nan)  # NaN only if most echoes are missing
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


# -- the command


@click.command(short_help="Measure the curve of the sonars, range_cm = a s^b + c.")
@job_options
@value_option("--start", float, START_M, "Distance of the front sonar from the wall at the start [m].")
@value_option("--stop", float, STOP_M, "Smallest distance [m].")
@value_option("--step", float, STEP_M, "Distance between two readings [m].")
@click.option(
    "--points", metavar="FILE", help="Instead of driving: a file with lines of distance [m], reading [m]."
)
@recording_option
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
    planned = distances(start, stop, step)
    if points is not None or recording is not None:
        model, output = job.recorded_robot()
        if points is not None:
            readings = read_points(points)
        else:
            warn_of_distances(model)
            rows, _ = from_recording.read(str(recording), model)
            readings = readings_at_stops(rows, model.differential, start)
        job.finish(_fitted(readings, _model_curve(model), model, output))
        return
    with job.robot() as (driver, model, output):
        require_sonars(driver)
        warn_of_distances(model)
        kept = f"{os.path.splitext(output)[0]}.sonar.csv"
        readings = _approach(driver, planned, kept, job)
        try:
            result = _fitted(readings, curve_in_force(driver), model, output)
        except ConfigError as error:  # the readings are kept, and would be refused again
            raise ConfigError(f"{error}; measure again with --restart") from None
        job.finish(result)
        os.remove(kept)
        job.offer_eeprom(driver, result)


def _approach(driver: Driver, planned: Sequence[float], kept: str, job: Job) -> Points:
    """Drive up to the wall, on from the readings in the file `kept`, and add the new ones to it."""
    if job.restart and os.path.exists(kept):
        os.remove(kept)
    earlier = read_points(kept) if os.path.exists(kept) else ([], [])
    nearest_m = min(earlier[1], default=math.inf)
    remaining = [each for each in planned if each < nearest_m - (planned[0] - planned[1]) / 2]
    if earlier[1]:
        tell(f"{len(earlier[1])} of {len(earlier[1]) + len(remaining)} distances are already in {kept}")
    if not remaining:
        return earlier
    job.confirm_drive(
        f"The robot drives {remaining[0] - remaining[-1]:.2f} m forward. Does the front sonar point at a wall "
        f"{remaining[0]:.2f} m away, and is the path free?",
    )

    def keep(new: Points) -> None:
        _keep_points(kept, earlier[0] + new[0], earlier[1] + new[1])

    try:
        ranges, measured = approach_wall(driver, remaining, keep, tell)
    except BaseException:
        with contextlib.suppress(MrlError):
            driver.stop()
        if os.path.exists(kept):
            done = len(read_points(kept)[1])
            print_message(f"{done} distances are kept in {kept}; repeat the command to continue")
        raise
    return earlier[0] + ranges, earlier[1] + measured


def _keep_points(path: str, ranges: Sequence[float], distances: Sequence[float]) -> None:
    """Write the sonar's readings so far, in the format that `read_points` reads."""
    rows = [
        f"{distance:.4f},{'-' if math.isnan(reading) else f'{reading:.4f}'}\n"
        for reading, distance in zip(ranges, distances)
    ]
    replace_file(path, "# distance [m], reading [m]; from mrl calibrate sonar\n" + "".join(rows))


def _model_curve(model: RobotModel) -> Curve:
    """Return the model's own curve, or that of the thesis."""
    if not all(name in model.board for name in models.CURVE_KEYS):
        return THESIS
    return Curve(*(model.board[name] / 1e4 for name in models.CURVE_KEYS))


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
                if not 0 < distance <= FARTHEST_M or FARTHEST_M < reading < math.inf:
                    raise ValueError
            except (ValueError, IndexError):
                raise ConfigError(
                    f"{path}:{number}: got {','.join(row)[:40]!r}, expected distance,reading in metres, at most "
                    f"{FARTHEST_M:g}"
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
    wire = fit.curve.on_wire()
    before_m, after_m = (
        float(np.abs(curve.range_m(counts) - truth)[fit.used].max()) for curve in (present, wire)
    )
    lines = [
        f"before: {_formula(present)}, worst error {before_m * 100:.1f} cm",
        f"after:  {_formula(wire)}, worst error {after_m * 100:.1f} cm, R2 {fit.r2:.5f}, {len(truth)} distances",
    ]
    facts = {"before": present._asdict(), "after": wire._asdict(), "r2": fit.r2, "worst_m": after_m}
    values = {("board", name): value for name, value in curve_values(fit.curve).items()}
    return Result("sonar", model, output, values, lines, facts, partial(_draw, counts, truth, fit))


def _formula(curve: Curve) -> str:
    return f"{curve.a:.4f} s^{curve.b:.4f} {curve.c:+.4f}"


def _draw(counts: np.ndarray, ranges_m: np.ndarray, fit: SonarFit, path: str) -> None:
    figure = figures.figure(7.0, 6.0)
    upper, lower = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [2, 1]})
    valid = np.isfinite(counts)
    line = np.linspace(max(1.0, counts[valid].min() * 0.8), counts[valid].max() * 1.05, 200)
    a, b, c = fit.curve
    upper.plot(
        line,
        100 * fit.curve.range_m(line),
        color=figures.BLUE,
        label=f"{a:.4f} s^{b:.5f} {c:+.4f}, R² {fit.r2:.5f}",
    )
    upper.plot(
        line,
        100 * THESIS.range_m(line),
        "--",
        color=figures.GREY,
        label="Araujo 2012: 1.1767 s^0.94657 -0.3759, R² 0.9992",
    )
    upper.plot(
        counts[fit.used], 100 * ranges_m[fit.used], "o", color=figures.ORANGE, markersize=4, label="readings"
    )
    upper.set(ylabel="distance [cm]", title="Sonar curve")
    upper.legend(fontsize="small")
    lower.axhline(0, color=figures.GREY, linewidth=0.8)
    lower.plot(counts[fit.used], 100 * fit.errors_m[fit.used], "o", color=figures.ORANGE, markersize=4)
    lower.set(xlabel="ADC count s", ylabel="curve minus\ndistance [cm]")
    figures.save(figure, path)
