"""`mrl calibrate imu`."""

import math
from typing import TYPE_CHECKING, Any, Dict, List

import click

from mrl_driver.cli.commands.shared import Between, print_json, print_message, warn

from . import calibrate_job
from .calibrate_job import Job, confirm_drive, job_options, model_of, output_for, write_yaml

if TYPE_CHECKING:
    from mrl_driver.apps.calibration.imu_procedures import ImuOutcome

IMU_PERIOD_MS = 20  # time between two readings of the IMU


@click.command(short_help="Measure the mounting angles of the IMU, and the scale of its gyro.")
@job_options
@click.option(
    "--turns", type=click.IntRange(1, 20), default=3, show_default=True, help="Whole turns per run."
)
@click.option(
    "--count",
    type=click.IntRange(2, 50),
    default=4,
    show_default=True,
    help="Runs, alternately left and right.",
)
@click.option(
    "--distance",
    type=Between(0.0, 5.0),
    default=0.4,
    show_default=True,
    help="Length of the straight drives [m]; 0 leaves them out, and the yaw of the mount stays as it is.",
)
def imu(job: Job, turns: int, count: int, distance: float) -> None:
    """Measure the mounting angles of the IMU, and the scale of its gyro.

    Needs a level floor with a straight line on it, such as a joint or a strip of tape.  The robot stands still, which
    gives bias, noise, and roll and pitch of the mount.  It drives forward and back, which gives the yaw.  Then it turns
    in place, counter-clockwise and clockwise; after each run you align it with the line again, by hand.  The gyro
    notices this too, so that the true angle is a number of whole turns.  The first two runs are one turn each.

    Takes 3 min; after Ctrl-C it starts from the beginning.

    \b
    Examples:
      mrl calibrate imu --robot traxbot-1.yaml --port /dev/ttyACM0
      mrl calibrate imu --port /dev/pts/3 --truth truth.jsonl --yes     an emulated robot
    """
    from mrl_driver.apps.calibration import fit, geometry_procedures, imu_procedures
    from mrl_driver.apps.calibration.manoeuvres import Speeds

    from .calibrate_view import console, ruler_for, show_values

    ruler, speeds = ruler_for(job.truth, heading_only=True), Speeds()
    plan = imu_procedures.ImuPlan(geometry_procedures.turn_legs(count, turns, speeds), distance, speeds)
    with calibrate_job.connect(job, imu_period_ms=IMU_PERIOD_MS) as driver:
        warn(driver)
        imu_procedures.require_imu(driver)
        model = model_of(driver)
        output = output_for(job, model, driver.board.robot_id)
        drives = f"drives {distance:g} m forward and back, and turns" if distance else "turns"
        confirm_drive(
            job, f"The robot {drives} in place. Does it stand on a level floor, with its path free?"
        )
        measured = fit.BY_TRUTH if job.truth else fit.BY_TAPE
        track = imu_procedures.ImuTrack(driver)
        outcome = imu_procedures.calibrate(driver, track, ruler, plan, measured, console.print)
        values = imu_procedures.values_for(outcome)
        if job.plot is not None:
            from mrl_driver.apps.calibration import calibration_plots

            calibration_plots.draw_gyro(job.plot, outcome)
        if outcome.trouble:
            print_message(
                f"warning: {outcome.trouble}; imu.yaw_deg stays {outcome.after.yaw_deg:g}, measure it with a protractor"
            )
        if job.as_json:
            print_json({"procedure": "imu", "output": output, **_facts(outcome)})
        else:
            for line in _lines(outcome):
                click.echo(line)
            show_values(model, values)
        write_yaml("imu", values, output, job, model)


def _lines(outcome: "ImuOutcome") -> List[str]:
    """Return lines about bias, noise, and the errors of the turns before and after."""
    bias, noise = (_degrees(each) for each in (outcome.rest.gyro_rad_s, outcome.rest.gyro_sd_rad_s))
    return [
        f"gyro at rest, axes of the chip: bias {_listed(bias)} deg/s, noise {_listed(noise)} deg/s",
        f"errors of the turns before: {_listed(_errors(outcome, outcome.before.gyro_scale))} deg",
        f"errors of the turns after:  {_listed(_errors(outcome, outcome.after.gyro_scale))} deg",
    ]


def _degrees(values: Any) -> List[float]:
    return [math.degrees(float(value)) for value in values]


def _listed(values: List[float]) -> str:
    return ", ".join(f"{value:.2f}" for value in values)


def _errors(outcome: "ImuOutcome", scale: float) -> List[float]:
    return [math.degrees(turn.error_rad(scale)) for turn in outcome.turns]


def _facts(outcome: "ImuOutcome") -> Dict[str, Any]:
    """Return the facts of the calibration as a mapping, for JSON."""
    yaw_sd = outcome.yaw_sd_rad
    return {
        "bias_rad_s": outcome.rest.gyro_rad_s.tolist(),
        "noise_rad_s": outcome.rest.gyro_sd_rad_s.tolist(),
        "gravity_m_s2": outcome.rest.accel_m_s2.tolist(),
        "mount_before": outcome.before._asdict(),
        "mount_after": outcome.after._asdict(),
        "yaw_sd_rad": None if math.isnan(yaw_sd) else yaw_sd,
        "turns": [turn._asdict() for turn in outcome.turns],
    }
