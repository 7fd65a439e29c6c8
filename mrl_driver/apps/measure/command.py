"""`mrl measure`: measure a board or a robot, and compare it with the emulated figures."""

import contextlib
import os
import select
import shutil
import sys
import time
from typing import TYPE_CHECKING, Any, Callable, Iterable, List, Optional, Sequence, Tuple

import click

from mrl_driver.cli.commands import shared
from mrl_driver.cli.commands.info import describe
from mrl_driver.cli.commands.progress import waiting
from mrl_driver.cli.commands.shared import Run, run_options
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.files import replace_file, require_writable
from mrl_driver.json_text import json_text

if TYPE_CHECKING:
    from mrl_driver.apps.measure.rows import Row
    from mrl_driver.robot.models import RobotModel


@click.command(short_help="Measure a board or a robot: turnaround, stream, watchdog, stop, manoeuvres.")
@run_options(shared.battery_option, shared.yes_option, shared.json_option)
@click.option(
    "--wheels-off-ground", "lifted", is_flag=True, help="Turn the wheels too; lift them off the ground first."
)
@click.option(
    "--drive",
    "drives",
    is_flag=True,
    help="Drive eight manoeuvres on the floor too; asks first, and names the space.",
)
@click.option(
    "--truth",
    metavar="FILE",
    help="With --drive: file of mrl-sim --truth with the true poses of an emulated robot.",
)
@click.option(
    "-o", "--output", default="measure.json", show_default=True, metavar="FILE", type=click.Path(),
    help="File to write, and with the ending .html the page.",
)  # fmt: skip
@click.option("--about", metavar="TEXT", help="What the board is, such as 'Uno R3, copy with CH340'.")
@click.option(
    "--compare", nargs=2, type=click.Path(), metavar="A B", help="Compare two files instead of measuring."
)
def measure(
    run: Run,
    lifted: bool,
    drives: bool,
    truth: Optional[str],
    output: str,
    about: Optional[str],
    compare: Optional[Tuple[str, str]],
) -> None:
    """Measure a board or a robot, and compare it with the emulated figures.

    Takes half a minute, 20 s more with turning wheels, and with --drive two and a half minutes and the time that you
    need to measure.  Nothing moves, unless the board is a virtual one, or you say that the wheels are off the ground.
    Opening the port resets an Arduino Uno.  After Ctrl-C or an error, the files have what was measured before.

    The exit code is 0 if no row is worse than it should be, 1 if one is, and that of the error if one ends the
    measurement.

    \b
    Examples:
      mrl measure --port /dev/ttyACM0
      mrl measure --port /dev/ttyACM0 --wheels-off-ground --about "Nano, copy with CH340"
      mrl measure --port /dev/ttyACM0 --drive      on the floor: measure each end with a tape or a laser
      mrl measure --compare monday.json friday.json
    """
    from mrl_driver.apps.measure import report

    if compare:
        first, second = map(report.load, compare)
        facts = report.compared(first, second)
        run.print(facts, "\n".join(report.comparison(facts)))
        return
    require_writable(output, "--output", (".json",))
    if lifted and drives:
        raise ConfigError("--wheels-off-ground is given with --drive, expected one of them")
    run.confirm_overwrite(output)
    found, ended = _Measured(), None
    try:
        found.measure(run, lifted, drives, truth)
    except (MrlError, KeyboardInterrupt, click.Abort) as error:
        if not found.rows:
            raise
        ended = error
    result = found.result(about, None if ended is None else str(ended) or "interrupted")
    page = f"{os.path.splitext(output)[0]}.html"
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else report.WIDE
    try:
        replace_file(output, json_text(result) + "\n")
        replace_file(page, report.render(result))
    finally:
        run.print({"page": page, **result}, "\n".join([*report.lines(result, columns), page]))
    if ended is not None:
        raise ended
    if result["causes"]:
        sys.exit(1)


class _Measured:
    """What was measured so far.

    Attributes:
        rows: the rows.
    """

    def __init__(self) -> None:
        from mrl_driver.apps.measure.rows import HOST, LINE, keys_of

        self.rows: List[Row] = []
        self._keys = keys_of(LINE, HOST)
        self._board: Any = {}
        self._findings: Sequence[Any] = ()
        self._kind = self._port = ""

    def measure(self, run: Run, lifted: bool, drives: bool, truth: Optional[str]) -> None:
        """Measure with the driver, then on the bare link."""
        from mrl_driver.apps.measure import course, host, line
        from mrl_driver.apps.measure.rows import kind_of
        from mrl_driver.session.events import Reconnected
        from mrl_driver.transport.open_link import open_link
        from mrl_driver.transport.port_info import describe as port_of
        from mrl_driver.transport.port_info import text_of

        port = shared.require_port(run.target)
        opened, described = [port], port_of(port)
        self._port = text_of(described.vendor, described.product) if described.vendor else "not on USB"
        asks = sys.stdin.isatty() and not run.yes
        unplug = asks and not run.as_json
        with run.connected(moves=lifted or drives, reconnect=unplug, imu_period_ms=0) as driver:
            driver.on_event(
                lambda event: opened.append(event.port) if isinstance(event, Reconnected) else None
            )
            model, virtual = driver.model, driver.board.virtual
            if drives and model is not None:
                _require_floor(model, run.yes or virtual or truth is not None)
                self._keys += course.keys(model)
            moves = model is not None and model.has_odometry and (lifted or drives or virtual)
            self._board, self._kind = describe(driver, port), kind_of(driver.board)
            self._findings = host.findings(driver)
            with waiting("measuring with the driver"):
                self._add(host.rows(driver, moves))
            if drives:
                self._add(course.rows(driver, course.source(driver, truth, asks)))
            self._add(host.unplugged(driver, port, _ask if unplug else None))
        with waiting("measuring the line"), contextlib.closing(
            open_link(opened[-1], run.target.baud)
        ) as link:
            self._add(line.rows(link, time.monotonic, moves, driver.board.protocol < 2))

    def _add(self, part: Iterable["Row"]) -> None:
        for row in part:
            self.rows.append(row)

    def result(self, about: Optional[str], ended: Optional[str]) -> Any:
        """Return what the file holds; rows are missing because the measurement `ended` early, or of an old board."""
        from mrl_driver.apps.measure import report
        from mrl_driver.apps.measure.rows import OLD, absent, compared

        known = {row.key for row in self.rows}
        missing = [absent(key, OLD if ended is None else ended) for key in self._keys if key not in known]
        rows = [compared(each, self._kind) for each in (*self.rows, *missing)]
        return report.record(rows, self._board, self._findings, about or self._port)


def _require_floor(model: "RobotModel", agreed: bool) -> None:
    """Ask for the space before the robot drives; raise ConfigError if it cannot, or nothing counts how far."""
    from mrl_driver.apps.measure.course import SPACE

    model.require_odometry()
    shared.confirm_motion(
        f"The robot drives by itself for a minute and a half. Does it have {SPACE}?", agreed
    )


def _ask(text: str) -> Callable[[], bool]:
    """Ask the user to do something; return what reports whether Enter was pressed since."""
    shared.print_message(text)
    return lambda: bool(select.select([sys.stdin], [], [], 0)[0] and (sys.stdin.readline() or True))
