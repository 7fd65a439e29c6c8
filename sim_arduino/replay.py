"""`mrl replay`: a recording as figures, or as a board on a virtual serial port."""

import json
import math
import os
import select
import signal
import sys
import time
from typing import Any, Dict, Iterator, Optional

import click

from mrl_driver import robots
from mrl_driver.errors import ConfigError
from mrl_driver.log_summary import summarise
from mrl_driver.recording import FROM_BOARD, TO_BOARD, Entry, Recording

from .port import Link, PtyPort

POLL_S = 0.02
QUIET_POLLS = 5
LISTENER_S = 1.0
"""A program that has asked nothing for so long only listens."""


@click.command(short_help="Say what a recording holds, or play it again.")
@click.argument("file")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option(
    "--robot", default="auto", show_default=True, help="Robot model: auto, a name, or a .yaml file."
)
@click.option("--pty", is_flag=True, help="Serve the board's side on a virtual serial port instead.")
@click.option("--speed", type=float, help="With --pty: times as fast as recorded; 0 is as fast as it goes.")
@click.option("--link", metavar="NAME", help="With --pty: symbolic link to the port, removed at the end.")
def main(
    file: str, as_json: bool, robot: str, pty: bool, speed: Optional[float], link: Optional[str]
) -> None:
    """Say what a recording holds, or play it on a virtual serial port.

    With --pty it prints the port's path, begins when a program opens the port and asks, or listens for 1 s, and ends
    with the recording.

    Example: mrl replay drive.mrl --pty --speed 4
    """
    recording = Recording(file)
    if not pty:
        if speed is not None or link is not None:
            raise ConfigError("--speed or --link is given without --pty, expected both or none")
        show(summarise(recording, None if robot == "auto" else robots.load(robot)), as_json)
        return
    if as_json:
        raise ConfigError("--json is given with --pty, expected one of them")
    serve(recording, _demand_speed(1.0 if speed is None else speed), link)


def _demand_speed(speed: float) -> float:
    if not 0 <= speed <= 1e6:
        raise ConfigError(f"--speed is {speed}, expected 0 to 1e6")
    return speed or math.inf


def show(figures: Dict[str, Any], as_json: bool) -> None:
    """Print the figures of `summarise`, for people or for programs."""
    if as_json:
        click.echo(json.dumps(figures))
        return
    for key, value in figures.items():
        if key != "skipped":
            click.echo(f"{key.replace('_', ' '):>20}  {_human(value)}")
    for number, reason in figures["skipped"].items():
        click.echo(f"{figures['file']}:{number}: skipped: {reason}")


def _human(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {_human(each)}" for name, each in value.items()) or "none"
    return f"{value:.3f}" if isinstance(value, float) else "unknown" if value is None else str(value)


def serve(recording: Recording, speed: float, link: Optional[str] = None) -> None:
    """Plays what came from the board on a pty, once a program has opened it.

    Raises:
        ConfigError: the link cannot be made.
    """
    port = PtyPort()
    name = Link(link, port.path) if link else None
    signal.signal(signal.SIGTERM, _end)
    try:
        click.echo(port.path)
        sys.stdout.flush()
        _await_program(port)
        if _begins_with_a_question(recording):
            _await_question(port)
        for data in paced(_board_side(recording), speed):
            _write_all(port, data)
        _drain(port)
    except KeyboardInterrupt:
        return
    finally:
        if name:
            name.remove()
        port.close()


def _end(*_: Any) -> None:
    raise KeyboardInterrupt


def _board_side(recording: Recording) -> Iterator[Entry]:
    return (entry for entry in recording if entry.way == FROM_BOARD)


def paced(entries: Iterator[Entry], speed: float) -> Iterator[bytes]:
    """The bytes of the entries, each not before its time; the first at once."""
    start_s: Optional[float] = None
    for entry in entries:
        due_s = entry.time_s / speed
        now_s = time.monotonic()
        start_s = now_s - due_s if start_s is None else start_s
        if start_s + due_s > now_s:
            time.sleep(start_s + due_s - now_s)
        yield entry.data


def _await_program(port: PtyPort) -> None:
    while not port.opened_anew():
        if port.watch is None:
            return
        select.select([port.watch], [], [], POLL_S)


def _begins_with_a_question(recording: Recording) -> bool:
    first = next((entry.way for entry in recording if entry.way in (TO_BOARD, FROM_BOARD)), FROM_BOARD)
    return first == TO_BOARD


def _await_question(port: PtyPort) -> None:
    """Answers that come before a program asks are lost, for programs empty a port that they open."""
    end_s = time.monotonic() + LISTENER_S
    while not port.read_all() and port.master is not None and time.monotonic() < end_s:
        select.select([port.master], [], [], POLL_S)


def _write_all(port: PtyPort, data: bytes) -> None:
    """Sends all of `data`, as slowly as the program reads; what that sends is thrown away."""
    port.read_all()
    port.opened_anew()
    while data and port.master is not None and port.is_open:
        if not select.select([], [port.master], [], POLL_S)[1]:
            port.opened_anew()
            continue
        data = data[os.write(port.master, data) :]


def _drain(port: PtyPort) -> None:
    """Waits until the program has read everything, or is gone: a port that closes takes the rest with it.

    The system refills what can be read from further buffers, so nothing must be there for some time.
    """
    quiet = 0
    while port.is_open and quiet < QUIET_POLLS:
        quiet = 0 if port.unread() else quiet + 1
        time.sleep(POLL_S)
        port.opened_anew()
