"""`mrl calibrate sonar` and `gains`."""

import contextlib
import csv
import io
import math
import os
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence, Tuple

import click

from mrl_driver.cli.commands.shared import print_json, print_message, warn
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.files import read_plain, replace_file
from mrl_driver.robot import models

from . import calibrate_job
from .calibrate_job import (
    Job,
    confirm_drive,
    job_options,
    model_of,
    offer_eeprom,
    output_for,
    recorded_model,
    write_yaml,
)

if TYPE_CHECKING:
    import numpy as np

    from mrl_driver.apps.calibration.bridge_gains import MotorFit
    from mrl_driver.apps.calibration.calibration_files import Key
    from mrl_driver.apps.calibration.gains import Response
    from mrl_driver.apps.calibration.part_procedures import SonarPlan
    from mrl_driver.driver import Driver
    from mrl_driver.robot.models import RobotModel
    from mrl_driver.robot.sonar_curve import Curve

Points = Tuple[List[float], List[float]]  # readings and distances [m]
_LONGEST_POINTS = 1 << 22  # longest file of points read [byte]; a calibration makes some thousand
_recording_option = click.option(
    "--recording", metavar="FILE", help="Instead of driving: a recording of this calibration."
)


@click.command(short_help="Measure the curve of the sonars, range_cm = a s^b + c.")
@job_options
@click.option(
    "--start",
    type=float,
    default=2.0,
    show_default=True,
    help="Distance of the front sonar from the wall at the start [m].",
)
@click.option("--stop", type=float, default=0.2, show_default=True, help="Smallest distance [m].")
@click.option(
    "--step", type=float, default=0.05, show_default=True, help="Distance between two readings [m]."
)
@click.option(
    "--points", metavar="FILE", help="Instead of driving: a file with lines of distance [m], reading [m]."
)
@_recording_option
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
    from mrl_driver.apps.calibration import part_procedures
    from mrl_driver.robot.sonar_curve import THESIS

    plan = part_procedures.SonarPlan(start, stop, step)
    plan.distances()
    if points is not None or recording is not None:
        model = recorded_model(job)
        output = output_for(job, model, None)
        readings = (
            read_points(points) if points is not None else _recorded_points(str(recording), model, start)
        )
        write_yaml("sonar", _fit_sonar(*readings, _model_curve(model) or THESIS, job), output, job, model)
        return
    with calibrate_job.connect(job) as driver:
        warn(driver)
        part_procedures.require_sonars(driver)
        model = model_of(driver)
        output = output_for(job, model, driver.board.robot_id)
        kept = f"{os.path.splitext(output)[0]}.sonar.csv"
        values = _fit_sonar(*_approach(driver, plan, kept, job), part_procedures.curve_in_force(driver), job)
        write_yaml("sonar", values, output, job, model)
        os.remove(kept)
        offer_eeprom(driver, values, job)


def _recorded_points(path: str, model: "RobotModel", start_m: float) -> Points:
    from mrl_driver.apps.calibration import from_recording, part_procedures

    rows = from_recording.read(path, model).rows
    return part_procedures.readings_at_stops(rows, model.differential, start_m)


def _approach(driver: "Driver", plan: "SonarPlan", kept: str, job: Job) -> Points:
    """Drive up to the wall, on from the readings in the file `kept`, and add the new ones to it."""
    from mrl_driver.apps.calibration.manoeuvres import Speeds, Track
    from mrl_driver.apps.calibration.part_procedures import approach_wall, readings_at_stops

    from .calibrate_view import console

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
    confirm_drive(
        job,
        f"The robot drives {remaining[0] - remaining[-1]:.2f} m forward. Does the front sonar point at a wall "
        f"{remaining[0]:.2f} m away, and is the path free?",
    )

    def keep(rows: "np.ndarray") -> None:
        nonlocal readings
        ranges, distances = readings_at_stops(rows, model_of(driver).differential, remaining[0])
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
    """Write the sonar's readings so far, in the format that `_points` reads."""
    rows = [
        f"{distance:.4f},{'-' if math.isnan(reading) else f'{reading:.4f}'}\n"
        for reading, distance in zip(ranges, distances)
    ]
    replace_file(path, "# distance [m], reading [m]; from mrl calibrate sonar\n" + "".join(rows))


def _model_curve(model: "RobotModel") -> Optional["Curve"]:
    """Return the model's own curve; None if it has none."""
    from mrl_driver.robot.sonar_curve import Curve

    coefficients = [model.board.get(name) for name in models.CURVE_KEYS]
    if None in coefficients:
        return None
    return Curve(*(float(value) / 1e4 for value in coefficients if value is not None))


def read_points(path: str) -> Points:
    """Return the readings and distances [m] from a file; `-` or `inf` means no reading.

    Raises:
        ConfigError: the file cannot be read, or a line is invalid; the error names the line.
    """
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


def _fit_sonar(ranges: List[float], distances: List[float], present: "Curve", job: Job) -> Dict["Key", float]:
    """Fit the curve, show the errors before and after, draw; return the values for the YAML file."""
    import numpy as np

    from mrl_driver.apps.calibration import part_procedures
    from mrl_driver.robot import sonar_curve

    reading, truth = np.array(ranges), np.array(distances)
    counts = present.counts(reading)
    fit = sonar_curve.fit(counts.tolist(), distances)
    wire = fit.curve.on_wire()
    if job.plot is not None:
        from mrl_driver.apps.calibration import calibration_plots

        calibration_plots.draw_sonar(job.plot, counts, truth, fit)
    off_m = float(np.abs(reading - truth)[fit.used].max())
    if job.as_json:
        print_json(
            {"before": present._asdict(), "after": wire._asdict(), "r2": fit.r2, "worst_m": fit.worst_m}
        )
    else:
        click.echo(f"before: {_formula(present)}, worst error {off_m * 100:.1f} cm")
        click.echo(
            f"after:  {_formula(wire)}, worst error {fit.worst_m * 100:.1f} cm, R2 {fit.r2:.5f}, {len(truth)} distances"
        )
    return {("board", name): value for name, value in part_procedures.curve_values(fit.curve).items()}


def _formula(curve: "Curve") -> str:
    return f"{curve.a:.4f} s^{curve.b:.4f} {curve.c:+.4f}"


@click.command()
@job_options
@_recording_option
def gains(job: Job, recording: Optional[str]) -> None:
    """Measure the gains of the motors' speed control.

    Asks, then turns the robot in place, for 1 to 1.5 s each: three times, or five times with an H-bridge board.  It
    evaluates how the wheels speed up.  The floor around the robot must be free.  At the end the board has its former
    gains again.  Takes 10 to 15 s; after Ctrl-C it starts from the beginning.

    With an H-bridge board it also measures full_speed and friction_duty, and suggests kp and ki by lambda tuning.
    Charge the battery first: full_speed is that of the present voltage.

    \b
    Example:
      mrl calibrate gains --port /dev/ttyACM0 --plot gains.png
    """
    from mrl_driver.apps.calibration import bridge_procedures

    if recording is not None:
        model = recorded_model(job)
        output = output_for(job, model, None)
        _write_gains(_recorded_gains(recording, model), output, job, model)
        return
    with calibrate_job.connect(job) as driver:
        warn(driver)
        model = model_of(driver)
        output = output_for(job, model, driver.board.robot_id)
        on_bridge = bridge_procedures.CAPABILITY in driver.board.capabilities
        times = "five" if on_bridge else "three"
        confirm_drive(job, f"The robot turns in place {times} times, quickly. Is the floor around it free?")
        wanted = _tune_bridge(driver, model, job) if on_bridge else _tune(driver, model, job)
        offer_eeprom(driver, _write_gains(wanted, output, job, model), job)


def _recorded_gains(recording: str, model: "RobotModel") -> Mapping[str, int]:
    """Show the recorded motors, and return the gains for them."""
    from mrl_driver.apps.calibration import bridge_procedures, part_procedures

    if model.board.get("bridge"):
        motors, found = bridge_procedures.recorded(recording, model)
        _show_motors(motors, model)
        return found._asdict()
    plants, wanted = part_procedures.recorded_gains(recording, model)
    for name, plant in zip(("right", "left"), plants):
        click.echo(f"{name} motor: {plant.full_counts_s:.0f} count/s, {plant.time_constant_s * 1000:.0f} ms")
    return wanted._asdict()


def _tune(driver: "Driver", model: "RobotModel", job: Job) -> Mapping[str, int]:
    from mrl_driver.apps.calibration import part_procedures
    from mrl_driver.apps.calibration.gains import Gains
    from mrl_driver.apps.calibration.manoeuvres import Track

    from .calibrate_view import console

    present = part_procedures.gains_in_force(driver, Gains(*(model.board[name] for name in Gains._fields)))
    tuned = part_procedures.tune(driver, Track(driver), present, console.print)
    found = {
        when: {name: steps.response(name == "left") for name in ("left", "right")}
        for when, steps in (("before", tuned.steps_before), ("after", tuned.steps_after))
    }
    _report_gains(tuned, found, job)
    return tuned.after._asdict()


def _tune_bridge(driver: "Driver", model: "RobotModel", job: Job) -> Mapping[str, int]:
    from mrl_driver.apps.calibration import bridge_procedures
    from mrl_driver.apps.calibration.manoeuvres import Track

    from .calibrate_view import console

    tuned = bridge_procedures.tune(driver, model, Track(driver), console.print)
    if not job.as_json:
        _show_motors(tuned.motors, model)
    found = {
        when: {name: tuned.response(steps, name == "left") for name in ("left", "right")}
        for when, steps in (("before", tuned.steps_before), ("after", tuned.steps_after))
    }
    _report_gains(tuned, found, job)
    return tuned.after._asdict()


def _show_motors(motors: Sequence["MotorFit"], model: "RobotModel") -> None:
    """Print the motors of an H-bridge board, and a warning if their speed is not a line over the duty."""
    from mrl_driver.apps.calibration import bridge_gains, bridge_procedures

    a_turn = bridge_procedures.counts_per_turn(model)
    for name, motor in zip(("right", "left"), motors):
        full_rpm = motor.full_counts_s * 60 / a_turn
        click.echo(
            f"{name} motor: turns from {motor.dead_band:.1%} duty, {full_rpm:.0f} 1/min at full duty, "
            f"time constant {motor.time_constant_s * 1000:.0f} ms"
        )
        if motor.off_line > bridge_gains.LINEAR_WITHIN:
            print_message(
                f"warning: the speed of the {name} motor is up to {motor.off_line:.0%} of full speed off a line "
                "over the duty; check the battery, the bridge and the gearbox"
            )


def _write_gains(wanted: Mapping[str, int], output: str, job: Job, model: "RobotModel") -> Dict["Key", float]:
    """Show the gains, and write them into the robot's YAML file; return the values for it."""
    from .calibrate_view import show_values

    values: Dict[Key, float] = {("board", name): value for name, value in wanted.items()}
    if not job.as_json:
        show_values(model, values)
    write_yaml("gains", values, output, job, model)
    return values


def _report_gains(tuned: Any, found: Mapping[str, Mapping[str, "Response"]], job: Job) -> None:
    """Show the steps before and after, and draw them."""
    from .calibrate_view import response_line

    if job.plot is not None:
        from mrl_driver.apps.calibration import calibration_plots

        calibration_plots.draw_gains(job.plot, tuned)
    if job.as_json:
        plain = {when: {name: one._asdict() for name, one in each.items()} for when, each in found.items()}
        print_json({"gains_before": tuned.before._asdict(), "gains_after": tuned.after._asdict(), **plain})
        return
    for when, each in found.items():
        for name, one in each.items():
            click.echo(response_line(f"{when}, {name} wheel", one))


COMMANDS = (gains, sonar)
