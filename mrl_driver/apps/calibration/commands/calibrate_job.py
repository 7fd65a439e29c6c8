"""Shared parts of all calibrations: options, connection, output files, the result, the board's EEPROM."""

import contextlib
import functools
import os
import shlex
import sys
from typing import Any, Callable, ContextManager, Dict, Iterator, List, Mapping, NamedTuple, Optional, Tuple

import click

from mrl_driver import figures
from mrl_driver.apps.calibration.calibration_files import Key, edited, write_model
from mrl_driver.cli.commands import shared
from mrl_driver.cli.commands.shared import Run, run_options
from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.files import require_writable
from mrl_driver.host.named_robots import Target
from mrl_driver.robot import models
from mrl_driver.robot.models import ON_WHEELS, RobotModel

YAML = (".yaml", ".yml")
RUNS, TURNS = click.IntRange(2, 50), click.IntRange(1, 20)
_THESIS = {"wheel_offset": " (Cm)", "turn_slip": " (Cs)"}  # names in (Araujo 2012)


class Result(NamedTuple):
    """What a calibration found: new values of the robot's file, lines to print, or facts as JSON."""

    procedure: str
    model: RobotModel
    output: str
    values: Mapping[Key, float]
    lines: List[str]
    facts: Dict[str, Any]
    draw: Callable[[str], None] = lambda path: None  # draws the result to this path

    def table(self) -> List[str]:
        """The values of the robot's file, before and after."""
        rows = [("parameter", "before", "after")]
        for (section, name), value in self.values.items():
            part = getattr(self.model, section)
            before = part.get(name) if isinstance(part, dict) else getattr(part, name)
            rows.append((f"{section}.{name}{_THESIS.get(name, '')}", _shown(before), _shown(value)))
        width = max(len(name) for name, _, _ in rows)
        return [f"{name:<{width}} {before:>12} {after:>12}" for name, before, after in rows]


def _shown(value: Optional[float]) -> str:
    return "-" if value is None else str(value) if isinstance(value, int) else f"{value:.7g}"


class Job(NamedTuple):
    """The options that all calibrations share."""

    run: Run
    output: Optional[str]
    truth: Optional[str]
    plot: Optional[str]
    restart: bool
    eeprom: Optional[bool]

    @property
    def target(self) -> Target:
        """The robot."""
        return self.run.target

    @contextlib.contextmanager
    def robot(self, odometry: bool = True, **options: Any) -> Iterator[Tuple[Driver, RobotModel, str]]:
        """Connect to the robot, and yield it, its model, and the YAML file to write.

        ConfigError for motors without encoders, unless the procedure needs no `odometry`.
        """
        with connect(self, **options) as driver:
            shared.warn(driver)
            model = _model_of(driver)
            if odometry:
                model.require_odometry()
            yield driver, model, self._output_for(model, driver.board.robot_id)

    def recorded_model(self) -> RobotModel:
        """Return the model of the recorded robot; raise ConfigError if --robot is missing."""
        if self.target.model == "auto":
            raise ConfigError(
                "--robot is missing, expected the model or .yaml file of the robot that was recorded"
            )
        return models.load(self.target.model)

    def recorded_robot(self) -> Tuple[RobotModel, str]:
        """Return the model of the recorded robot, and the YAML file to write."""
        model = self.recorded_model()
        return model, self._output_for(model)

    def _output_for(self, model: RobotModel, robot_id: Optional[int] = None) -> str:
        """Return the YAML file to write; raise ConfigError if it would replace a file that is not the robot's own."""
        own = self.target.model if self.target.model.endswith(YAML) else None
        if self.output is None and own is None and robot_id is None:
            raise ConfigError("--output is missing, expected the .yaml file to write")
        output = self.output or own or f"{model.name}-{robot_id}.yaml"
        require_writable(output, "--output", YAML)
        if os.path.exists(output) and (own is None or not os.path.samefile(own, output)):
            raise ConfigError(
                f"{output} already exists: continue from it with --robot {shlex.quote(output)}, or give another file "
                "with --output"
            )
        if model.virtual and os.path.exists(output) and not models.load(output).virtual:
            raise ConfigError(
                f"{output} is the file of a real robot, and a virtual one answers: give another file with --output"
            )
        return output

    def confirm_drive(self, question: str) -> None:
        """Ask before motors turn, as `confirm`; emulated robots (--truth) drive without a question."""
        shared.confirm_motion(question, self.run.yes or self.truth is not None)

    def finish(self, result: Result) -> None:
        """Draw and show a result, and write the robot's YAML file after asking."""
        if self.plot is not None:
            result.draw(self.plot)
        facts = {"procedure": result.procedure, "output": result.output, **result.facts}
        self.run.print(facts, "\n".join([*result.lines, *result.table()]))
        self._write(result.values, result.procedure, result.model, result.output)

    def require_file(self, values: Mapping[Key, float], procedure: str, driver: Driver) -> None:
        """Raise ConfigError, before anything moves, if `write` could not write such values later."""
        model = _model_of(driver)
        self._output_for(model, driver.board.robot_id)
        edited(self.file_of(model), values, procedure, model.virtual)

    def write(self, values: Mapping[Key, float], procedure: str, driver: Driver) -> None:
        """Write numbers that were found to the YAML file of a robot after asking."""
        model = _model_of(driver)
        self._write(values, procedure, model, self._output_for(model, driver.board.robot_id))

    def _write(self, values: Mapping[Key, float], procedure: str, model: RobotModel, output: str) -> None:
        self.run.confirm(f"Write {output}?")
        kept = write_model(self.file_of(model), output, values, f"mrl calibrate {procedure}", model.virtual)
        kept = f", the old file is {kept}" if kept else ""
        shared.print_message(f"{output} is written{kept}; use it with --robot {shlex.quote(output)}")

    def file_of(self, model: RobotModel) -> str:
        """Return the robot's file, or that of its model."""
        name = self.target.model
        if name == "auto":  # chosen by the board's id; the name in a file need not be the file's
            name = next(each for each in map(models.by_id, model.ids) if models.load(each).ids == model.ids)
        return models.path_of(name)

    def offer_eeprom(self, driver: Driver, result: Result) -> None:
        """Write the board parameters to its EEPROM, if --eeprom was given or the user agrees."""
        wanted = {name: int(value) for (section, name), value in result.values.items() if section == "board"}
        if not wanted or self.eeprom is False or (self.eeprom is None and not driver.parameters.can_save):
            return
        listed = ", ".join(f"{name} {value}" for name, value in wanted.items())
        question = f"Write {listed} to the board's EEPROM?"
        if self.eeprom or (sys.stdin.isatty() and shared.agrees(question)):
            driver.parameters.replace(wanted)
            shared.print_message(f"the board's EEPROM has {listed}")


def _model_of(driver: Driver) -> RobotModel:
    """The model of the connected robot, which says whether it is virtual."""
    assert driver.model is not None
    return driver.model._replace(virtual=driver.board.virtual)


def warn_of_distances(model: RobotModel) -> None:
    """Print a warning if the model's distances, on which a calibration rests, were not measured by `straight`."""
    if model.noise.distance_scale_sd == ON_WHEELS.distance_scale_sd:
        shared.print_message(
            "warning: this result rests on distances by the wheels, which nobody measured: run mrl calibrate straight "
            "first"
        )


def connect(job: Job, **options: Any) -> ContextManager[Driver]:
    """Connect to the robot; tests replace this by a robot in simulated time.

    The IMU is off, unless the options turn it on: what is measured is the odometry of the wheels alone.
    """
    return job.run.connected(moves=True, command_timeout_s=0.5, **{"imu_period_ms": 0, **options})


def job_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options that all calibrations share; the command gets them as `job`."""

    @run_options(shared.battery_option, shared.record_option, shared.yes_option, shared.json_option)
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
        help="Write the board's EEPROM too, or not; default: ask, even with --yes.",
    )
    @functools.wraps(command)
    def wrapper(**options: Any) -> None:
        job = Job(**{name: options.pop(name) for name in Job._fields})
        if job.plot is not None:
            figures.require_writable(job.plot)
        if job.output is not None:
            require_writable(job.output, "--output", YAML)
        job.run.confirm_overwrite(job.run.record)
        command(job=job, **options)

    return wrapper


def value_option(name: str, kind: Any, default: float, text: str) -> Callable[[Any], Any]:
    """An option with a default, which the help shows."""
    return click.option(name, type=kind, default=default, show_default=True, help=text)


recording_option = click.option(
    "--recording", metavar="FILE", help="Instead of driving: a recording of this calibration."
)
