"""`mrl calibrate straight`, `turn` and `umbmark`."""

from functools import partial
from typing import TYPE_CHECKING, Any, Callable, List, Mapping, NamedTuple, Sequence, Tuple

import click

from mrl_driver.cli.commands.shared import Between, print_json, print_message, warn
from mrl_driver.errors import ConfigError

from . import calibrate_job
from .calibrate_job import (
    Job,
    job_options,
    model_of,
    offer_eeprom,
    open_progress,
    output_for,
    recorded_model,
    write_yaml,
)

if TYPE_CHECKING:
    from mrl_driver.apps.calibration.calibration_files import Key, Progress
    from mrl_driver.apps.calibration.geometry_procedures import Leg, Outcome
    from mrl_driver.apps.calibration.ground_truth import Ruler
    from mrl_driver.apps.calibration.trial import Trial
    from mrl_driver.driver import Driver
    from mrl_driver.robot.models import RobotModel


class CalibrationPlan(NamedTuple):
    """One calibration of the geometry: the runs to drive and their settings, or recordings of runs."""

    procedure: str
    settings: Mapping[str, float]
    legs: List["Leg"]
    recorded: Sequence[str]
    again: Sequence[int]


def _geometry(plan: CalibrationPlan, job: Job) -> None:
    """Drive the runs or read recordings, evaluate them, and write the result."""
    from mrl_driver.apps.calibration import fit, geometry_procedures

    from .calibrate_view import ruler_for

    if plan.recorded:
        _from_recordings(plan, job)
        return
    ruler = ruler_for(job.truth)
    with calibrate_job.connect(job) as driver:
        warn(driver)
        model = model_of(driver)
        output = output_for(job, model, driver.board.robot_id)
        progress = open_progress(output, model, driver.board.robot_id)
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
        values = geometry_procedures.values_for(model, outcome)
        report(plan.procedure, outcome, runs, model, values, output, job)
        progress.finish(plan.procedure)
        offer_eeprom(driver, values, job)


def _gather(plan: CalibrationPlan, driver: "Driver", progress: "Progress", ruler: "Ruler") -> None:
    """Drive the missing runs, and those to repeat."""
    from mrl_driver.apps.calibration import geometry_procedures, manoeuvres

    from .calibrate_view import console

    procedure, settings, legs = plan.procedure, plan.settings, plan.legs
    done, track = len(progress.runs(procedure, settings)), manoeuvres.Track(driver)
    if done:
        console.print(f"{done} of {len(legs)} runs are already in {progress.path}")
    for number in plan.again:
        if not 1 <= number <= done:
            raise ConfigError(f"--again is {number}, expected the number of one of the {done} finished runs")
        put = partial(progress.replace, procedure, number - 1)
        geometry_procedures.gather(driver, [legs[number - 1]], ruler, put, track)
    geometry_procedures.gather(driver, legs[done:], ruler, partial(progress.add, procedure, settings), track)


def _from_recordings(plan: CalibrationPlan, job: Job) -> None:
    from mrl_driver.apps.calibration import from_recording, geometry_procedures
    from mrl_driver.apps.calibration.ground_truth import parse_pose

    model = recorded_model(job)
    output = output_for(job, model, None)
    runs = []
    for text in plan.recorded:
        path, colon, end = text.rpartition(":")
        if not colon:
            raise ConfigError(
                f"--run is {text!r}, expected FILE:X,Y or FILE:X,Y,HEADING, in metres and degrees"
            )
        run = from_recording.run_of(path, parse_pose(end), model)
        geometry_procedures.check_recorded(plan.procedure, model.differential, run, path)
        runs.append(run)
    outcome = geometry_procedures.evaluate(plan.procedure, runs, model, plan.settings.get("side_m", 1.0))
    report(plan.procedure, outcome, runs, model, geometry_procedures.values_for(model, outcome), output, job)


def report(
    procedure: str,
    outcome: "Outcome",
    runs: List["Trial"],
    model: "RobotModel",
    values: Mapping["Key", float],
    output: str,
    job: Job,
) -> None:
    """Show the result before and after, draw it, and write the YAML file after asking."""
    from .calibrate_view import facts_of, outcome_lines, show_values

    if job.plot is not None:
        from mrl_driver.apps.calibration import calibration_plots
        from mrl_driver.apps.calibration import trial as run

        senses = [run.sense(outcome.after, each) for each in runs]
        calibration_plots.draw_ends(job.plot, outcome.errors_before, outcome.errors_after, senses)
    if job.as_json:
        print_json({"procedure": procedure, "output": output, **facts_of(outcome)})
    else:
        for line in outcome_lines(outcome):
            click.echo(line)
        show_values(model, values)
    write_yaml(procedure, values, output, job, model)


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
_speed_option = click.option(
    "--speed", type=Between(0.03, 1.0), default=0.2, show_default=True, help="Speed [m/s]."
)


def _speeds(speed: float) -> Any:
    from mrl_driver.apps.calibration.manoeuvres import Speeds

    return Speeds(linear_m_s=speed)


def _count_option(default: int, ways: str) -> Callable[[Any], Any]:
    kind = click.IntRange(2, 50)
    return click.option(
        "--count", type=kind, default=default, show_default=True, help=f"Runs, alternately {ways}."
    )


@click.command()
@job_options
@click.option(
    "--distance", type=Between(0.3, 20.0), default=2.0, show_default=True, help="Length of a run [m]."
)
@_count_option(4, "there and back")
@_speed_option
@_run_option
@_again_option
def straight(
    job: Job, distance: float, count: int, speed: float, runs: Tuple[str, ...], again: Tuple[int, ...]
) -> None:
    """Measure counts per metre, and the left/right offset Cm.

    \b
    Examples:
      mrl calibrate straight --port /dev/ttyACM0 --distance 3
      mrl calibrate straight --robot traxbot --output lab3.yaml --run a.mrl:2.01,0.02 --run b.mrl:2.0,0.03
    """
    from mrl_driver.apps.calibration.geometry_procedures import STRAIGHT, straight_legs

    settings = {"distance_m": distance, "count": count}
    legs = straight_legs(count, distance, _speeds(speed))
    _geometry(CalibrationPlan(STRAIGHT, settings, legs, runs, again), job)


@click.command(short_help="Measure the slip offset Cs of tracks, or the wheelbase of wheels.")
@job_options
@click.option(
    "--turns", type=click.IntRange(1, 20), default=2, show_default=True, help="Whole turns per run."
)
@_count_option(6, "left and right")
@_speed_option
@_run_option
@_again_option
def turn(
    job: Job, turns: int, count: int, speed: float, runs: Tuple[str, ...], again: Tuple[int, ...]
) -> None:
    """Measure the slip offset Cs of tracks, or the wheelbase of wheels, by turning in place.

    The first two runs are one turn each, so that the number of turns in the others is known.

    \b
    Example:
      mrl calibrate turn --robot lab3.yaml --port /dev/ttyACM0 --turns 3
    """
    from mrl_driver.apps.calibration.geometry_procedures import TURN, turn_legs

    legs = turn_legs(count, turns, _speeds(speed))
    _geometry(CalibrationPlan(TURN, {"turns": turns, "count": count}, legs, runs, again), job)


@click.command(short_help="Measure wheel ratio, wheelbase and noise, by squares.")
@job_options
@click.option(
    "--side", type=Between(0.3, 10.0), default=1.0, show_default=True, help="Side of the square [m]."
)
@click.option("--laps", type=int, default=5, show_default=True, help="Laps in each direction, at least 2.")
@_speed_option
@_run_option
@_again_option
def umbmark(
    job: Job, side: float, laps: int, speed: float, runs: Tuple[str, ...], again: Tuple[int, ...]
) -> None:
    """Measure wheel ratio, wheelbase and noise, by squares in both directions (Borenstein and Feng 1996).

    \b
    Examples:
      mrl calibrate umbmark --robot lab3.yaml --port /dev/ttyACM0
      mrl calibrate umbmark --port /dev/pts/3 --truth truth.jsonl --laps 3 --yes     an emulated robot
    """
    from mrl_driver.apps.calibration.geometry_procedures import UMBMARK, umbmark_legs
    from mrl_driver.apps.calibration.umbmark import require_laps

    require_laps(laps, "counter-clockwise")
    settings = {"side_m": side, "laps": laps}
    legs = umbmark_legs(laps, side, _speeds(speed))
    _geometry(CalibrationPlan(UMBMARK, settings, legs, runs, again), job)


COMMANDS = (straight, turn, umbmark)
