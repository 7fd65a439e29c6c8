"""`mrl calibrate wiring`, `sonar` and `gains`."""

import contextlib
import csv
import math
import os
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence, Tuple

import click

from mrl_driver.errors import ConfigError, MrlError, WheelFault
from mrl_driver.files import replace_file
from mrl_driver.robot import models

from . import calibrate_job
from .calibrate_job import (
    Job,
    agree_to_drive,
    job_options,
    model_of,
    offer_eeprom,
    output_for,
    recorded_model,
    write_yaml,
)
from .shared import complain, say_json, warn

if TYPE_CHECKING:
    import numpy as np

    from mrl_driver.calibration.files import Key
    from mrl_driver.calibration.sonar_curve import Curve
    from mrl_driver.robot.models import RobotModel

_recording_option = click.option(
    "--recording", metavar="FILE", help="A recording of this calibration, instead of driving."
)


@click.command()
@job_options
@click.option("--unseen", is_flag=True, help="Nobody looks: tell less, do not ask which wheel turned.")
@_recording_option
def wiring(job: Job, unseen: bool, recording: Optional[str]) -> None:
    """Find swapped or reversed wires of motors and encoders.

    Asks, then turns each wheel forward for half a second.  Put the robot on a box, or give it half a metre.

    \b
    Example:
      mrl calibrate wiring --port /dev/ttyACM0
    """
    from mrl_driver.calibration import parts
    from mrl_driver.calibration.manoeuvres import Track

    from .calibrate_view import NoTape, looker_for, require_terminal, ruler_for

    if recording is not None:
        found = parts.recorded_wiring(recording, recorded_model(job))
    else:
        if job.truth is None and not unseen:
            require_terminal("--unseen, so that nobody is asked which wheel turned")
        ruler = ruler_for(job.truth) if job.truth is not None else NoTape()
        with calibrate_job.connect(job) as driver:
            warn(driver)
            agree_to_drive(
                job, "Each wheel turns forward for half a second. Is the robot on a box, or its way free?"
            )
            found = parts.check_wiring(driver, Track(driver), ruler, looker_for(job.truth, unseen))
    if job.as_json:
        say_json({"findings": found})
    if found:
        raise WheelFault("; ".join(found))
    if not job.as_json:
        click.echo("motors and encoders are wired right")


@click.command(short_help="Curve of the sonars, range_cm = a s^b + c.")
@job_options
@click.option(
    "--start",
    type=float,
    default=2.0,
    show_default=True,
    help="Distance of the front sonar from the wall at first [m].",
)
@click.option("--stop", type=float, default=0.2, show_default=True, help="The nearest distance [m].")
@click.option("--step", type=float, default=0.05, show_default=True, help="So much nearer each time [m].")
@click.option("--points", metavar="FILE", help="Lines of distance [m], reading [m], instead of driving.")
@_recording_option
def sonar(
    job: Job, start: float, stop: float, step: float, points: Optional[str], recording: Optional[str]
) -> None:
    """Curve of the sonars, range_cm = a s^b + c, with a flat wall ahead.

    Asks, then drives up to the wall by its odometry, so calibrate straight comes first.

    \b
    Examples:
      mrl calibrate sonar --robot lab3.yaml --port /dev/ttyACM0 --start 2
      mrl calibrate sonar --robot lab3.yaml --points wall.csv --plot curve.png
    """
    from mrl_driver.calibration import parts
    from mrl_driver.calibration.manoeuvres import Speeds, Track
    from mrl_driver.calibration.sonar_curve import THESIS

    from .calibrate_view import console

    plan = parts.SonarPlan(start, stop, step)
    plan.distances()
    if points is not None or recording is not None:
        model = recorded_model(job)
        output = output_for(job, model, None)
        if points is not None:
            ranges, distances = _points(points)
        else:
            from mrl_driver.calibration import from_recording

            ranges, distances = parts.stands(
                from_recording.read(str(recording), model).rows, model.differential, start
            )
        values = _fit_sonar(ranges, distances, _told_curve(model) or THESIS, job)
        write_yaml("sonar", values, output, job, model)
        return
    with calibrate_job.connect(job) as driver:
        warn(driver)
        model = model_of(driver)
        output = output_for(job, model, driver.board.robot_id)
        kept = f"{os.path.splitext(output)[0]}.sonar.csv"
        if job.restart and os.path.exists(kept):
            os.remove(kept)
        ranges, distances = _points(kept) if os.path.exists(kept) else ([], [])
        left = [each for each in plan.distances() if each < min(distances, default=math.inf) - step / 2]
        if distances:
            console.print(
                f"{len(distances)} of {len(distances) + len(left)} distances are there already, in {kept}"
            )
        if left:
            agree_to_drive(
                job,
                f"The robot drives ahead by {left[0] - left[-1]:.2f} m. Does its front sonar look at a flat wall "
                f"{left[0]:.2f} m away, and is the way free?",
            )
            before = list(ranges), list(distances)

            def keep(rows: "np.ndarray") -> None:
                heard = parts.stands(rows, model.differential, left[0])
                ranges[:], distances[:] = before[0] + heard[0], before[1] + heard[1]
                _keep_points(kept, ranges, distances)

            try:
                parts.approach_wall(driver, Track(driver), left, Speeds(), console.print, keep)
            except BaseException:
                with contextlib.suppress(MrlError):
                    driver.stop()
                if distances:
                    complain(f"{len(distances)} distances are kept in {kept}; the same command goes on")
                raise
        values = _fit_sonar(ranges, distances, parts.curve_in_force(driver), job)
        write_yaml("sonar", values, output, job, model)
        os.remove(kept)
        offer_eeprom(driver, values, job)


def _keep_points(path: str, ranges: Sequence[float], distances: Sequence[float]) -> None:
    """Write the sonar's readings so far, in the format that `_points` reads."""
    rows = [
        f"{distance:.4f},{'-' if math.isnan(said) else f'{said:.4f}'}\n"
        for said, distance in zip(ranges, distances)
    ]
    replace_file(path, "# distance [m], reading [m]; from mrl calibrate sonar\n" + "".join(rows))


def _told_curve(model: "RobotModel") -> Optional["Curve"]:
    """Return the model's own curve; None without one."""
    from mrl_driver.calibration.sonar_curve import Curve

    told = [model.board.get(name) for name in models.CURVE_KEYS]
    return None if None in told else Curve(*(float(value) / 1e4 for value in told if value is not None))


def _points(path: str) -> Tuple[List[float], List[float]]:
    """Return the readings and distances [m] from a file; `-` or `inf` means no reading.

    Raises:
        ConfigError: the file cannot be read, or a line is invalid; the error names the line.
    """
    ranges, distances = [], []
    try:
        with open(path, encoding="utf-8", newline="") as file:
            for number, row in enumerate(csv.reader(file), 1):
                if not row or row[0].lstrip().startswith("#"):
                    continue
                try:
                    distance, said = float(row[0]), math.nan if row[1].strip() == "-" else float(row[1])
                except (ValueError, IndexError):
                    raise ConfigError(
                        f"{path}:{number}: got {','.join(row)[:40]!r}, expected distance,reading in metres"
                    ) from None
                distances.append(distance)
                ranges.append(said if math.isfinite(said) else math.nan)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} cannot be read: {error}") from None
    return ranges, distances


def _fit_sonar(ranges: List[float], distances: List[float], present: "Curve", job: Job) -> Dict["Key", float]:
    """Fit the curve, show the errors before and after, draw; return the values for the YAML file."""
    import numpy as np

    from mrl_driver.calibration import parts, sonar_curve

    said, truth = np.array(ranges), np.array(distances)
    counts = present.counts(said)
    fit = sonar_curve.fit(counts.tolist(), distances)
    wire = fit.curve.on_wire()
    if job.plot is not None:
        from mrl_driver.calibration import plots

        plots.draw_sonar(job.plot, counts, truth, fit)
    off_m = float(np.abs(said - truth)[fit.used].max())
    if job.as_json:
        say_json({"before": present._asdict(), "after": wire._asdict(), "r2": fit.r2, "worst_m": fit.worst_m})
    else:
        click.echo(f"before: {_spelt(present)}, worst error {off_m * 100:.1f} cm")
        click.echo(
            f"after:  {_spelt(wire)}, worst error {fit.worst_m * 100:.1f} cm, R2 {fit.r2:.5f}, {len(truth)} distances"
        )
    return {("board", name): value for name, value in parts.curve_values(fit.curve).items()}


def _spelt(curve: "Curve") -> str:
    return f"{curve.a:.4f} s^{curve.b:.4f} {curve.c:+.4f}"


@click.command()
@job_options
@_recording_option
def gains(job: Job, recording: Optional[str]) -> None:
    """Gains of the motors' speed control, from a step of each wheel.

    Asks, then turns the robot in place, three times for a second and a half, on a free floor; the gains in force come
    back at the end.  It takes 10 s: after Ctrl-C it begins again.

    \b
    Example:
      mrl calibrate gains --port /dev/ttyACM0 --plot gains.png
    """
    from mrl_driver.calibration import parts
    from mrl_driver.calibration.gains import Gains
    from mrl_driver.calibration.manoeuvres import Track

    from .calibrate_view import console

    if recording is not None:
        model = recorded_model(job)
        output = output_for(job, model, None)
        plants, wanted = parts.recorded_gains(recording, model)
        for name, plant in zip(("right", "left"), plants):
            click.echo(
                f"{name} motor: {plant.full_counts_s:.0f} count/s, {plant.time_constant_s * 1000:.0f} ms"
            )
        values = _gain_values(wanted)
        _show(values, model, job)
        write_yaml("gains", values, output, job, model)
        return
    with calibrate_job.connect(job) as driver:
        warn(driver)
        model = model_of(driver)
        output = output_for(job, model, driver.board.robot_id)
        agree_to_drive(job, "The robot turns in place three times, quickly. Is the floor around it free?")
        present = Gains(*(model.board[name] for name in Gains._fields))
        tuned = parts.tune(driver, Track(driver), parts.gains_in_force(driver, present), console.print)
        _report_gains(tuned, job)
        values = _gain_values(tuned.after)
        _show(values, model, job)
        write_yaml("gains", values, output, job, model)
        offer_eeprom(driver, values, job)


def _gain_values(wanted: Any) -> Dict["Key", float]:
    return {("board", name): value for name, value in wanted._asdict().items()}


def _show(values: Mapping["Key", float], model: "RobotModel", job: Job) -> None:
    from .calibrate_view import show_values

    if not job.as_json:
        show_values(model, values)


def _report_gains(tuned: Any, job: Job) -> None:
    from .calibrate_view import say_response

    if job.plot is not None:
        from mrl_driver.calibration import plots

        plots.draw_gains(job.plot, tuned)
    steps = {"before": tuned.steps_before, "after": tuned.steps_after}
    found = {
        when: {name: each.response(name == "left") for name in ("left", "right")}
        for when, each in steps.items()
    }
    if job.as_json:
        plain = {when: {name: one._asdict() for name, one in each.items()} for when, each in found.items()}
        say_json({"gains_before": tuned.before._asdict(), "gains_after": tuned.after._asdict(), **plain})
        return
    for when, each in found.items():
        for name, one in each.items():
            click.echo(say_response(f"{when}, {name} wheel", one))


COMMANDS = (wiring, gains, sonar)
