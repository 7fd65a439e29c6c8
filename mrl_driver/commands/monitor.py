"""`mrl monitor` and `mrl record`: watch a robot, and drive it."""

from typing import Optional

import click

from ..names import Target
from .shared import connected, demand_seconds, record_option, robot_options, seconds_option, warn


@click.command()
@robot_options
@seconds_option
@record_option
def monitor(target: Target, seconds: float, record: Optional[str]) -> None:
    """Watch a robot: pose, speeds, ranges, battery, link.

    Without a terminal it prints a line a second.

    \b
    Example:
      mrl monitor --port /dev/ttyACM0
    """
    _watch(target, seconds, record)


@click.command()
@robot_options
@seconds_option
@click.argument("file", type=click.Path())
def record(target: Target, seconds: float, file: str) -> None:
    """Watch a robot, and keep every byte both ways in FILE.

    \b
    Example:
      mrl record --port /dev/ttyACM0 drive.mrl; mrl replay drive.mrl
    """
    _watch(target, seconds, file)


def _watch(target: Target, seconds: float, file: Optional[str]) -> None:
    demand_seconds(seconds)
    with connected(target, ignore_battery=True, record=file) as driver:
        warn(driver)
        from .. import live

        try:
            live.watch(driver, seconds)
        except KeyboardInterrupt:
            return
