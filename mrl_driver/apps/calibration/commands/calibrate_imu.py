"""`mrl calibrate imu`."""

import math
from functools import partial
from typing import Any, Dict, Iterable, List

import click

from mrl_driver.apps.calibration import calibration_plots, fit, geometry_procedures, imu_procedures
from mrl_driver.apps.calibration.imu_procedures import ImuOutcome, ImuPlan, ImuTrack
from mrl_driver.apps.calibration.manoeuvres import Speeds
from mrl_driver.cli.commands.shared import Between, print_message

from . import calibrate_job
from .calibrate_job import RUNS, TURNS, Job, Result, job_options, value_option
from .calibrate_view import console, ruler_for

IMU_PERIOD_MS = 20  # time between two readings of the IMU


@click.command(short_help="Measure the mounting angles of the IMU, and the scale of its gyro.")
@job_options
@value_option("--turns", TURNS, 3, "Whole turns per run.")
@value_option("--count", RUNS, 4, "Runs, alternately left and right.")
@value_option(
    "--distance",
    Between(0.0, 5.0),
    0.4,
    "Length of the straight drives [m]; 0 leaves them out, and the yaw of the mount stays as it is.",
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
    ruler, speeds = ruler_for(job.truth, heading_only=True), Speeds()
    plan = ImuPlan(geometry_procedures.turn_legs(count, turns, speeds), distance, speeds)
    with calibrate_job.robot_of(job, imu_period_ms=IMU_PERIOD_MS) as (driver, model, output):
        imu_procedures.require_imu(driver)
        drives = f"drives {distance:g} m forward and back, and turns" if distance else "turns"
        calibrate_job.confirm_drive(
            job, f"The robot {drives} in place. Does it stand on a level floor, with its path free?"
        )
        measured = fit.BY_TRUTH if job.truth else fit.BY_TAPE
        outcome = imu_procedures.calibrate(driver, ImuTrack(driver), ruler, plan, measured, console.print)
        if outcome.trouble:
            print_message(
                f"warning: {outcome.trouble}; imu.yaw_deg stays {outcome.after.yaw_deg:g}, measure it with a protractor"
            )
        values, lines, facts = imu_procedures.values_for(outcome), _lines(outcome), _facts(outcome)

        draw = partial(calibration_plots.draw_gyro, outcome=outcome)
        calibrate_job.finish(Result("imu", model, output, values, lines, facts, draw), job)


def _lines(outcome: ImuOutcome) -> List[str]:
    """Return lines about bias, noise, and the errors of the turns before and after."""
    rest = outcome.rest
    before, after = (
        _in_degrees(turn.error_rad(mount.gyro_scale) for turn in outcome.turns)
        for mount in (outcome.before, outcome.after)
    )
    return [
        f"gyro at rest, axes of the chip: bias {_in_degrees(rest.gyro_rad_s)} deg/s, "
        f"noise {_in_degrees(rest.gyro_sd_rad_s)} deg/s",
        f"errors of the turns before: {before} deg",
        f"errors of the turns after:  {after} deg",
    ]


def _in_degrees(values: Iterable[float]) -> str:
    return ", ".join(f"{math.degrees(value):.2f}" for value in values)


def _facts(outcome: ImuOutcome) -> Dict[str, Any]:
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
