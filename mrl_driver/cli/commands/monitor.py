"""`mrl monitor` and `mrl record`: watch a robot, and drive it."""

import contextlib
import sys
import time
from typing import TYPE_CHECKING, Iterator, Optional

import click

from mrl_driver.host.named_robots import Target
from mrl_driver.view.shown_state import line, snapshot

from .shared import (
    battery_option,
    confirm_overwrite,
    connected,
    fast_option,
    full_screen,
    json_option,
    max_delay_option,
    print_json,
    print_message,
    reconnect_option,
    record_option,
    report_losses,
    require_port,
    robot_options,
    seconds_option,
    warn,
    yes_option,
)

if TYPE_CHECKING:
    from mrl_driver.driver import Driver
    from mrl_driver.transport.udp_sender import UdpSender

LINE_S = 1.0
STALL_S = 0.5
"""Command timeout of the live view [s].  A terminal that accepts no output (Ctrl-S, a stalled connection) blocks the
view, and then the robot stops.
"""


@click.command()
@robot_options
@seconds_option
@battery_option
@record_option
@reconnect_option
@fast_option
@max_delay_option
@yes_option
@json_option
@click.option(
    "--udp",
    metavar="HOST:PORT",
    help="Also send each telemetry there as a JSON datagram; PlotJuggler's UDP server plots it live.",
)
def monitor(
    target: Target,
    seconds: float,
    ignore_battery: bool,
    record: Optional[str],
    reconnect: bool,
    fast: bool,
    max_delay: Optional[float],
    yes: bool,
    as_json: bool,
    udp: Optional[str],
) -> None:
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
    confirm_overwrite(record, yes)
    with _sender(udp) as sender:
        _watch(target, seconds, record, reconnect, fast, as_json, ignore_battery, max_delay, sender)


@click.command()
@robot_options
@seconds_option
@reconnect_option
@fast_option
@yes_option
@click.argument("file", type=click.Path())
def record(target: Target, seconds: float, reconnect: bool, fast: bool, yes: bool, file: str) -> None:
    """Watch a robot live, and record all its bytes in FILE.

    \b
    Examples:
      mrl record --port /dev/ttyACM0 drive.mrl
      mrl replay drive.mrl; mrl plot drive.mrl
    """
    confirm_overwrite(file, yes)
    _watch(target, seconds, file, reconnect, fast)


def _watch(
    target: Target,
    seconds: float,
    file: Optional[str],
    reconnect: bool,
    fast: bool,
    as_json: bool = False,
    ignore_battery: bool = False,
    max_delay_s: Optional[float] = None,
    sender: Optional["UdpSender"] = None,
) -> None:
    if not as_json and full_screen():
        watch_live(
            target,
            seconds,
            file,
            ignore_battery,
            reconnect=reconnect,
            fast=fast,
            max_delay_s=max_delay_s,
            sender=sender,
        )
        return
    with connected(target, ignore_battery=True, record=file, reconnect=reconnect, fast=fast) as driver:
        warn(driver)
        report_losses(driver)
        _stream(driver, sender)
        try:
            _print_lines(driver, seconds, as_json, sender)
        except KeyboardInterrupt:
            return


@contextlib.contextmanager
def _sender(udp: Optional[str]) -> Iterator[Optional["UdpSender"]]:
    """Yield what sends the datagrams of --udp; None without the option.

    Raises:
        ConfigError, PortMissing, LinkError: as `UdpSender`.
    """
    if udp is None:
        yield None
        return
    from mrl_driver.transport.udp_sender import UdpSender

    sender = UdpSender(udp)
    try:
        yield sender
    finally:
        sender.close()
        if sender.loss:
            print_message(f"warning: {sender.loss}")


def _stream(driver: "Driver", sender: Optional["UdpSender"]) -> None:
    """Send the numbers of a connected driver from now on."""
    if sender is not None:
        from mrl_driver.view.live_json import LiveJson

        LiveJson(driver, sender.send, time.time() - time.monotonic())


def _print_lines(driver: "Driver", seconds: float, as_json: bool, sender: Optional["UdpSender"]) -> None:
    end_s = time.monotonic() + seconds
    complete = [each for each in (driver.recorder, sender) if each is not None]
    while time.monotonic() < end_s and not driver.wait(min(LINE_S, max(0.0, end_s - time.monotonic()))):
        if as_json:
            print_json(snapshot(driver))
        else:
            click.echo(line(driver))
        sys.stdout.flush()
        for each in [each for each in complete if each.loss]:
            complete.remove(each)
            print_message(f"warning: {each.loss}")


def watch_live(
    target: Target,
    seconds: float,
    file: Optional[str] = None,
    ignore_battery: bool = False,
    keys_drive: bool = False,
    reconnect: bool = True,
    fast: bool = False,
    max_delay_s: Optional[float] = None,
    sender: Optional["UdpSender"] = None,
) -> None:
    """Run the live view; `keys_drive` refuses an empty battery, as `mrl drive` does.

    `max_delay_s` limits the operator's delay; 0 turns the limit off, None means the default.
    """
    from mrl_driver.safety.operator_delay import MAX_DELAY_S
    from mrl_driver.terminal.frame_log import FrameLog
    from mrl_driver.terminal.live_view import Settings, show

    from .progress import waiting

    log = FrameLog()
    most_s = MAX_DELAY_S if max_delay_s is None else max_delay_s
    settings = Settings(require_port(target), file or "", keys_drive, ignore_battery, most_s)
    connection = connected(
        target,
        moves=keys_drive,
        ignore_battery=ignore_battery or not keys_drive,
        record=file,
        reconnect=reconnect,
        fast=fast,
        command_timeout_s=STALL_S,
        tap=lambda direction, data: log.add_bytes(direction, data, time.monotonic()),
    )
    with waiting("waiting for the board to answer"):
        driver = connection.__enter__()
    try:
        warn(driver)
        _stream(driver, sender)
        show(driver, settings, log, seconds)
    except KeyboardInterrupt:
        pass
    finally:
        connection.__exit__(None, None, None)
    click.echo(line(driver))
