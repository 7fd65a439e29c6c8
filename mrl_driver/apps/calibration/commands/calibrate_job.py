"""Shared parts of all calibrations: options, connection, output files, the result, the board's EEPROM."""

import contextlib
import functools
import os
from typing import (
    Any,
    Callable,
    ContextManager,
    Dict,
    Iterator,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
)

import click

from mrl_driver import figures
from mrl_driver.apps.calibration.calibration_files import Key, require_writable, write_model
from mrl_driver.cli.commands.shared import (
    battery_option,
    confirm,
    confirm_motion,
    confirm_overwrite,
    connected,
    json_option,
    print_json,
    print_message,
    robot_options,
    warn,
    yes_option,
)
from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.host.named_robots import Target
from mrl_driver.robot import models
from mrl_driver.robot.models import RobotModel

from .calibrate_view import confirm_here, show_values


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
        "--eeprom/--no-eeprom", default=None, help="Write the board's EEPROM too, or not; default: ask."
    )
    @click.option("--record", metavar="FILE", type=click.Path(), help="Record all bytes of both directions.")
    @battery_option
    @yes_option
    @json_option
    @functools.wraps(command)
    def wrapper(*args: Any, **options: Any) -> None:
        job = Job(**{name: options.pop(name) for name in Job._fields})
        if job.plot is not None:
            figures.require_writable(job.plot)
        if job.output is not None:
            require_writable(job.output)
        confirm_overwrite(job.record, job.yes)
        command(*args, job=job, **options)

    return wrapper


def value_option(name: str, kind: Any, default: float, text: str) -> Callable[[Any], Any]:
    """An option with a default, which the help shows."""
    return click.option(name, type=kind, default=default, show_default=True, help=text)


RUNS, TURNS = click.IntRange(2, 50), click.IntRange(1, 20)
recording_option = click.option(
    "--recording", metavar="FILE", help="Instead of driving: a recording of this calibration."
)


def connect(job: Job, **options: Any) -> ContextManager[Driver]:
    """Connect to the robot; tests replace this by a robot in simulated time.

    The IMU is off, unless the options turn it on: what is measured is the odometry of the wheels alone.
    """
    options = {"imu_period_ms": 0, "moves": True, **options}
    return connected(
        job.target, ignore_battery=job.ignore_battery, record=job.record, command_timeout_s=0.5, **options
    )


@contextlib.contextmanager
def robot_of(job: Job, **options: Any) -> Iterator[Tuple[Driver, RobotModel, str]]:
    """Connect to the robot, and yield it, its model, and the YAML file to write."""
    with connect(job, **options) as driver:
        warn(driver)
        assert driver.model is not None
        yield driver, driver.model, output_for(job, driver.model, driver.board.robot_id)


def confirm_drive(job: Job, question: str) -> None:
    """Ask before motors turn, as `confirm`; emulated robots (--truth) drive without a question."""
    confirm_motion(question, job.yes or job.truth is not None)


def recorded_model(job: Job) -> RobotModel:
    """Return the model of the recorded robot; raise ConfigError if --robot is missing."""
    if job.target.model == "auto":
        raise ConfigError(
            "--robot is missing, expected the model or .yaml file of the robot that was recorded"
        )
    return models.load(job.target.model)


def output_for(job: Job, model: RobotModel, robot_id: Optional[int] = None) -> str:
    """Return the YAML file to write; raise ConfigError if it would replace a file that is not the robot's own."""
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


class Result(NamedTuple):
    """What a calibration found: new values of the robot's file, lines to print, or facts as JSON."""

    procedure: str
    model: RobotModel
    output: str
    values: Mapping[Key, float]
    lines: Sequence[str]
    facts: Dict[str, Any]
    draw: Callable[[str], None] = lambda path: None  # draws the result to this path


def finish(result: Result, job: Job) -> None:
    """Draw and show a result, and write the robot's YAML file after asking."""
    if job.plot is not None:
        result.draw(job.plot)
    if job.as_json:
        print_json({"procedure": result.procedure, "output": result.output, **result.facts})
    else:
        for line in result.lines:
            click.echo(line)
        show_values(result.model, result.values)
    confirm(f"Write {result.output}?", job.yes)
    source = job.target.model if job.target.model != "auto" else result.model.name
    note = f"mrl calibrate {result.procedure}"
    kept = write_model(models.path_of(source), result.output, result.values, note)
    kept = f", the old file is {kept}" if kept else ""
    print_message(f"{result.output} is written{kept}; use it with --robot {result.output}")


def offer_eeprom(driver: Driver, values: Mapping[Key, float], job: Job) -> None:
    """Write the board parameters to its EEPROM, if --eeprom was given or the user agrees."""
    wanted = {name: int(value) for (section, name), value in values.items() if section == "board"}
    if not wanted or job.eeprom is False or (job.eeprom is None and not driver.parameters.can_save):
        return
    listed = ", ".join(f"{name} {value}" for name, value in wanted.items())
    if job.eeprom or confirm_here(f"Write {listed} to the board's EEPROM?", False):
        driver.parameters.write(wanted)
        driver.parameters.save()
        print_message(f"the board's EEPROM has {listed}")
