"""`mrl calibrate straight`, `turn`, `sideways`, `umbmark`: the runs, and their evaluation by `fit`.

UMBmark (Borenstein and Feng 1996) drives squares in both directions: a wrong wheelbase turns each corner too far, alike
in both, and unequal wheels bend each side, always to the same side.  The fit replaces the paper's closed form, which is
exact for small errors alone.
"""

import functools
import itertools
import math
import os
from functools import partial
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import click
import numpy as np

from mrl_driver import figures
from mrl_driver.cli.commands.shared import Between, print_message
from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import ON_TRACKS, ON_WHEELS, MecanumDrive, RobotModel

from . import fit, from_recording, manoeuvres
from .calibration_files import Key, Progress
from .commands.calibrate_job import RUNS, TURNS, Job, Result, job_options, value_option, warn_of_distances
from .fit import AXLE, CROSS, OFFSET, RADIUS, REAR, SCALE, SIDE, SLIP, Geometry, Measured
from .ground_truth import NOT_MEASURED, Ruler, parse_pose, ruler_for, tell
from .manoeuvres import Speeds, Track, steps_of
from .trial import (
    LEFT,
    NEITHER,
    RIGHT,
    Trial,
    errors,
    require_heading,
    require_plausible,
    require_sense,
    sense,
)

STRAIGHT, TURN, SIDEWAYS, UMBMARK = "straight", "turn", "sideways", "umbmark"
LEAST_LAPS = 2  # laps in each direction; fewer show no spread.  The paper drives 5.
_WHOLE_TURN = 2 * np.pi


class Leg(NamedTuple):
    """One run to drive."""

    name: str
    sense: str
    drive: Callable[[Driver], None]
    needs_heading: bool = False


class Outcome(NamedTuple):
    """The drive before and after, and the errors (R, 3) of the runs with each, columns x y yaw [m m rad]."""

    before: Geometry
    after: Geometry
    errors_before: np.ndarray
    errors_after: np.ndarray
    noise: Mapping[str, float]  # what was measured of the model's `Noise`, by its keys


def straight_legs(runs: int, distance_m: float, speeds: Speeds, sideways: bool = False) -> List[Leg]:
    """Runs along a line, alternately forward and back, or to the left and to the right."""
    drive: Callable[[Driver, float, Speeds], None] = manoeuvres.sideways if sideways else manoeuvres.straight
    ways = ("to the left", "to the right") if sideways else ("forward", "back")

    def leg(number: int) -> Leg:
        way_m = distance_m if number % 2 == 0 else -distance_m
        name = f"run {number + 1} of {runs}, {distance_m:g} m {ways[number % 2]}"
        return Leg(name, NEITHER, lambda robot: drive(robot, way_m, speeds))

    return [leg(number) for number in range(runs)]


def turn_legs(runs: int, turns: int, speeds: Speeds) -> List[Leg]:
    """Turns, alternately left and right; the first two are one whole turn each, to count the others safely."""

    def leg(number: int) -> Leg:
        sign, sense = (1, LEFT) if number % 2 == 0 else (-1, RIGHT)
        whole = 1 if number < 2 else turns
        name = f"run {number + 1} of {runs}, {whole} turn{'s' * (whole > 1)} {sense}"
        return Leg(
            name, sense, lambda robot: manoeuvres.turn(robot, sign * whole * _WHOLE_TURN, speeds), True
        )

    return [leg(number) for number in range(runs)]


def umbmark_legs(laps: int, side_m: float, speeds: Speeds) -> List[Leg]:
    """Squares: first all counter-clockwise laps, then all clockwise laps."""

    def leg(number: int, sense: str) -> Leg:
        name = f"lap {number + 1} of {laps} {sense}"
        return Leg(name, sense, lambda robot: manoeuvres.square(robot, side_m, sense == LEFT, speeds))

    return [leg(number, sense) for sense in (LEFT, RIGHT) for number in range(laps)]


def gather(
    robot: Driver,
    legs: Sequence[Leg],
    ruler: Ruler,
    keep: Callable[[Trial], None],
    track: Optional[Track] = None,
) -> None:
    """Drive the legs one after the other; `keep` gets each run as soon as it is measured.

    Raises:
        ConfigError: a run went in the wrong direction, its counts jumped, or its end is impossible and the ruler
            does not measure again; this run is not kept.
        WheelFault, BoardTimeout: the robot could not drive a run.
    """
    track = track or Track(robot)
    assert robot.model is not None
    drive = geometry(robot.model)
    for leg in legs:
        ruler.begin(leg.name)
        track.begin()
        leg.drive(robot)
        steps, name = manoeuvres.steps_of(track.rows()), leg.name
        require_sense(drive, Trial(steps, NOT_MEASURED), leg.sense, name)
        keep(Trial(steps, ruler.end(name, partial(_check_end, drive, steps, leg))))


def _check_end(drive: Geometry, steps: np.ndarray, leg: Leg, end: Pose) -> None:
    run = Trial(steps, end)
    require_plausible(drive, run, leg.name)
    if leg.needs_heading:
        require_heading(run, leg.name)


def geometry(model: RobotModel, procedure: str = "") -> Geometry:
    """The drive; raise ConfigError for omni wheels, and for others than mecanum wheels if it must move sideways."""
    if isinstance(model.base, MecanumDrive):
        return model.base
    if procedure == SIDEWAYS:
        raise ConfigError(f"mrl calibrate sideways is for mecanum wheels; {model.name} has none")
    return model.differential


def free_numbers(procedure: str, model: RobotModel) -> Tuple[str, ...]:
    """The parameters that a procedure fits; on tracks and mecanum wheels the slip replaces the wheelbase."""
    mecanum = isinstance(model.drive, MecanumDrive)
    turning = SLIP if model.body.tracks or mecanum else AXLE
    straight = (RADIUS, OFFSET, CROSS) if mecanum else (SCALE, OFFSET)
    return {STRAIGHT: straight, TURN: (turning,), SIDEWAYS: (SIDE, CROSS, REAR), UMBMARK: (OFFSET, turning)}[
        procedure
    ]


def evaluate(
    procedure: str,
    runs: List[Trial],
    model: RobotModel,
    measured: Measured = fit.BY_TAPE,
    others: Sequence[Trial] = (),
) -> Outcome:
    """Evaluate the runs of a procedure; ConfigError if they are too few, or one contradicts the others.

    `measured` is the accuracy of the ends; `others` are runs of other procedures, for the noise.
    """
    before = start = geometry(model, procedure)
    free = free_numbers(procedure, model)
    found = errors(before, runs)
    if procedure == UMBMARK:
        _require_laps(before, runs)
    elif len(runs) < 2:
        raise ConfigError(f"there is {len(runs)} run, expected at least 2")
    elif procedure == TURN:
        for number, run in enumerate(runs, 1):
            require_heading(run, f"run {number} of {len(runs)}")
        start = fit.fit(runs[:2], before, free, model.noise, measured).drive
    fitted = fit.fit(runs, start, free, model.noise, measured)
    _require_no_outlier(runs, fitted)
    together = [*runs, *others]
    noise = fit.scale_deviations(fitted, free)
    if len(together) >= fit.LEAST_RUNS_FOR_NOISE:
        whole = fit.GeometryFit(fitted.drive, errors(fitted.drive, together), ())
        random = fit.estimate_noise(together, whole, len(free) + (len(others) > 0), measured)
        noise.update(wheel_m2_per_m=random.wheel_m2_per_m, turn_rad2_per_rad=random.turn_rad2_per_rad)
    return Outcome(before, fitted.drive, found, fitted.errors, noise)


def _require_no_outlier(runs: List[Trial], fitted: fit.GeometryFit) -> None:
    odd = fit.outlier(runs, fitted)
    if odd >= 0:
        off_m = float(np.hypot(*fitted.errors[odd, :2]))
        raise ConfigError(
            f"run {odd + 1} of {len(runs)} ends {off_m:.3f} m from where the others predict: wrongly measured, "
            f"or a wheel slipped; drive it again with --again {odd + 1}"
        )


def _require_laps(drive: Geometry, runs: List[Trial]) -> None:
    senses = [sense(drive, run) for run in runs]
    for each in (LEFT, RIGHT):
        if senses.count(each) < LEAST_LAPS:
            raise ConfigError(f"there are {senses.count(each)} {each} laps, expected at least {LEAST_LAPS}")


def values_for(model: RobotModel, outcome: Outcome) -> Dict[Key, float]:
    """Values of the robot's YAML file that change.

    The board gets radii that make commanded speeds correct; they grow with wheels and wheelbase.
    """
    before, after = outcome.before, outcome.after
    values: Dict[Key, float] = {
        ("drive", name): getattr(after, name)
        for name in after._fields
        if getattr(after, name) != getattr(before, name)
    }
    wheel = model.board["wheel_radius"] * after.metres_per_count / before.metres_per_count
    axis = model.board["axis_radius"] * after.turning_separation_m / before.turning_separation_m
    for name, value in (("wheel_radius", wheel), ("axis_radius", axis)):
        if round(value) != model.board[name]:
            values["board", name] = round(value)
    values.update({("noise", name): value for name, value in outcome.noise.items()})
    return values


# -- the commands


class CalibrationPlan(NamedTuple):
    """One calibration of the geometry: the runs to drive and their settings, or recordings of runs."""

    procedure: str
    settings: Mapping[str, float]
    legs: List[Leg]
    recorded: Sequence[str]
    again: Sequence[int]

    def evaluate(self, runs: List[Trial], model: RobotModel, output: str, **options: Any) -> Result:
        """Evaluate the runs, with the `options` of `evaluate`."""
        outcome = evaluate(self.procedure, runs, model, **options)
        senses = [sense(outcome.after, each) for each in runs]
        draw = partial(_draw, outcome, senses)
        values, lines = values_for(model, outcome), _lines(outcome)
        turned = model.noise.turn_scale_sd not in (ON_WHEELS.turn_scale_sd, ON_TRACKS.turn_scale_sd)
        if self.procedure == STRAIGHT and turned:
            lines.append("turns were measured with the distances of before: run mrl calibrate turn again")
        if self.procedure == UMBMARK:
            before, after = (_e_max_m(each, senses) for each in (outcome.errors_before, outcome.errors_after))
            lines.append(f"UMBmark's E_max,syst: {before * 1000:.1f} mm before, {after * 1000:.1f} mm after")
        return Result(self.procedure, model, output, values, lines, _facts(outcome), draw)


def _geometry(plan: CalibrationPlan, job: Job) -> None:
    """Drive the runs or read recordings, evaluate them, and write the result."""
    if plan.recorded:
        model, output = job.recorded_robot()
        recorded = [_recorded(plan.procedure, text, model) for text in plan.recorded]
        _require_different(recorded)
        if plan.procedure != STRAIGHT:
            warn_of_distances(model)
        job.finish(plan.evaluate(recorded, model, output))
        return
    ruler = ruler_for(job.truth)
    with job.robot() as (driver, model, output):
        geometry(model, plan.procedure)
        path = f"{os.path.splitext(output)[0]}.calibration.json"
        progress = Progress(path, f"{model.name} {driver.board.robot_id}", plan.procedure, plan.settings)
        if plan.procedure != STRAIGHT:
            progress.require_result(STRAIGHT)
            warn_of_distances(model)
        if job.restart:
            progress.forget()
        try:
            _gather(plan, driver, progress, ruler)
        except (KeyboardInterrupt, click.Abort):  # Abort: at a question
            kept = f"{len(progress.runs())} of {len(plan.legs)} runs are kept in {progress.path}"
            print_message(f"{kept}; repeat the command to continue")
            raise
        measured = fit.BY_TRUTH if job.truth else fit.BY_TAPE
        others = progress.other_runs()
        result = plan.evaluate(progress.runs(), model, output, measured=measured, others=others)
        job.finish(result)
        progress.finish()
        job.offer_eeprom(driver, result)


def _gather(plan: CalibrationPlan, driver: Driver, progress: Progress, ruler: Ruler) -> None:
    done, legs, track = len(progress.runs()), plan.legs, Track(driver)
    if done:
        tell(f"{done} of {len(legs)} runs are already in {progress.path}")
    for number in plan.again:
        if not 1 <= number <= done:
            raise ConfigError(f"--again is {number}, expected the number of one of the {done} finished runs")
        gather(driver, [legs[number - 1]], ruler, partial(progress.put, number=number - 1), track)
    gather(driver, legs[done:], ruler, progress.put, track)


def _recorded(procedure: str, text: str, model: RobotModel) -> Trial:
    """Return a recorded run of a procedure, from the file and the end in an option `--run`."""
    path, colon, end = text.rpartition(":")
    if not colon:
        raise ConfigError(f"--run is {text!r}, expected FILE:X,Y or FILE:X,Y,HEADING, in metres and degrees")
    run = Trial(steps_of(from_recording.read(path, model)[0]), parse_pose(end))
    drive = geometry(model, procedure)
    found = sense(drive, run)
    if (found == NEITHER) != (procedure in (STRAIGHT, SIDEWAYS)):
        raise ConfigError(f"{path} went {found}, expected a run of mrl calibrate {procedure}")
    require_sense(drive, run, found, path)
    require_plausible(drive, run, path)
    return run


def _require_different(runs: Sequence[Trial]) -> None:
    """Raise ConfigError for the same recording given twice: it would count as two measurements."""
    for (first, one), (second, other) in itertools.combinations(enumerate(runs, 1), 2):
        if np.array_equal(one.steps, other.steps):
            raise ConfigError(
                f"--run {first} and {second} have the same counts, expected a recording of each run; give each once"
            )


def _by_runs(command: Callable[..., Tuple[Mapping[str, float], List[Leg]]]) -> Callable[..., None]:
    """Add the options of all calibrations by driven runs; `command` returns the settings of its runs, and the runs."""

    @value_option("--speed", Between(0.03, 1.0), 0.2, "Speed [m/s].")
    @click.option(
        "--run",
        "runs",
        multiple=True,
        metavar="FILE:X,Y[,DEG]",
        help="Instead of driving: a recording of one run, and its end; turns need DEG.  Repeat it for each run.",
    )
    @click.option(
        "--again",
        multiple=True,
        type=int,
        metavar="N",
        help="Drive run N of an interrupted calibration again.",
    )
    @functools.wraps(command)
    def measure(
        job: Job, speed: float, runs: Tuple[str, ...], again: Tuple[int, ...], **options: Any
    ) -> None:
        settings, legs = command(Speeds(speed), **options)
        _geometry(CalibrationPlan(command.__name__, settings, legs, runs, again), job)

    return measure


@click.command(short_help="Measure counts per metre, and the left/right offset Cm.")
@job_options
@value_option("--distance", Between(0.3, 20.0), 2.0, "Length of a run [m].")
@value_option("--count", RUNS, 4, "Runs, alternately there and back.")
@_by_runs
def straight(speeds: Speeds, distance: float, count: int) -> Tuple[Mapping[str, float], List[Leg]]:
    """Measure counts per metre, and the left/right offset Cm; of mecanum wheels the radius, and two offsets.

    \b
    Examples:
      mrl calibrate straight --port /dev/ttyACM0 --distance 3
      mrl calibrate straight --robot traxbot --output lab3.yaml --run a.mrl:2.01,0.02 --run b.mrl:2.0,0.03
    """
    return {"distance_m": distance, "count": count}, straight_legs(count, distance, speeds)


@click.command(short_help="Measure the slip offset Cs of tracks, or the wheelbase of wheels.")
@job_options
@value_option("--turns", TURNS, 2, "Whole turns per run.")
@value_option("--count", RUNS, 6, "Runs, alternately left and right.")
@_by_runs
def turn(speeds: Speeds, turns: int, count: int) -> Tuple[Mapping[str, float], List[Leg]]:
    """Measure the slip offset Cs of tracks, or the wheelbase of wheels, by turning in place.

    The first two runs are one turn each, so that the number of turns in the others is known.

    \b
    Example:
      mrl calibrate turn --robot lab3.yaml --port /dev/ttyACM0 --turns 3
    """
    return {"turns": turns, "count": count}, turn_legs(count, turns, speeds)


@click.command(short_help="Measure the slip of mecanum wheels in drives sideways.")
@job_options
@value_option("--distance", Between(0.3, 20.0), 2.0, "Length of a run [m].")
@value_option("--count", RUNS, 4, "Runs, alternately to the left and to the right.")
@_by_runs
def sideways(speeds: Speeds, distance: float, count: int) -> Tuple[Mapping[str, float], List[Leg]]:
    """Measure the slip of mecanum wheels in drives sideways, and the offset of the rear wheels.

    \b
    Example:
      mrl calibrate sideways --robot truck.yaml --port /dev/ttyACM0 --distance 1
    """
    return {"distance_m": distance, "count": count}, straight_legs(count, distance, speeds, sideways=True)


@click.command(short_help="Measure wheel ratio, wheelbase and noise, by squares.")
@job_options
@value_option("--side", Between(0.3, 10.0), 1.0, "Side of the square [m].")
@value_option("--laps", RUNS, 5, "Laps in each direction.")
@_by_runs
def umbmark(speeds: Speeds, side: float, laps: int) -> Tuple[Mapping[str, float], List[Leg]]:
    """Measure wheel ratio, wheelbase and noise, by squares in both directions (Borenstein and Feng 1996).

    \b
    Examples:
      mrl calibrate umbmark --robot lab3.yaml --port /dev/ttyACM0
      mrl calibrate umbmark --port /dev/pts/3 --truth truth.jsonl --laps 3 --yes     an emulated robot
    """
    return {"side_m": side, "laps": laps}, umbmark_legs(laps, side, speeds)


def _lines(outcome: Outcome) -> List[str]:
    lines = []
    for name, found in (("before", outcome.errors_before), ("after", outcome.errors_after)):
        off_m, yaw = np.hypot(found[:, 0], found[:, 1]), np.abs(found[:, 2])
        turned = (
            f"{math.degrees(np.nanmax(yaw)):.2f} deg" if np.isfinite(yaw).any() else "heading not measured"
        )
        lines.append(
            f"end errors {name}: mean {off_m.mean() * 1000:.1f} mm, worst {off_m.max() * 1000:.1f} mm, {turned}"
        )
    if outcome.after.metres_per_count != outcome.before.metres_per_count:
        before, after = (1 / drive.metres_per_count for drive in (outcome.before, outcome.after))
        lines.append(f"counts per metre: {before:.1f} before, {after:.1f} after")
    return lines


def _e_max_m(found: np.ndarray, senses: Sequence[str]) -> float:
    """The paper's measure of accuracy: how far the mean end of either direction is from the true one, at most [m]."""
    return max(math.hypot(*found[np.array(senses) == each, :2].mean(axis=0)) for each in (LEFT, RIGHT))


def _facts(outcome: Outcome) -> Dict[str, Any]:
    return {
        "runs": len(outcome.errors_before),
        "drive_before": outcome.before._asdict(),
        "drive_after": outcome.after._asdict(),
        "errors_before_m_rad": outcome.errors_before.tolist(),
        "errors_after_m_rad": outcome.errors_after.tolist(),
        "noise": dict(outcome.noise),
    }


def _draw(outcome: Outcome, senses: Sequence[str], path: str) -> None:
    """Plot the errors of the ends before and after, by direction; as in Borenstein and Feng 1996."""
    figure = figures.figure(6.0, 5.6)
    axes = figure.add_subplot()
    for name, colour in ((LEFT, figures.BLUE), ("clockwise, or straight", figures.ORANGE)):
        mine = np.array([(each == LEFT) == (name == LEFT) for each in senses])
        if not mine.any():
            continue
        for when, sign, found in (
            ("before", "o", outcome.errors_before),
            ("after", "+", outcome.errors_after),
        ):
            axes.plot(*(1000 * found[mine, :2].T), sign, mfc="none", color=colour, label=f"{name}, {when}")
    axes.axhline(0, color=figures.GREY, linewidth=0.8)
    axes.axvline(0, color=figures.GREY, linewidth=0.8)
    axes.set(
        xlabel="measured end minus odometry, x [mm]",
        ylabel="measured end minus odometry, y [mm]",
        aspect="equal",
        title="Errors of the odometry at the ends of the runs",
    )
    axes.margins(0.15)
    axes.legend(fontsize="small")
    figures.save(figure, path)
