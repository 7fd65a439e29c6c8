"""Shared parts of the sub-commands: options that name a robot, a connected driver, JSON output, questions."""

import contextlib
import functools
import math
import os
import signal
import sys
import threading
from typing import (
    TYPE_CHECKING,
    Any,
    Callable,
    ContextManager,
    Dict,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
)

import click

from mrl_driver.errors import BoardRefused, ConfigError, OutputError
from mrl_driver.host import named_robots
from mrl_driver.host.named_robots import Target
from mrl_driver.json_text import json_text
from mrl_driver.problems import PROBLEMS
from mrl_driver.program import REPEATED, handle_end_signals, in_plain_words
from mrl_driver.robot import models
from mrl_driver.robot.imu import LEARNING, WAITING
from mrl_driver.session.events import MAY_MOVE, Awaited, ImuChanged, Lost, PathUnknown, Reconnected, Slowed
from mrl_driver.session.sensor_polling import of_board
from mrl_driver.transport.address import is_url
from mrl_driver.transport.baud_rates import FAST_BAUD, SLOW

if TYPE_CHECKING:
    from mrl_driver.driver import Driver
    from mrl_driver.robot.models import RobotModel

Decorator = Callable[[Callable[..., None]], Callable[..., None]]
FOREVER_S = 1e9
BAUDS = click.IntRange(named_robots.LOWEST_BAUD, named_robots.HIGHEST_BAUD)
STAND_S = 1.0  # time in which a standing robot learns the bias of its gyro [s]
FIRST_SENSORS_S = 1.3
"""Time in which each sensor has answered once [s]: the thermopile of a 2013 board is requested once a second."""


class Between(click.FloatRange):
    """A number in a range; click's own range accepts NaN, this one does not."""

    def convert(self, value: Any, param: Optional[click.Parameter], ctx: Optional[click.Context]) -> Any:
        """Return the number; an error names the range."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value} is not in the range {self._describe_range()}.", param, ctx)
        return number

    def fail(self, message: str, *where: Any) -> Any:
        """Raise the error in plain words, also after a question."""
        super().fail(in_plain_words(message), *where)


json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")
record_option = click.option(
    "--record",
    metavar="FILE",
    type=click.Path(),
    help="Record all bytes of both directions, for mrl replay and plot.",
)
battery_option = click.option("--ignore-battery", is_flag=True, help="Drive even if the battery is empty.")
fast_option = click.option(
    "--fast",
    is_flag=True,
    help="Switch the serial link to 500000 baud if board and port support it; for cables.",
)
max_delay_option = click.option(
    "--max-delay",
    "max_delay_s",
    type=Between(0),
    help="With keys: stop if the delay from a key press to the board exceeds this [s]; 0 turns it off.  [default: 0.5]",
)
seconds_option = click.option(
    "--seconds",
    type=Between(0, min_open=True),
    default=FOREVER_S,
    help="End after this time [s]; default: run until Ctrl-C.",
)
reconnect_option = click.option(
    "--reconnect/--no-reconnect",
    default=True,
    show_default=True,
    help="Find the robot again after its port was unplugged, or end with exit code 6.",
)
port_timeout_option = click.option(
    "--port-timeout",
    "port_timeout_s",
    type=Between(0, 3600),
    default=0.0,
    show_default=True,
    help="Wait this long for a port that cannot be opened yet, whatever the reason [s].",
)
yes_option = click.option("--yes", is_flag=True, help="Answer yes to every question.")
DRIVING = (battery_option, record_option, fast_option, yes_option, json_option)
"""Options of commands that drive a robot."""


def completion_of(names: Callable[[], List[str]]) -> Callable[..., List[str]]:
    """Return what completes one of these names in a shell; nothing if the file with them is damaged."""

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> List[str]:
        try:
            return [name for name in names() if name.startswith(incomplete)]
        except ConfigError:
            return []

    return complete


def _ports() -> List[str]:
    from mrl_driver.transport.port_info import ports

    return ports()


complete_port = completion_of(_ports)
complete_robot = completion_of(lambda: [*named_robots.read(), *models.names(), "auto"])


def robot_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options that name a robot; the command gets them as `target`.

    Options before the sub-command come second, the environment last.
    """

    @click.option(
        "--port",
        metavar="PORT",
        shell_complete=complete_port,
        help="Serial port, such as /dev/ttyACM0, or tcp://HOST:PORT, udp://HOST:PORT [env: MRL_PORT].",
    )
    @click.option(
        "--robot",
        metavar="ROBOT",
        shell_complete=complete_robot,
        help="A name (see mrl names), a model, or a .yaml file; by default the model that lists the board's id "
        "[env: MRL_ROBOT].",
    )
    @click.option("--baud", type=BAUDS, help="Baud rate of the port  [default: 115200]")
    @functools.wraps(command)
    def wrapper(
        *args: Any, port: Optional[str], robot: Optional[str], baud: Optional[int], **options: Any
    ) -> None:
        outer = click.get_current_context().find_root().params
        robot = robot or outer.get("robot") or os.environ.get("MRL_ROBOT") or "auto"
        target = named_robots.resolve(robot, port or outer.get("port"), baud)
        target = target._replace(port=target.port or os.environ.get("MRL_PORT") or None)
        command(*args, target=target, **options)

    return wrapper


class Run(NamedTuple):
    """A robot, and how a command uses it: the options that commands share."""

    target: Target
    ignore_battery: bool = False
    record: Optional[str] = None
    reconnect: bool = False
    fast: bool = False
    max_delay_s: Optional[float] = None
    seconds: float = FOREVER_S
    yes: bool = False
    as_json: bool = False

    def connected(self, moves: bool = False, **options: Any) -> ContextManager["Driver"]:
        """Connect as `connected` does; a command that does not drive accepts an empty battery."""
        ignored = self.ignore_battery or not moves
        given = {"record": self.record, "reconnect": self.reconnect, "fast": self.fast, **options}
        return connected(self.target, moves=moves, ignore_battery=ignored, **given)

    def print(self, facts: Any, text: str) -> None:
        """Print the facts with --json, and otherwise the text."""
        if self.as_json:
            print_json(facts)
        else:
            click.echo(text)

    def confirm(self, question: str, otherwise: str = "nothing was changed") -> None:
        """As `confirm`, unless --yes was given."""
        confirm(question, self.yes, otherwise)

    def confirm_overwrite(self, path: Optional[str]) -> None:
        """As `confirm_overwrite`, unless --yes was given; PortMissing, before the question, if there is no port."""
        if path is not None:
            require_device(require_port(self.target))
        confirm_overwrite(path, self.yes)


def run_options(*options: Decorator) -> Decorator:
    """Add the options that name a robot, and these shared ones; the command gets all of them as `run`."""

    def add(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def wrapper(*args: Any, **given: Any) -> None:
            run = Run(**{name: given.pop(name) for name in Run._fields if name in given})
            command(*args, run=run, **given)

        added: Callable[..., None] = wrapper
        for option in reversed(options):
            added = option(added)
        return robot_options(added)

    return add


def require_port(target: Target) -> str:
    """Return the target's port; raise ConfigError, which lists the existing ports, if none was given."""
    if not target.port:
        found = ", ".join(_ports()) or "none (is the board plugged in?)"
        raise ConfigError(
            f"--port is missing, expected a serial port or --robot with a named robot; existing ports: {found}"
        )
    return target.port


def require_device(port: str) -> None:
    """Raise PortMissing if there is no such port, before questions are asked and files are written."""
    from mrl_driver.transport import link

    if not is_url(port):
        link.require_device(port)


@contextlib.contextmanager
def connected(
    target: Target,
    model: Optional["RobotModel"] = None,
    moves: bool = False,
    odometry: bool = False,
    finds_wiring: bool = False,
    **options: Any,
) -> Iterator["Driver"]:
    """Connect a driver with these options for the block; `model` replaces the target's model.

    ConfigError if the block `moves` the robot, and its board has no motors, or if it needs `odometry`, and there is
    none.  BoardRefused if it `moves` a robot whose wiring is not set, unless it `finds_wiring`.  KeyboardInterrupt
    after Ctrl-C, which says whether telemetry has confirmed the stop.  OutputError if everything else succeeded, but
    the recording is incomplete.
    """
    from mrl_driver.driver import Driver, Options
    from mrl_driver.driver.suspension import stopped_while_suspended

    wanted = Options(robot_id=target.id, virtual=target.virtual, **options)
    driver = Driver(require_port(target), model or target.model, target.baud, wanted)
    report_events(driver, Awaited)
    try:
        with closed_without_interruption(driver), stopped_while_suspended(driver):
            if options.get("fast") and driver.link.baud != FAST_BAUD:
                print_message(f"warning: the serial link stays at {driver.link.baud} baud: {SLOW}")
            if moves and driver.model is not None:
                driver.model.require_motors()
            if moves and not finds_wiring:
                _require_wiring(driver)
            if odometry and driver.model is not None:
                driver.model.require_odometry()
            yield driver
    except KeyboardInterrupt:
        end = f"; {MAY_MOVE}" if driver.may_be_moving else "; the robot was stopped" if driver.stopped else ""
        raise KeyboardInterrupt(f"interrupted{end}") from None
    except BaseException:
        if driver.recorder.loss:
            print_message(driver.recorder.loss)
        raise
    if driver.recorder.loss:
        raise OutputError(driver.recorder.loss)


@contextlib.contextmanager
def closed_without_interruption(driver: "Driver") -> Iterator[None]:
    """Connect a driver for the block, and ignore signals while it closes, about a second: Ctrl-C may be held."""
    before: Dict[int, Any] = {}
    try:
        with driver:
            try:
                yield
            finally:
                if threading.current_thread() is threading.main_thread():
                    before = handle_end_signals(signal.SIG_IGN, REPEATED)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _require_wiring(driver: "Driver") -> None:
    """Raise BoardRefused if the board refuses to move, because its bridge, pins or wiring are not set."""
    if driver.status is not None and "wiring" in driver.status.faults:
        problem = driver.parameters.wiring_problem() or "its bridge or its wiring is not set"
        error = BoardRefused(f"the board refuses to move: {problem}; {PROBLEMS['wiring'].remedy}")
        error.code = "wiring"
        raise error


def report_unknown_wiring(unknown: bool, port: object) -> None:
    """Say what must be done after a change of pins, see `Parameters.replace`."""
    if unknown:
        print_message(
            "the wiring was found with other pins, and the board refuses to move until it is found again: "
            f"mrl calibrate wiring --port {port}"
        )


def report_events(driver: "Driver", *kinds: type) -> None:
    """Print a line for each event of these kinds."""
    driver.on_event(lambda event: print_message(str(event)) if isinstance(event, kinds) else None)


def report_losses(driver: "Driver") -> None:
    """Print a line when the port goes away, the robot is found again, the serial link falls back to a lower baud rate,
    the odometry missed a movement, or the gyro is not used.
    """
    report_events(driver, Lost, Reconnected, Slowed, PathUnknown, ImuChanged)


def wait_until(driver: "Driver", done: Callable[[], bool], most_s: float, step_s: float = 0.02) -> None:
    """Wait until something is done, for at most this time [s]."""
    end_s = driver.now_s + most_s
    while not done() and driver.now_s < end_s:
        driver.wait(step_s)


def await_gyro(driver: "Driver") -> None:
    """Wait until the bias of a gyro is known: a standing robot learns it within `STAND_S`."""
    wait_until(driver, lambda: driver.imu_state not in (WAITING, LEARNING), STAND_S)


def await_sensors(driver: "Driver") -> List[str]:
    """Wait for a reading of each sensor that the board has, at most `FIRST_SENSORS_S`; return those without one."""
    board = driver.board
    names = [row.name for row in of_board(board.capabilities, board.protocol) if row.capability]
    wait_until(driver, lambda: driver.sensors.keys() >= set(names), FIRST_SENSORS_S, 0.05)
    return [name for name in names if name not in driver.sensors]


def warn(driver: "Driver") -> None:
    """Print the driver's warning about the board, if there is one."""
    if driver.warning:
        print_message(f"warning: {driver.warning}")


def print_message(text: str) -> None:
    """Print one line on stderr."""
    click.echo(f"mrl: {text}", err=True)


def print_json(value: Any) -> None:
    """Print JSON, as `json_text` has it."""
    click.echo(json_text(value))


def full_screen() -> bool:
    """Return whether stdout is a terminal that can show a full-screen view."""
    return sys.stdout.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")


def no_view_because() -> str:
    """Return why there is no full-screen view that takes keys."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return "stdin or stdout is not a terminal"
    if not full_screen():
        return f"TERM is {os.environ['TERM']}, expected a terminal with a full-screen view, such as xterm"
    return "--json has no view"


def agrees(question: str, default: bool = False, err: bool = True) -> bool:
    """Ask until the answer is yes or no, or empty for the default; return whether it is yes.

    `click.confirm` calls other words `invalid input`, and does not say what it expects.
    """
    words, empty = ("[Y/n]", "y") if default else ("[y/N]", "n")
    kind = click.Choice(["y", "yes", "n", "no"], case_sensitive=False)
    asked: str = click.prompt(
        f"{question} {words}", default=empty, show_default=False, type=kind, show_choices=False, err=err
    )
    return asked.startswith("y")


def confirm(question: str, yes: bool, otherwise: str = "nothing was changed") -> None:
    """Ask, unless `yes`; click.Abort, which says `otherwise`, after a no, and ConfigError without a terminal."""
    if yes:
        return
    if not sys.stdin.isatty():
        raise ConfigError(f"{question} stdin is not a terminal; give --yes to agree")
    if not agrees(question):
        raise click.Abort(otherwise)


def choose(question: str, choices: Mapping[str, str], option: str) -> str:
    """Show words with their meanings, and ask for one; ConfigError, which names `option`, without a terminal."""
    if not sys.stdin.isatty():
        raise ConfigError(
            f"{question} stdin is not a terminal; give {option} with one of {', '.join(choices)}"
        )
    width = max(map(len, choices))
    for word, meaning in choices.items():
        click.echo(f"  {word:<{width}}  {meaning}", err=True)
    kind = click.Choice(list(choices), case_sensitive=False)
    answer: str = click.prompt(question, type=kind, show_choices=False, prompt_suffix=" ", err=True)
    return answer.lower()


def confirm_motion(question: str, yes: bool) -> None:
    """Ask before motors turn, as `confirm`."""
    confirm(question, yes, "the robot was not moved")


def confirm_overwrite(record: Optional[str], yes: bool) -> None:
    """Ask before a recording replaces a file that is not empty, as `confirm`."""
    if record is not None and os.path.isfile(record) and os.path.getsize(record):
        confirm(f"{record} already exists. Replace it?", yes)
