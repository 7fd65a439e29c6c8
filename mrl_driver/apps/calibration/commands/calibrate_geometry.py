"""`mrl calibrate straight`, `turn` and `umbmark`."""

import os
from functools import partial
from typing import Callable, List, Mapping, NamedTuple, Sequence, Tuple

import click

from mrl_driver.apps.calibration import calibration_plots, fit, from_recording, geometry_procedures
from mrl_driver.apps.calibration.calibration_files import Progress
from mrl_driver.apps.calibration.geometry_procedures import STRAIGHT, TURN, UMBMARK, Leg, Outcome
from mrl_driver.apps.calibration.ground_truth import Ruler, parse_pose
from mrl_driver.apps.calibration.manoeuvres import Speeds, Track, steps_of
from mrl_driver.apps.calibration.trial import Trial, sense
from mrl_driver.apps.calibration.umbmark import require_laps
from mrl_driver.cli.commands.shared import Between, print_message
from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.robot.models import RobotModel

from . import calibrate_job
from .calibrate_job import RUNS, TURNS, Job, Result, job_options, value_option
from .calibrate_view import console, facts_of, outcome_lines, ruler_for


class CalibrationPlan(NamedTuple):
    """One calibration of the geometry: the runs to drive and their settings, or recordings of runs."""

    procedure: str
    settings: Mapping[str, float]
    legs: List[Leg]
    recorded: Sequence[str]
    again: Sequence[int]


def _geometry(plan: CalibrationPlan, job: Job) -> None:
    """Drive the runs or read recordings, evaluate them, and write the result."""
    if plan.recorded:
        model = calibrate_job.recorded_model(job)
        output, runs = (
            calibrate_job.output_for(job, model),
            [_recorded(plan, text, model) for text in plan.recorded],
        )
        side_m = plan.settings.get("side_m", 1.0)
        outcome = geometry_procedures.evaluate(plan.procedure, runs, model, side_m)
        calibrate_job.finish(_result(plan.procedure, outcome, runs, model, output), job)
        return
    ruler = ruler_for(job.truth)
    with calibrate_job.robot_of(job) as (driver, model, output):
        path = f"{os.path.splitext(output)[0]}.calibration.json"
        progress = Progress(path, f"{model.name} {driver.board.robot_id}")
        if job.restart:
            progress.forget(plan.procedure)
        try:
            _gather(plan, driver, progress, ruler)
        except KeyboardInterrupt:
            kept = len(progress.runs(plan.procedure, plan.settings))
            print_message(
                f"{kept} of {len(plan.legs)} runs are kept in {progress.path}; repeat the command to continue"
            )
            raise
        runs, others = progress.runs(plan.procedure, plan.settings), progress.other_runs(plan.procedure)
        measured = fit.BY_TRUTH if job.truth else fit.BY_TAPE
        side_m = plan.settings.get("side_m", 1.0)
        outcome = geometry_procedures.evaluate(plan.procedure, runs, model, side_m, measured, others)
        result = _result(plan.procedure, outcome, runs, model, output)
        calibrate_job.finish(result, job)
        progress.finish(plan.procedure)
        calibrate_job.offer_eeprom(driver, result.values, job)


def _gather(plan: CalibrationPlan, driver: Driver, progress: Progress, ruler: Ruler) -> None:
    """Drive the missing runs, and those to repeat."""
    procedure, settings, legs = plan.procedure, plan.settings, plan.legs
    done, track = len(progress.runs(procedure, settings)), Track(driver)
    if done:
        console.print(f"{done} of {len(legs)} runs are already in {progress.path}")
    for number in plan.again:
        if not 1 <= number <= done:
            raise ConfigError(f"--again is {number}, expected the number of one of the {done} finished runs")
        put = partial(progress.replace, procedure, number - 1)
        geometry_procedures.gather(driver, [legs[number - 1]], ruler, put, track)
    geometry_procedures.gather(driver, legs[done:], ruler, partial(progress.add, procedure, settings), track)


def _recorded(plan: CalibrationPlan, text: str, model: RobotModel) -> Trial:
    """Return a recorded run of this plan, from the file and the end in an option `--run`."""
    path, colon, end = text.rpartition(":")
    if not colon:
        raise ConfigError(f"--run is {text!r}, expected FILE:X,Y or FILE:X,Y,HEADING, in metres and degrees")
    pose = parse_pose(end)
    run = Trial(steps_of(from_recording.read(path, model).rows), pose)
    geometry_procedures.check_recorded(plan.procedure, model.differential, run, path)
    return run


def _result(procedure: str, outcome: Outcome, runs: List[Trial], model: RobotModel, output: str) -> Result:
    def draw(path: str) -> None:
        senses = [sense(outcome.after, each) for each in runs]
        calibration_plots.draw_ends(path, outcome.errors_before, outcome.errors_after, senses)

    values = geometry_procedures.values_for(model, outcome)
    return Result(procedure, model, output, values, outcome_lines(outcome), facts_of(outcome), draw)


_run_option = click.option(
    "--run",
    "runs",
    multiple=True,
    metavar="FILE:X,Y[,DEG]",
    help="Instead of driving: a recording of one run, and where the run ended.  Repeat it for each run.",
)
_again_option = click.option(
    "--again", multiple=True, type=int, metavar="N", help="Drive run N of an interrupted calibration again."
)
_speed_option = value_option("--speed", Between(0.03, 1.0), 0.2, "Speed [m/s].")


def _runs_options(command: Callable[..., None]) -> Callable[..., None]:
    """Options of all calibrations by driven runs."""
    return _speed_option(_run_option(_again_option(command)))


@click.command()
@job_options
@value_option("--distance", Between(0.3, 20.0), 2.0, "Length of a run [m].")
@value_option("--count", RUNS, 4, "Runs, alternately there and back.")
@_runs_options
def straight(
    job: Job, distance: float, count: int, speed: float, runs: Tuple[str, ...], again: Tuple[int, ...]
) -> None:
    """Measure counts per metre, and the left/right offset Cm.

    \b
    Examples:
      mrl calibrate straight --port /dev/ttyACM0 --distance 3
      mrl calibrate straight --robot traxbot --output lab3.yaml --run a.mrl:2.01,0.02 --run b.mrl:2.0,0.03
    """
    settings = {"distance_m": distance, "count": count}
    legs = geometry_procedures.straight_legs(count, distance, Speeds(speed))
    _geometry(CalibrationPlan(STRAIGHT, settings, legs, runs, again), job)


@click.command(short_help="Measure the slip offset Cs of tracks, or the wheelbase of wheels.")
@job_options
@value_option("--turns", TURNS, 2, "Whole turns per run.")
@value_option("--count", RUNS, 6, "Runs, alternately left and right.")
@_runs_options
def turn(
    job: Job, turns: int, count: int, speed: float, runs: Tuple[str, ...], again: Tuple[int, ...]
) -> None:
    """Measure the slip offset Cs of tracks, or the wheelbase of wheels, by turning in place.

    The first two runs are one turn each, so that the number of turns in the others is known.

    \b
    Example:
      mrl calibrate turn --robot lab3.yaml --port /dev/ttyACM0 --turns 3
    """
    legs = geometry_procedures.turn_legs(count, turns, Speeds(speed))
    _geometry(CalibrationPlan(TURN, {"turns": turns, "count": count}, legs, runs, again), job)


@click.command(short_help="Measure wheel ratio, wheelbase and noise, by squares.")
@job_options
@value_option("--side", Between(0.3, 10.0), 1.0, "Side of the square [m].")
@value_option("--laps", int, 5, "Laps in each direction, at least 2.")
@_runs_options
def umbmark(
    job: Job, side: float, laps: int, speed: float, runs: Tuple[str, ...], again: Tuple[int, ...]
) -> None:
    """Measure wheel ratio, wheelbase and noise, by squares in both directions (Borenstein and Feng 1996).

    \b
    Examples:
      mrl calibrate umbmark --robot lab3.yaml --port /dev/ttyACM0
      mrl calibrate umbmark --port /dev/pts/3 --truth truth.jsonl --laps 3 --yes     an emulated robot
    """
    require_laps(laps, "counter-clockwise")
    settings = {"side_m": side, "laps": laps}
    legs = geometry_procedures.umbmark_legs(laps, side, Speeds(speed))
    _geometry(CalibrationPlan(UMBMARK, settings, legs, runs, again), job)
