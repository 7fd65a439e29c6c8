"""`mrl monitor` and `mrl record`: watch a robot, and drive it."""

import contextlib
import sys
import time
from typing import TYPE_CHECKING, Optional

import click

from mrl_driver.view.shown_state import line, line_of, snapshot, state_of

from . import shared
from .progress import answered
from .shared import Run, run_options

if TYPE_CHECKING:
    from mrl_driver.driver import Driver
    from mrl_driver.transport.sockets import UdpSender

LINE_S = 1.0
STALL_S = 0.5
"""Command timeout of the live view [s].  A terminal that accepts no output (Ctrl-S, a stalled connection) blocks the
view, and then the robot stops."""


@click.command()
@run_options(*shared.DRIVING, shared.seconds_option, shared.reconnect_option, shared.max_delay_option)
@click.option(
    "--udp",
    metavar="HOST:PORT",
    help="Also send each telemetry there as a JSON datagram; PlotJuggler's UDP server plots it live.",
)
def monitor(run: Run, udp: Optional[str]) -> None:
    """Watch a robot live, and drive it with the keys.

    Shows path, speeds, ranges, battery, link and frames on the whole screen; press Enter to drive with the keys.
    If stdout is not a terminal, prints one line per second; with --json, one JSON object per line.

    \b
    Examples:
      mrl monitor --port /dev/ttyACM0
      mrl monitor --robot lab3 --record drive.mrl
      mrl monitor --robot lab3 --json --seconds 10 > drive.jsonl
      mrl monitor --robot lab3 --udp 127.0.0.1:9870
    """
    run.confirm_overwrite(run.record)
    if udp is None:
        _watch(run)
        return
    from mrl_driver.transport.sockets import UdpSender

    sender = UdpSender(udp)
    try:
        _watch(run, sender)
    finally:
        sender.close()
        if sender.loss:
            shared.print_message(f"warning: {sender.loss}")


@click.command()
@run_options(shared.seconds_option, shared.reconnect_option, shared.fast_option, shared.yes_option)
@click.argument("file", type=click.Path())
def record(run: Run, file: str) -> None:
    """Watch a robot live, and record all its bytes in FILE.

    \b
    Examples:
      mrl record --port /dev/ttyACM0 drive.mrl
      mrl replay drive.mrl; mrl plot drive.mrl
    """
    run.confirm_overwrite(file)
    _watch(run._replace(record=file))


def _watch(run: Run, sender: Optional["UdpSender"] = None) -> None:
    if not run.as_json and shared.full_screen():
        watch_live(run, sender=sender)
        return
    with run.connected() as driver:
        shared.warn(driver)
        shared.report_losses(driver)
        _stream(driver, sender)
        with contextlib.suppress(KeyboardInterrupt):
            _print_lines(driver, run, sender)


def _stream(driver: "Driver", sender: Optional["UdpSender"]) -> None:
    """Send the numbers of a connected driver from now on."""
    if sender is not None:
        from mrl_driver.view.live_json import LiveJson

        LiveJson(driver, sender.send, time.time() - time.monotonic())


def _print_lines(driver: "Driver", run: Run, sender: Optional["UdpSender"]) -> None:
    end_s = time.monotonic() + run.seconds
    complete = [each for each in (driver.recorder, sender) if each is not None]
    while time.monotonic() < end_s and not driver.wait(min(LINE_S, max(0.0, end_s - time.monotonic()))):
        if run.as_json:
            shared.print_json(snapshot(driver))
        else:
            click.echo(line(driver))
        sys.stdout.flush()
        for each in [each for each in complete if each.loss]:
            complete.remove(each)
            shared.print_message(f"warning: {each.loss}")


def watch_live(run: Run, keys_drive: bool = False, sender: Optional["UdpSender"] = None) -> None:
    """Run the live view; `keys_drive` refuses an empty battery, as `mrl drive` does."""
    from mrl_driver.clocks import clock_s
    from mrl_driver.safety.operator_delay import MAX_DELAY_S
    from mrl_driver.terminal import live_view
    from mrl_driver.terminal.frame_log import FrameLog

    log = FrameLog()
    most_s = MAX_DELAY_S if run.max_delay_s is None else run.max_delay_s
    port = shared.require_port(run.target)
    settings = live_view.Settings(port, run.record or "", keys_drive, run.ignore_battery, most_s)
    connection = run.connected(
        moves=keys_drive,
        command_timeout_s=STALL_S,
        tap=lambda direction, data: log.add_bytes(direction, data, clock_s()),
    )
    with answered(connection) as driver:
        shared.warn(driver)
        _stream(driver, sender)
        with contextlib.suppress(KeyboardInterrupt):
            live_view.run(driver, live_view.Screen(driver, settings, log), run.seconds)
        shown = state_of(driver)
    click.echo(line_of(shown._replace(pose=driver.pose, twist=driver.twist)))  # a closed link has no ranges
