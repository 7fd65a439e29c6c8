"""`mrl replay`: prints figures of a recording, or plays it on a virtual serial port."""

import json
import math
import os
import signal
import sys
from typing import Any, Dict, Optional

import click

from mrl_driver.cli.commands.progress import progress
from mrl_driver.cli.commands.shared import Between, json_option, print_message
from mrl_driver.errors import ConfigError, one_line
from mrl_driver.recording.recording import Recording


@click.command(short_help="Summarise a recording, or play it again.")
@click.argument("file")
@json_option
@click.option(
    "--robot", default="auto", show_default=True, help="Robot model: auto, a name, or a .yaml file."
)
@click.option("--pty", is_flag=True, help="Instead, play the board's bytes on a virtual serial port.")
@click.option(
    "--speed",
    type=Between(0, 1e6),
    help="With --pty: factor over the recorded speed; 0 is as fast as possible.",
)
@click.option(
    "--link", metavar="NAME", help="With --pty: make a symbolic link to the port, and remove it at the end."
)
def main(
    file: str, as_json: bool, robot: str, pty: bool, speed: Optional[float], link: Optional[str]
) -> None:
    """Print a summary of a recording, or play it on a virtual serial port.

    With --pty, prints the path of the port.  Each program that opens the port gets the recording from its start: the
    answers when it asks (or after 1 s without a request), then the rest at the recorded times.  Ends when a program
    has received the whole recording.

    Example: mrl replay drive.mrl --pty --speed 4
    """
    recording = Recording(file)
    if not pty:
        if speed is not None or link is not None:
            raise ConfigError("--speed or --link is given without --pty; add --pty")
        from mrl_driver.driver.recorded import RecordedDriver
        from mrl_driver.driver.recording_summary import summarise

        with progress(f"reading {os.path.basename(file)}", 1.0) as advance:
            figures = summarise(RecordedDriver(recording, robot), advance)
        show(figures, as_json)
        return
    if as_json:
        raise ConfigError("--json is given with --pty, expected one of them")
    serve(recording, math.inf if speed == 0 else speed or 1.0, link)


def show(figures: Dict[str, Any], as_json: bool) -> None:
    """Print the figures of `summarise` as text, or as JSON for programs."""
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
    return (
        f"{value:.3f}" if isinstance(value, float) else "unknown" if value is None else one_line(str(value))
    )


def serve(recording: Recording, speed: float, link: Optional[str] = None) -> None:
    """Plays the board's bytes on a pty, from the start for each program, until one has received all of them."""
    from sim_arduino.serve.pty import PtyPort, SymbolicLink

    from .playback import play

    port = PtyPort()
    name = SymbolicLink(link, port.path) if link else None
    signal.signal(signal.SIGTERM, _end)
    try:
        click.echo(port.path)
        sys.stdout.flush()
        play(recording, port, speed, print_message)
        print_message(f"{recording.path} is over")
    except KeyboardInterrupt:
        return
    finally:
        if name:
            name.remove()
        port.close()


def _end(*_: Any) -> None:
    raise KeyboardInterrupt
