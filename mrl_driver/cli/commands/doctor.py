"""`mrl doctor`: checks of computer, port, board and robot."""

import contextlib
import datetime
import math
import platform
import re
import sys
import textwrap
import time
from typing import TYPE_CHECKING, Any, Dict, Generator, Iterator, List, Mapping, Optional, Sequence, Tuple

import click

from mrl_driver.cli.doctor.findings import FAULT, NOTE, OK, WARNING, Finding, note, ok, verdict
from mrl_driver.errors import BoardError, ConfigError, LinkError, MrlError, PortBusy, PortDenied, WrongRobot
from mrl_driver.host.named_robots import Target
from mrl_driver.program import version
from mrl_driver.robot.models import Drive
from mrl_driver.transport.address import is_network

from . import shared
from .info import describe
from .progress import answered, waiting
from .shared import Run, run_options

if TYPE_CHECKING:
    from rich.console import Console

    from mrl_driver.driver import Driver

FIRST_SONARS_S = 0.5
_BEFORE_ADVICE = re.compile(r"; |: (?=check|choose|flash|set )")
_MARKS = {OK: ("✓", "ok"), NOTE: ("·", "--"), WARNING: ("!", "!!"), FAULT: ("✗", "XX")}
_STYLES = {OK: "green", NOTE: "dim", WARNING: "bold yellow", FAULT: "bold red"}
_SUBJECT, _INDENT = 16, 20
_WIDEST = 100


@click.command()
@run_options(shared.json_option, shared.yes_option)
@click.option(
    "--drive", "drives", is_flag=True, help="Turn each wheel too; lift the wheels off the ground first."
)
@click.option(
    "--sonars", "hands", is_flag=True, help="Find swapped sonars: you hold a hand in front of each in turn."
)
@click.option("--report", is_flag=True, help="Print plain text with all details, to paste into a bug report.")
def doctor(run: Run, drives: bool, hands: bool, report: bool) -> None:
    """Check computer, port, board and robot.

    Prints advice for each problem.  Opening the port resets an Arduino Uno.  The robot moves only with --drive.
    The exit code is 0 if no fault was found, 1 if one was found, and that of the error if the robot cannot be
    reached.

    \b
    Examples:
      mrl doctor --port /dev/ttyACM0
      mrl doctor --robot lab3 --drive           turns the wheels too: lift them first
      mrl doctor --robot lab3 --report > report.txt
    """
    shared.require_port(run.target)
    if report and run.as_json:
        raise ConfigError("--report is given with --json, expected one of them")
    if hands and not sys.stdin.isatty():
        raise ConfigError("--sonars asks questions, but stdin is not a terminal; run it in a terminal")
    if drives:
        try:
            shared.require_device(shared.require_port(run.target))
            run.confirm("Are the wheels lifted off the ground?  Each turns forward for 2 s.")
        except (click.Abort, LinkError):
            drives = False  # the other checks still run
    console = None if report or run.as_json else _console()
    facts: Dict[str, Any] = {}
    with contextlib.closing(_checks(run.target, drives, hands, facts)) as checks:
        findings, code = _gathered(checks, run.target, console)
    if run.as_json:
        plain = [finding._asdict() for finding in findings]
        port, said = run.target.port, verdict(findings)
        shared.print_json({"port": port, "verdict": said, "findings": plain, "facts": facts})
    elif console is None:
        click.echo("\n".join(_report(findings, facts, run.target)))
    else:
        _conclude(findings, console)
    if code:
        sys.exit(code)


def _gathered(
    checks: Iterator[Finding], target: Target, console: Optional["Console"]
) -> Tuple[List[Finding], int]:
    """Run the checks until an error, show each finding at once, and return all of them and the exit code."""
    port = shared.require_port(target)
    named = f"--robot {target.name}" if target.name else f"--port {port}"
    findings: List[Finding] = []

    def add(finding: Finding) -> None:
        findings.append(finding._replace(advice=finding.advice.replace("--port PORT", named)))
        if console is not None:
            _show(findings[-1], console)

    def faulty() -> bool:
        return any(finding.level == FAULT for finding in findings)

    try:
        for finding in checks:
            add(finding)
    except MrlError as error:
        if not (faulty() and isinstance(error, (PortDenied, PortBusy))):
            add(_of_error(error, port))
        return findings, error.exit_code
    return findings, 1 if faulty() else 0


def _checks(
    target: Target, drives: bool, hands: bool, facts: Dict[str, Any]
) -> Generator[Finding, None, None]:
    """Check computer and port, then the board, even if no packaged model lists its id; `facts` get those of the board.

    The error that makes the rest impossible is raised.
    """
    from mrl_driver.cli.doctor import computer
    from mrl_driver.transport.port_info import describe as describe_port

    port = shared.require_port(target)
    yield from computer.check(port, describe_port(port))
    try:
        yield from _examine(target, drives, hands, facts)
    except WrongRobot as error:
        if facts or target.model != "auto":
            raise
        yield _of_error(error, port)
        any_robot = target._replace(model="traxbot", virtual=None)
        yield from _examine(any_robot, drives, hands, facts, any_id=True)


def _examine(
    target: Target, drives: bool, hands: bool, facts: Dict[str, Any], any_id: bool = False
) -> Iterator[Finding]:
    from mrl_driver.cli.doctor import board

    start_s = time.monotonic()
    with answered(shared.connected(target, ignore_battery=True, any_id=any_id)) as driver:
        yield ok("answer", f"after {time.monotonic() - start_s:.1f} s")
        yield from _check_board(driver, shared.require_port(target), facts, any_id)
        yield from board.of_robot(driver, _check_motion(driver, drives))
        if hands:
            from mrl_driver.cli.doctor import wheels

            yield from wheels.sonar_order(lambda: driver.ranges, _ask)


def _check_board(driver: "Driver", port: str, facts: Dict[str, Any], any_id: bool) -> Iterator[Finding]:
    from mrl_driver.cli.doctor import board, parameters

    model = driver.model
    if not any_id:
        yield from board.identity(driver.board, model)
    yield from board.of_robot(driver, board.supply(driver.board, model))
    yield from board.of_robot(driver, board.health(driver.status, driver.parameters.wiring_problem()))
    with waiting("watching the link"):
        seen = board.watch(driver)
    counts, missing = board.counters(driver), shared.await_sensors(driver)
    facts.update(
        describe(driver, port),
        rate_hz=seen.rate_hz,
        lost=seen.lost,
        garbage=seen.garbage,
        round_trips_ms=[round(each * 1000, 2) for each in seen.round_trips_s],
        refused_by_board=counts,
    )
    if model is not None and model.drives and driver.parameters.can_save and not any_id:
        facts["parameters"] = driver.parameters.read(*(row.name for row in driver.parameters.rows))
        yield from parameters.check(facts["parameters"], model)
    yield from board.link(seen, by_network=is_network(port))
    yield from board.refusals(counts, model is None or model.drives)
    yield from board.hold(driver.radio.hold)
    yield from board.inputs(driver.inputs)
    yield from board.gyro(driver)
    yield from board.build(driver)
    shared.wait_until(driver, lambda: not any(map(math.isnan, driver.ranges.values())), FIRST_SONARS_S, 0.05)
    mounts = model.sonars if model is not None else {}
    yield from board.of_robot(driver, board.sonars(driver.ranges, driver.board, mounts))
    yield from board.sensors(driver.sensors, missing)


def _check_motion(driver: "Driver", drives: bool) -> Iterator[Finding]:
    from mrl_driver.cli.doctor import wheels

    model, unchecked = driver.model, note("wheels_unchecked", "wheels", "not checked")
    if model is not None and not model.drives:
        if drives:
            yield unchecked._replace(text="not checked: this board has no motors", advice="")
    elif model is not None and not model.has_odometry:
        yield unchecked._replace(text="not checked: the motors have no encoders", advice="")
    elif not drives:
        virtual = driver.board.virtual
        yield unchecked._replace(advice="run: mrl doctor --drive --port PORT") if virtual else unchecked
    elif model is not None and type(model.drive) is not Drive:
        text = "not checked: this check supports two wheels"
        yield unchecked._replace(text=text, advice="watch the wheels with: mrl drive --port PORT")
    else:
        ask = _ask if sys.stdin.isatty() else None
        yield from wheels.check(driver, (lambda question: True) if driver.board.virtual else ask)


def _ask(question: str) -> bool:
    return shared.agrees(f"  {question}", default=True, err=False)


def _of_error(error: MrlError, port: str) -> Finding:
    text, advice, *_ = [*_BEFORE_ADVICE.split(str(error).replace("--port PORT", f"--port {port}"), 1), ""]
    subject = (
        "port" if isinstance(error, LinkError) else "board" if isinstance(error, BoardError) else "check"
    )
    return Finding(FAULT, subject, text, advice, error.code)


# -- output


def _console() -> "Console":
    from rich.console import Console  # late: the list of commands loads this module

    return Console(highlight=False, markup=False, emoji=False, soft_wrap=True)


def _show(finding: Finding, console: "Console") -> None:
    signs = console.encoding.lower().startswith("utf")
    style = _STYLES[finding.level]
    first, *rest = _wrapped(finding.text + (f"  [{finding.code}]" if finding.code else ""), console)
    console.print(f"{_MARKS[finding.level][0 if signs else 1]:<2} ", style=style, end="")
    subject_style = None if finding.level in (OK, NOTE) else style
    console.print(f"{finding.subject:<{_SUBJECT}} ", style=subject_style, end="")
    console.print(first)
    for line in rest:
        console.print(" " * _INDENT + line)
    advice = f"{'→' if signs else '->'} {finding.advice}"
    for line in _wrapped(advice, console) if finding.advice else []:
        console.print(" " * _INDENT + line, style="cyan")


def _wrapped(text: str, console: "Console") -> List[str]:
    """Return the lines of the third column; a single line if the output is not a terminal."""
    width = min(console.width, _WIDEST) - _INDENT if console.is_terminal else 10**6
    return textwrap.wrap(text, max(20, width), break_long_words=False, break_on_hyphens=False) or [""]


def _conclude(findings: Sequence[Finding], console: "Console") -> None:
    levels = [finding.level for finding in findings]
    style = _STYLES[FAULT if FAULT in levels else WARNING if WARNING in levels else OK]
    console.print(f"\n   {verdict(findings)}", style=style)


def _report(findings: Sequence[Finding], facts: Mapping[str, Any], target: Target) -> Iterator[str]:
    """Yield the lines of the whole report: plain text to paste into a bug report."""
    yield f"mrl doctor, {datetime.datetime.now().astimezone().isoformat(timespec='seconds')}"
    yield f"mrl-driver {version()}, pyserial {version('pyserial')}, Python {platform.python_version()}"
    yield f"{platform.platform()}"
    yield f"port {target.port}, model {target.model}, {target.baud} Bd"
    yield ""
    for finding in findings:
        code = f"  [{finding.code}]" if finding.code else ""
        yield f"{finding.level:<8} {finding.subject:<18} {finding.text}{code}"
        if finding.advice:
            yield f"{'':27} -> {finding.advice}"
    yield ""
    yield f"verdict: {verdict(findings)}"
    yield ""
    yield from (f"{key}: {value}" for key, value in facts.items())
