"""Shared parts of all calibrations: options, output files, the board's EEPROM."""

import functools
import os
from typing import TYPE_CHECKING, Any, Callable, ContextManager, Dict, Mapping, NamedTuple, Optional

import click

from mrl_driver.cli.commands.shared import (
    battery_option,
    confirm,
    confirm_motion,
    confirm_overwrite,
    connected,
    json_option,
    print_message,
    robot_options,
    yes_option,
)
from mrl_driver.errors import ConfigError
from mrl_driver.host.named_robots import Target
from mrl_driver.robot import models

if TYPE_CHECKING:
    from mrl_driver.apps.calibration.calibration_files import Key, Progress
    from mrl_driver.driver import Driver
    from mrl_driver.robot.models import RobotModel


class Job(NamedTuple):
    """The options that all calibrations share."""

    target: Target
    output: Optional[str]
    truth: Optional[str]
    plot: Optional[str]
    restart: bool
    eeprom: Optional[bool]
    yes: bool
    as_json: bool
    ignore_battery: bool
    record: Optional[str]


def job_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options that all calibrations share; the command gets them as `job`."""

    @robot_options
    @click.option(
        "--output",
        metavar="FILE",
        type=click.Path(),
        help="YAML file to write; by default the robot's own, if it has one.",
    )
    @click.option(
        "--truth", metavar="FILE", help="File of mrl-sim --truth with the true poses of an emulated robot."
    )
    @click.option("--plot", metavar="FILE", help="Draw the result; needs matplotlib.")
    @click.option("--restart", is_flag=True, help="Discard the runs of an interrupted calibration.")
    @click.option(
        "--eeprom/--no-eeprom",
        default=None,
        help="Write the board's EEPROM too, or not; default: ask.",
    )
    @click.option("--record", metavar="FILE", type=click.Path(), help="Record all bytes of both directions.")
    @battery_option
    @yes_option
    @json_option
    @functools.wraps(command)
    def wrapper(*args: Any, **options: Any) -> None:
        job = Job(**{name: options.pop(name) for name in Job._fields})
        if job.plot is not None:
            from mrl_driver import figures

            figures.require_writable(job.plot)
        if job.output is not None:
            from mrl_driver.apps.calibration.calibration_files import require_writable

            require_writable(job.output)
        confirm_overwrite(job.record, job.yes)
        command(*args, job=job, **options)

    return wrapper


def connect(job: Job, **options: Any) -> ContextManager["Driver"]:
    """Connect to the robot; tests replace this by a robot in simulated time.

    The IMU is off, unless the options turn it on: what is measured is the odometry of the wheels alone.
    """
    options = {"imu_period_ms": 0, "moves": True, **options}
    return connected(
        job.target, ignore_battery=job.ignore_battery, record=job.record, command_timeout_s=0.5, **options
    )


def confirm_drive(job: Job, question: str) -> None:
    """Ask before motors turn; emulated robots (--truth) drive without a question.

    Raises:
        ConfigError, click.Abort: as `confirm`.
    """
    confirm_motion(question, job.yes or job.truth is not None)


def recorded_model(job: Job) -> "RobotModel":
    """Return the model of the recorded robot.

    Raises:
        ConfigError: --robot is missing.
    """
    if job.target.model == "auto":
        raise ConfigError(
            "--robot is missing, expected the model or .yaml file of the robot that was recorded"
        )
    return models.load(job.target.model)


def model_of(driver: "Driver") -> "RobotModel":
    """Return the model of a connected robot."""
    assert driver.model is not None
    return driver.model


def output_for(job: Job, model: "RobotModel", robot_id: Optional[int]) -> str:
    """Return the YAML file to write: --output, or the robot's own file, or one named after model and id.

    Raises:
        ConfigError: it would replace a file that is not the robot's own.
    """
    from mrl_driver.apps.calibration.calibration_files import require_writable

    own = job.target.model if job.target.model.endswith((".yaml", ".yml")) else None
    if job.output is None and own is None and robot_id is None:
        raise ConfigError("--output is missing, expected the .yaml file to write")
    output = job.output or own or f"{model.name}-{robot_id}.yaml"
    require_writable(output)
    if os.path.exists(output) and (own is None or not os.path.samefile(own, output)):
        raise ConfigError(
            f"{output} already exists: continue from it with --robot {output}, or give another file with --output"
        )
    return output


def open_progress(output: str, model: "RobotModel", robot_id: int) -> "Progress":
    """Return the runs so far, from a file next to the output."""
    from mrl_driver.apps.calibration.calibration_files import Progress

    return Progress(f"{os.path.splitext(output)[0]}.calibration.json", f"{model.name} {robot_id}")


def write_yaml(
    procedure: str, values: Mapping["Key", float], output: str, job: Job, model: "RobotModel"
) -> None:
    """Write the robot's YAML after asking."""
    from mrl_driver.apps.calibration import calibration_files

    confirm(f"Write {output}?", job.yes)
    source = job.target.model if job.target.model != "auto" else model.name
    kept = calibration_files.write_model(
        calibration_files.source_of(source), output, values, f"mrl calibrate {procedure}"
    )
    print_message(
        f"{output} is written{f', the old file is {kept}' if kept else ''}; use it with --robot {output}"
    )


def offer_eeprom(driver: "Driver", values: Mapping["Key", float], job: Job) -> None:
    """Write the board parameters to its EEPROM, if --eeprom was given or the user agrees.

    Raises:
        BoardRefused: --eeprom was given, but the board keeps no configuration or refused a value.
    """

    from .calibrate_view import confirm_here

    wanted: Dict[str, int] = {
        name: int(value) for (section, name), value in values.items() if section == "board"
    }
    if not wanted or job.eeprom is False or (job.eeprom is None and not driver.parameters.can_save):
        return
    listed = ", ".join(f"{name} {value}" for name, value in wanted.items())
    if job.eeprom or confirm_here(f"Write {listed} to the board's EEPROM?", False):
        driver.parameters.write(wanted)
        driver.parameters.save()
        print_message(f"the board's EEPROM has {listed}")
