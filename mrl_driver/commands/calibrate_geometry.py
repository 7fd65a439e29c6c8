"""`mrl calibrate straight`, `turn` and `umbmark`."""

from typing import TYPE_CHECKING, Any, Callable, List, Mapping, Sequence, Tuple

import click

from ..errors import ConfigError
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
from .shared import say_json, warn

if TYPE_CHECKING:
    from ..calibration.procedures import Leg, Outcome
    from ..calibration.run import Run
    from ..calibration.store import Key
    from ..driver import Driver
    from ..robots import RobotModel


def _geometry(
    procedure: str, settings: Mapping[str, float], legs: Callable[[], List["Leg"]], job: Job, runs: Any
) -> None:
    """One calibration of geometry, driven or from recordings."""
    if runs:
        _from_recordings(procedure, settings, job, runs)
        return
    with calibrate_job.connect(job) as driver:
        warn(driver)
        _driven(procedure, settings, legs(), job, driver)


def _driven(
    procedure: str, settings: Mapping[str, float], legs: List["Leg"], job: Job, driver: "Driver"
) -> None:
    from ..calibration import fit, procedures
    from .calibrate_view import console, ruler_for

    model = model_of(driver)
    output = output_for(job, model, driver.board.robot_id)
    progress = open_progress(output, model, driver.board.robot_id)
    if job.restart:
        progress.forget(procedure)
    done = progress.runs(procedure, settings)
    if done:
        console.print(f"{len(done)} of {len(legs)} runs are there already, in {progress.path}")
    procedures.gather(
        driver, legs[len(done) :], ruler_for(job.truth), lambda run: progress.add(procedure, settings, run)
    )
    runs = progress.runs(procedure, settings)
    measured = fit.BY_TRUTH if job.truth else fit.BY_TAPE
    side_m = settings.get("side_m", 1.0)
    outcome = procedures.evaluate(procedure, runs, model, side_m, measured, progress.other_runs(procedure))
    values = procedures.values_for(model, outcome)
    if report(procedure, outcome, runs, model, values, output, job):
        progress.finish(procedure)
        offer_eeprom(driver, values, job)


def _from_recordings(procedure: str, settings: Mapping[str, float], job: Job, given: Sequence[str]) -> None:
    from ..calibration import procedures, replayed
    from ..calibration.measure import parse_pose

    model = recorded_model(job)
    output = output_for(job, model, None)
    runs = []
    for text in given:
        path, colon, end = text.rpartition(":")
        if not colon:
            raise ConfigError(f"--run {text}: expected FILE:X,Y or FILE:X,Y,HEADING, in metres and degrees")
        run = replayed.run_of(path, parse_pose(end), model)
        procedures.check_recorded(procedure, model.drive, run, path)
        runs.append(run)
    outcome = procedures.evaluate(procedure, runs, model, settings.get("side_m", 1.0))
    report(procedure, outcome, runs, model, procedures.values_for(model, outcome), output, job)


def report(
    procedure: str,
    outcome: "Outcome",
    runs: List["Run"],
    model: "RobotModel",
    values: Mapping["Key", float],
    output: str,
    job: Job,
) -> bool:
    """Show before and after, draw, write the YAML if that is wanted; whether it was written."""
    from .calibrate_view import facts_of, say_outcome, show_values

    if job.plot is not None:
        from ..calibration import plots, run

        senses = [run.sense(outcome.after, each) for each in runs]
        plots.draw_ends(job.plot, outcome.errors_before, outcome.errors_after, senses)
    if job.as_json:
        say_json({"procedure": procedure, "output": output, **facts_of(outcome)})
    else:
        for line in say_outcome(outcome):
            click.echo(line)
        show_values(model, values)
    return write_yaml(procedure, values, output, job, model)


_run_option = click.option(
    "--run",
    "runs",
    multiple=True,
    metavar="FILE:X,Y[,DEG]",
    help="A recording of one run and where it ended, instead of driving; one each.",
)
_speed_option = click.option(
    "--speed", type=click.FloatRange(0.03, 1.0), default=0.2, show_default=True, help="Speed [m/s]."
)


def _speeds(speed: float) -> Any:
    from ..calibration.driving import Speeds

    return Speeds(linear_m_s=speed)


@click.command()
@job_options
@click.option("--distance", type=click.FloatRange(0.3, 20.0), default=2.0, show_default=True, help="Way [m].")
@click.option(
    "--count", type=click.IntRange(2, 50), default=4, show_default=True, help="Runs, there and back in turn."
)
@_speed_option
@_run_option
def straight(job: Job, distance: float, count: int, speed: float, runs: Tuple[str, ...]) -> None:
    """Counts per metre, and the left/right offset Cm.

    \b
    Examples:
      mrl calibrate straight --port /dev/ttyACM0 --distance 3
      mrl calibrate straight --robot traxbot --output lab3.yaml --run a.mrl:2.01,0.02 --run b.mrl:2.0,0.03
    """
    from ..calibration.procedures import STRAIGHT, straight_legs

    settings = {"distance_m": distance, "count": count}
    _geometry(STRAIGHT, settings, lambda: straight_legs(count, distance, _speeds(speed)), job, runs)


@click.command()
@job_options
@click.option(
    "--turns", type=click.IntRange(1, 20), default=2, show_default=True, help="Whole turns of a run."
)
@click.option(
    "--count", type=click.IntRange(2, 50), default=6, show_default=True, help="Runs, left and right in turn."
)
@_speed_option
@_run_option
def turn(job: Job, turns: int, count: int, speed: float, runs: Tuple[str, ...]) -> None:
    """Slip offset Cs of tracks, or the wheelbase of wheels, by turning in place.

    The first two runs are one turn, so that the others cannot be miscounted.

    \b
    Example:
      mrl calibrate turn --robot lab3.yaml --port /dev/ttyACM0 --turns 3
    """
    from ..calibration.procedures import TURN, turn_legs

    _geometry(
        TURN, {"turns": turns, "count": count}, lambda: turn_legs(count, turns, _speeds(speed)), job, runs
    )


@click.command()
@job_options
@click.option(
    "--side", type=click.FloatRange(0.3, 10.0), default=1.0, show_default=True, help="Side of the square [m]."
)
@click.option("--laps", type=int, default=5, show_default=True, help="Laps each way round, 2 or more.")
@_speed_option
@_run_option
def umbmark(job: Job, side: float, laps: int, speed: float, runs: Tuple[str, ...]) -> None:
    """Wheel ratio, wheelbase and noise, by squares both ways round (Borenstein and Feng 1996).

    \b
    Examples:
      mrl calibrate umbmark --robot lab3.yaml --port /dev/ttyACM0
      mrl calibrate umbmark --port /dev/pts/3 --truth truth.jsonl --laps 3 --yes     an emulated robot
    """
    from ..calibration.procedures import UMBMARK, umbmark_legs
    from ..calibration.umbmark import demand_laps

    demand_laps(laps, "counter-clockwise")
    settings = {"side_m": side, "laps": laps}
    _geometry(UMBMARK, settings, lambda: umbmark_legs(laps, side, _speeds(speed)), job, runs)


COMMANDS = (straight, turn, umbmark)
