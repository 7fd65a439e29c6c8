"""`mrl doctor`: checks of computer, port, board and robot."""

import math
import re
import sys
import time
from typing import TYPE_CHECKING, Any, Dict, Iterable, List

import click

from mrl_driver.cli.doctor.findings import FAULT, Finding, note, ok, verdict
from mrl_driver.errors import BoardError, ConfigError, LinkError, MrlError, PortBusy, PortDenied, WrongRobot
from mrl_driver.host.named_robots import Target
from mrl_driver.robot.models import Drive
from mrl_driver.transport.address import is_network

from . import shared
from .info import describe
from .progress import answered, waiting
from .shared import Run, run_options

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

FIRST_SONARS_S = 0.5
_BEFORE_ADVICE = re.compile(r"; |: (?=check|choose|flash|set )")


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
            run.confirm("Are the wheels lifted off the ground?  Each turns forward for 2 s.")
        except click.Abort:
            drives = False  # the other checks still run
    checkup = Checkup(run.target, drives, hands, quiet=report or run.as_json)
    checkup.run()
    _print(checkup, report, run.as_json)
    if checkup.code:
        sys.exit(checkup.code)


class Checkup:
    """Runs the checks and keeps the results: `findings`, `facts` of the board, and the exit `code`."""

    def __init__(self, target: Target, drives: bool = False, hands: bool = False, quiet: bool = True) -> None:
        self.target, self._drives, self._hands = target, drives, hands
        self.findings: List[Finding] = []
        self.facts: Dict[str, Any] = {}
        self.code = 0
        self._quiet = quiet

    def run(self) -> None:
        """Run all checks, until one makes the rest impossible."""
        from mrl_driver.cli.doctor import computer
        from mrl_driver.transport.link import describe as describe_port

        port = shared.require_port(self.target)
        self._add(computer.check(port, describe_port(port)))
        try:
            self._examine()
        except MrlError as error:
            self.code = error.exit_code
            known = any(each.level == FAULT for each in self.findings)
            if not (known and isinstance(error, (PortDenied, PortBusy))):
                self._add([_of_error(error, port)])
        if any(finding.level == FAULT for finding in self.findings):
            self.code = self.code or 1

    def _add(self, found: Iterable[Finding]) -> None:
        named = f"--robot {self.target.name}" if self.target.name else f"--port {self.target.port}"
        for finding in found:
            finding = finding._replace(advice=finding.advice.replace("--port PORT", named))
            self.findings.append(finding)
            if not self._quiet:
                from .doctor_view import show

                show(finding)

    def _examine(self) -> None:
        """Check the board, even if no packaged model lists its id."""
        try:
            self._examine_as(self.target)
        except WrongRobot as error:
            if self.facts or self.target.model != "auto":
                raise
            self._add([_of_error(error, shared.require_port(self.target))])
            self._examine_as(self.target._replace(model="traxbot"), any_id=True)

    def _examine_as(self, target: Target, any_id: bool = False) -> None:
        start_s = time.monotonic()
        with answered(shared.connected(target, ignore_battery=True, any_id=any_id)) as driver:
            self._add([ok("answer", f"after {time.monotonic() - start_s:.1f} s")])
            self._check(driver, any_id)

    def _check(self, driver: "Driver", any_id: bool) -> None:
        from mrl_driver.cli.doctor import board, parameters

        if not any_id:
            self._add(board.identity(driver.board, driver.model))
        self._add(board.supply(driver.board, driver.model))
        self._add(board.health(driver.status))
        with waiting("watching the link"):
            seen = board.watch(driver)
        counts, missing = board.counters(driver), shared.await_sensors(driver)
        self.facts = {
            **describe(driver, shared.require_port(self.target)),
            "rate_hz": seen.rate_hz,
            "lost": seen.lost,
            "garbage": seen.garbage,
            "round_trips_ms": [round(each * 1000, 2) for each in seen.round_trips_s],
            "refused_by_board": counts,
        }
        if driver.model is not None and driver.model.drives and driver.parameters.can_save and not any_id:
            values = driver.parameters.read(*(row.name for row in driver.parameters.rows))
            self.facts["parameters"] = values
            self._add(parameters.check(values, driver.model))
        self._add(board.link(seen, by_network=is_network(shared.require_port(self.target))))
        self._add(board.refusals(counts, driver.model is None or driver.model.drives))
        self._add(board.hold(driver.radio.hold))
        self._add(board.gyro(driver))
        self._add(board.build(driver))
        shared.wait_until(
            driver, lambda: not any(map(math.isnan, driver.ranges.values())), FIRST_SONARS_S, 0.05
        )
        self._add(board.sonars(driver.ranges, driver.board))
        self._add(board.sensors(driver.sensors, missing))
        self._check_motion(driver)

    def _check_motion(self, driver: "Driver") -> None:
        from mrl_driver.cli.doctor import wheels

        model = driver.model
        unchecked = note("wheels_unchecked", "wheels", "not checked")
        if model is not None and not model.drives:
            if self._drives:
                self._add([unchecked._replace(text="not checked: this board has no motors", advice="")])
        elif not self._drives:
            self._add([unchecked])
        elif model is not None and not isinstance(model.drive, Drive):
            text, advice = "not checked: this check supports two wheels", "watch the wheels with: mrl drive"
            self._add([unchecked._replace(text=text, advice=advice)])
        else:
            self._add(wheels.check(driver, _ask if sys.stdin.isatty() else None))
        if self._hands:
            self._add(wheels.sonar_order(lambda: driver.ranges, _ask))


def _ask(question: str) -> bool:
    return click.confirm(f"  {question}", default=True)


def _of_error(error: MrlError, port: str) -> Finding:
    """Return an error as a finding, split into its text and its advice."""
    text, advice, *_ = [*_BEFORE_ADVICE.split(str(error).replace("--port PORT", f"--port {port}"), 1), ""]
    subject = (
        "port" if isinstance(error, LinkError) else "board" if isinstance(error, BoardError) else "check"
    )
    return Finding(FAULT, subject, text, advice, error.code)


def _print(checkup: Checkup, report: bool, as_json: bool) -> None:
    findings = checkup.findings
    if as_json:
        shared.print_json(
            {
                "port": checkup.target.port,
                "verdict": verdict(findings),
                "findings": [finding._asdict() for finding in findings],
                "facts": checkup.facts,
            }
        )
    elif report:
        from .doctor_view import report as lines_of

        click.echo("\n".join(lines_of(findings, checkup.facts, checkup.target)))
    else:
        from .doctor_view import conclude

        conclude(findings)
