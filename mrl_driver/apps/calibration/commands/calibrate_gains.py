"""`mrl calibrate gains`."""

from functools import partial
from typing import Any, Dict, List, Optional, Sequence

import click

from mrl_driver.apps.calibration import calibration_plots, gain_procedures
from mrl_driver.apps.calibration.bridge_gains import LINEAR_WITHIN, MotorFit
from mrl_driver.apps.calibration.calibration_files import Key
from mrl_driver.apps.calibration.gain_procedures import Tuned, counts_per_turn
from mrl_driver.apps.calibration.manoeuvres import Track
from mrl_driver.cli.commands.shared import print_message
from mrl_driver.robot.models import RobotModel

from . import calibrate_job
from .calibrate_job import Job, Result, job_options
from .calibrate_view import console


@click.command()
@job_options
@calibrate_job.recording_option
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
    if recording is not None:
        model = calibrate_job.recorded_model(job)
        output = calibrate_job.output_for(job, model)
        motors, wanted = gain_procedures.recorded(recording, model)
        lines, facts = _motor_lines(motors, model), {"gains_after": wanted._asdict()}
        calibrate_job.finish(Result("gains", model, output, _values(wanted), lines, facts), job)
        return
    with calibrate_job.robot_of(job) as (driver, model, output):
        on_bridge = gain_procedures.CAPABILITY in driver.board.capabilities
        times = "five" if on_bridge else "three"
        calibrate_job.confirm_drive(
            job, f"The robot turns in place {times} times, quickly. Is the floor around it free?"
        )
        tune = gain_procedures.tune_bridge if on_bridge else gain_procedures.tune
        tuned = tune(driver, model, Track(driver), console.print)
        result = _result(tuned, model, output)
        calibrate_job.finish(result, job)
        calibrate_job.offer_eeprom(driver, result.values, job)


def _result(tuned: Tuned, model: RobotModel, output: str) -> Result:
    lines, plain = _motor_lines(tuned.motors, model), {}
    for when, wheels in tuned.responses().items():
        lines += [
            f"{when}, {wheel} wheel: rises in {each.rise_s * 1000:.0f} ms, overshoots {each.overshoot:.1%}, "
            f"settles after {each.settle_s * 1000:.0f} ms, mean error {each.offset:.1%}"
            for wheel, each in wheels.items()
        ]
        plain[when] = {wheel: each._asdict() for wheel, each in wheels.items()}
    facts = {"gains_before": tuned.before._asdict(), "gains_after": tuned.after._asdict(), **plain}

    draw = partial(calibration_plots.draw_gains, tuned=tuned)
    return Result("gains", model, output, _values(tuned.after), lines, facts, draw)


def _values(wanted: Any) -> Dict[Key, float]:
    return {("board", name): value for name, value in wanted._asdict().items()}


def _motor_lines(motors: Sequence[Any], model: RobotModel) -> List[str]:
    """Return lines about the motors; warn if their speed is not a line over the duty."""
    lines = []
    for name, motor in zip(("right", "left"), motors):
        if isinstance(motor, MotorFit):
            full_rpm = motor.full_counts_s * 60 / counts_per_turn(model)
            figures = f"turns from {motor.dead_band:.1%} duty, {full_rpm:.0f} 1/min at full duty"
            if motor.off_line > LINEAR_WITHIN:
                print_message(
                    f"warning: the speed of the {name} motor is up to {motor.off_line:.0%} of full speed off a line "
                    "over the duty; check the battery, the bridge and the gearbox"
                )
        else:
            figures = f"{motor.full_counts_s:.0f} count/s at full duty"
        lines.append(f"{name} motor: {figures}, time constant {motor.time_constant_s * 1000:.0f} ms")
    return lines
