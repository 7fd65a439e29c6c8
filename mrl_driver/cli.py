"""The command `mrl`: what a person at a terminal does with a robot.

Errors are one line on stderr and an exit code of `errors.py`.  Other packages add sub-commands through the
entry points group `mrl.commands`.
"""

import contextlib
import json
import math
import signal
import sys
import time
from importlib import metadata
from typing import Any, Callable, Dict, Iterator, List, Optional, Sequence

import click

from . import live, robots
from .driver import Driver, Options
from .errors import BoardRefused, BoardTimeout, ConfigError, MrlError, WheelFault
from .link import BAUD, ports
from .table import BY_NAME, PARAMETER_BY_NAME

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""
TERMINATED = 143
FOREVER_S = 1e9


class Commands(click.Group):
    """The own sub-commands, and those that other packages register."""

    def list_commands(self, ctx: click.Context) -> List[str]:
        """Names of all sub-commands, sorted."""
        return sorted(set(super().list_commands(ctx)) | set(_registered()))

    def get_command(self, ctx: click.Context, cmd_name: str) -> Optional[click.Command]:
        """The sub-command of that name; one of another package is loaded when it is asked for."""
        own = super().get_command(ctx, cmd_name)
        if own is not None or cmd_name not in _registered():
            return own
        return _registered()[cmd_name].load()


def _registered() -> Dict[str, Any]:
    points: Any = metadata.entry_points()
    group = "mrl.commands"
    found = points.select(group=group) if hasattr(points, "select") else points.get(group, [])
    return {point.name: point for point in found}


def _version() -> str:
    try:
        return metadata.version("mrl-driver")
    except metadata.PackageNotFoundError:
        return "unknown (not installed)"


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(_version(), prog_name="mrl")
def cli() -> None:
    """Drive and watch TraxBot, StingBot and other Arduino robots."""


def _robot_options(command: Callable[..., None]) -> Callable[..., None]:
    """The options that name a robot on a port."""
    for option in (
        click.option("--baud", default=BAUD, show_default=True, help="Baud rate of the port."),
        click.option(
            "--robot", default="auto", show_default=True, help="Robot model: auto, a name, or a .yaml file."
        ),
        click.option("--port", envvar="MRL_PORT", help="Serial port, such as /dev/ttyACM0 [env: MRL_PORT]."),
    ):
        command = option(command)
    return command


@contextlib.contextmanager
def _driver(
    port: Optional[str], robot: str, baud: int, ignore_battery: bool, record: Optional[str] = None
) -> Iterator[Driver]:
    """A connected driver; says in the end what a recording lacks."""
    options = Options(ignore_battery=ignore_battery, record=record)
    driver = Driver(_demand_port(port), robot, baud, options)
    try:
        with driver:
            yield driver
    finally:
        recorder = driver.recorder
        if recorder is not None and recorder.lost:
            click.echo(f"mrl: {recorder.path} lacks {recorder.lost} lines: {recorder.error}", err=True)


_record_option = click.option("--record", metavar="FILE", help="Keep every byte both ways, for mrl replay.")


def _demand_port(port: Optional[str]) -> str:
    if not port:
        found = ", ".join(ports()) or "none; is the board plugged in?"
        raise ConfigError(f"--port is missing, expected a serial port; ports there are: {found}")
    return port


@cli.command()
@_robot_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def info(port: Optional[str], robot: str, baud: int, as_json: bool) -> None:
    """Say who answers on a port.

    Example: mrl info --port /dev/ttyACM0 --json
    """
    with _driver(port, robot, baud, True) as driver:
        facts = describe(driver, str(port))
    if as_json:
        click.echo(json.dumps(facts))
        return
    for key, value in facts.items():
        click.echo(f"{key.replace('_', ' '):>20}  {_human(value)}")


def describe(driver: Driver, port: str) -> Dict[str, Any]:
    """What is known of a connected robot: numbers in SI units, the unit in the key's end."""
    board, status = driver.board, driver.status
    assert driver.model is not None
    facts: Dict[str, Any] = {
        "port": port,
        "robot": driver.model.name,
        "robot_id": board.robot_id,
        "firmware_version": board.version,
        "protocol_version": board.protocol,
        "capabilities": sorted(board.capabilities),
        "motor_board_version": board.motor_board_version,
        "battery_v": board.battery_v,
        "battery_state": driver.battery_state,
        "temperature_c": board.temperature_c,
    }
    if status is not None:
        facts.update(
            uptime_s=status.uptime_s,
            reset_cause=status.reset_cause,
            stop_reason=status.stop_reason,
            faults=list(status.faults),
        )
    if driver.warning:
        facts["note"] = driver.warning.replace("PORT=...", f"PORT={port}")
    return facts


def _warn(driver: Driver) -> None:
    if driver.warning:
        click.echo(f"mrl: warning: {driver.warning}", err=True)


def _human(value: Any) -> str:
    return ", ".join(map(str, value)) or "none" if isinstance(value, list) else str(value)


@cli.command()
@_robot_options
@click.option("--linear", type=float, help="Forward speed [m/s].")
@click.option("--angular", type=float, help="Yaw rate, counter-clockwise [rad/s].")
@click.option("--for", "seconds", type=float, help="Drive for so long [s], then stop.")
@click.option("--ignore-battery", is_flag=True, help="Drive with an empty battery too.")
@_record_option
def drive(
    port: Optional[str],
    robot: str,
    baud: int,
    linear: Optional[float],
    angular: Optional[float],
    seconds: Optional[float],
    ignore_battery: bool,
    record: Optional[str],
) -> None:
    """Drive with the keyboard, or at given speeds for a given time.

    Example: mrl drive --port /dev/ttyACM0 --linear 0.2 --for 2
    """
    timed = (linear, angular, seconds) != (None, None, None)
    if timed:
        _demand_finite(linear=linear or 0.0, angular=angular or 0.0)
        if seconds is None or not 0 < seconds <= 3600:
            raise ConfigError(f"--for is {seconds}, expected seconds from above 0 to 3600")
    elif not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise ConfigError("there is no terminal to drive from; give --linear or --angular, and --for SECONDS")
    with _driver(port, robot, baud, ignore_battery, record) as driver:
        _warn(driver)
        if timed:
            _drive_timed(driver, linear or 0.0, angular or 0.0, seconds or 0.0)
        else:
            live.drive(driver)


@cli.command("set-id")
@_robot_options
@click.argument("robot_id", type=click.IntRange(1, 32767))
@click.option("--yes", is_flag=True, help="Do not ask.")
def set_id(port: Optional[str], robot: str, baud: int, robot_id: int, yes: bool) -> None:
    """Give a board its robot id, and the defaults of that robot; both are kept in its EEPROM.

    Example: mrl set-id 1 --port /dev/ttyACM0
    """
    model = robots.load(robot if robot != "auto" else robots.by_id(robot_id) or _no_model(robot_id))
    if robot_id not in model.ids:
        raise ConfigError(
            f"robot id {robot_id} is no {model.name}, expected {', '.join(map(str, model.ids))}"
        )
    options = Options(ignore_battery=True, any_id=True)
    with Driver(_demand_port(port), model, baud, options) as driver:
        if not yes:
            click.confirm(f"change the robot id from {driver.board.robot_id} to {robot_id}?", abort=True)
        write_id(driver, robot_id)
    click.echo(f"robot id {robot_id} is set")


def _no_model(robot_id: int) -> str:
    raise ConfigError(f"robot id {robot_id} is in no packaged model; name a model file with --robot")


def write_id(driver: Driver, robot_id: int) -> None:
    """Write the id, the defaults that go with it, and save both.

    Raises:
        BoardRefused: the board keeps no configuration, or did not take it.
        BoardTimeout: it does not answer.
    """
    if "config" not in driver.board.capabilities:
        raise BoardRefused(
            "board firmware 1 (2013) has no command for its id; flash with: make flash PORT=..."
        )
    index = PARAMETER_BY_NAME["robot_id"].number
    if driver.ask(BY_NAME["write_config"].code, index, robot_id) != (index, robot_id):
        raise BoardRefused(f"the board did not take robot id {robot_id}")
    driver.ask(BY_NAME["default_config"].code)
    if driver.ask(BY_NAME["save_config"].code, timeout_s=2.0) != (1,):
        raise BoardRefused("the board could not save its EEPROM; try again")


def _demand_finite(**speeds: float) -> None:
    for name, value in speeds.items():
        if not math.isfinite(value):
            raise ConfigError(f"--{name} is {value}, expected a finite number")


def _drive_timed(driver: Driver, linear_m_s: float, angular_rad_s: float, seconds: float) -> None:
    """Drive for `seconds`, then stop; one line with the pose at the end."""
    deadline = time.monotonic() + seconds
    driver.drive(linear_m_s, angular_rad_s)
    while time.monotonic() < deadline:
        driver.wait(min(0.05, deadline - time.monotonic()))
        if driver.command is None:
            if driver.mismatch is not None:
                raise WheelFault(f"stopped early: {driver.mismatch}")
            raise BoardTimeout(
                f"stopped early ({driver.stop_reason}): telemetry is {driver.age_s * 1000:.0f} ms old, "
                f"battery is {driver.battery_state} ({driver.battery_v:.1f} V)"
            )
    driver.stop()
    while not driver.stopped and not driver.wait(0.02):
        if time.monotonic() > deadline + 2:
            break
    click.echo(live.line(driver))


_seconds_option = click.option(
    "--seconds", type=float, default=FOREVER_S, help="End after so long [s]; without it at Ctrl-C."
)


@cli.command()
@_robot_options
@_seconds_option
@_record_option
def monitor(port: Optional[str], robot: str, baud: int, seconds: float, record: Optional[str]) -> None:
    """Watch a robot: pose, speeds, ranges, battery, link.

    Without a terminal it prints a line a second.  Example: mrl monitor --port /dev/ttyACM0
    """
    _watch(port, robot, baud, seconds, record)


@cli.command("record")
@_robot_options
@_seconds_option
@click.argument("file")
def record_(port: Optional[str], robot: str, baud: int, seconds: float, file: str) -> None:
    """Watch a robot, and keep every byte both ways in FILE.

    Example: mrl record --port /dev/ttyACM0 drive.mrl; see mrl replay.
    """
    _watch(port, robot, baud, seconds, file)


def _watch(port: Optional[str], robot: str, baud: int, seconds: float, record: Optional[str]) -> None:
    if not seconds > 0:
        raise ConfigError(f"--seconds is {seconds}, expected a number above 0")
    with _driver(port, robot, baud, True, record) as driver:
        _warn(driver)
        try:
            live.watch(driver, seconds)
        except KeyboardInterrupt:
            return


def _terminate(*_: Any) -> None:
    raise SystemExit(TERMINATED)


def main(args: Optional[Sequence[str]] = None) -> None:
    """Run `mrl`; always ends in SystemExit.  Signals stop the robot before that."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _terminate)
    try:
        sys.exit(cli.main(args=args and list(args), prog_name="mrl", standalone_mode=False) or 0)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        click.echo("mrl: interrupted; the robot was stopped", err=True)
        sys.exit(INTERRUPTED)
    except MrlError as error:
        click.echo(f"mrl: {error}", err=True)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
