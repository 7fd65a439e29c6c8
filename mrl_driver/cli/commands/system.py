"""`mrl system`: udev rules and systemd unit."""

import getpass
import os
from typing import List, Optional

import click

from mrl_driver.host import system_setup as machine

root_option = click.option(
    "--root", default="/", show_default=True, metavar="FOLDER", help="Root of the file system, for images."
)
dry_option = click.option("--dry-run", is_flag=True, help="Show what would be done, and do nothing.")


@click.group(short_help="Make this machine know robots when plugged in.")
def system() -> None:
    """Make this machine know robots: names, permissions, no ModemManager, a ROS node at plugging in.

    \b
    Examples:
      mrl system install --dry-run
      sudo mrl system install
      sudo mrl system remove
      sudo $(which mrl) system install       from a virtual environment, which sudo does not look in
    """


@system.command(short_help="Write the udev rule and the unit; let USER open ports.")
@click.option("--user", metavar="USER", help="Who drives the robots; by default who asks, or called sudo.")
@root_option
@dry_option
def install(user: Optional[str], root: str, dry_run: bool) -> None:
    """Write a udev rule and a unit for systemd, and let USER open serial ports.

    Robots are then /dev/mrl-SERIAL, and systemctl enable --now mrl-robot@SERIAL starts the ROS node whenever that
    one is plugged in.
    """
    who = user or os.environ.get("SUDO_USER") or getpass.getuser()
    if not dry_run:
        _say(machine.install(who, root))
        return
    machine.require_user(who, root)
    for name, text in machine.files(who).items():
        click.echo(f"would write {os.path.join(root, name)}:\n\n{text}")
    for words in machine.commands(who, True):
        click.echo(f"would run {' '.join(words)}")


@system.command()
@root_option
@dry_option
def remove(root: str, dry_run: bool) -> None:
    """Delete what install wrote; groups stay as they are."""
    if not dry_run:
        _say(machine.remove(root))
        return
    for name in (machine.RULES, machine.UNIT):
        path = os.path.join(root, name)
        click.echo(f"would remove {path}" if os.path.lexists(path) else f"{path} is not there")


def _say(lines: List[str]) -> None:
    for line in lines:
        click.echo(line)
