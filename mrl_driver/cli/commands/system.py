"""`mrl system`: udev rules and systemd unit."""

import getpass
import os
import sys
from typing import Optional

import click

from mrl_driver.host import system_setup as machine

from .shared import agrees

root_option = click.option(
    "--root",
    default="/",
    show_default=True,
    metavar="FOLDER",
    help="Root of the file system, to prepare an image.",
)
dry_option = click.option("--dry-run", is_flag=True, help="Show the changes without making them.")


@click.group(short_help="Set up this computer for robots: names, permissions, a ROS node.")
def system() -> None:
    """Set up this computer for robots that are plugged in.

    Gives them names and permissions, keeps ModemManager and brltty off their ports, and can start a ROS node for each.

    \b
    Examples:
      mrl system install --dry-run
      sudo mrl system install
      sudo mrl system remove
      sudo "$(which mrl)" system install       if mrl is in a virtual environment
    """


@system.command(short_help="Write a udev rule and a systemd unit; let USER open serial ports.")
@click.option(
    "--user",
    metavar="USER",
    help="User who drives the robots and runs the service; default: you, also under sudo, and for an installed "
    "service as before.",
)
@click.option(
    "--mask-brltty/--keep-brltty",
    "mask",
    default=None,
    help="Keep brltty, the driver of Braille displays, from starting; by default you are asked if it is installed.",
)
@click.option(
    "--page",
    metavar="HOST[:PORT]",
    help="The service also serves the page there; 127.0.0.1 for this computer alone, 0.0.0.0 for a network, "
    '"" for none; default: as before.',
)
@root_option
@dry_option
def install(user: Optional[str], mask: Optional[bool], page: Optional[str], root: str, dry_run: bool) -> None:
    """Write a udev rule and a systemd unit, and let USER open serial ports.

    A robot then has the port /dev/mrl-SERIAL, or one named after its USB socket if its adapter has no serial number of
    its own.  After systemctl enable --now mrl-robot@$(systemd-escape NAME), its ROS node starts at boot, and
    whenever it is plugged in; with --page also the page.  A shutdown stops the robot.  The UART of a Raspberry Pi is
    /dev/mrl-uart.
    """
    who = user or os.environ.get("SUDO_USER") or getpass.getuser()
    user_before, page_before = machine.before(root)
    runs_as = user or user_before or who
    if runs_as != who:
        click.echo(f"the service still runs as {runs_as}; add --user {who} to change that")
    if page is None and page_before:
        click.echo(f"the service still serves the page at {page_before}; add --page '' to end that")
    page = page_before if page is None else page
    if not dry_run:
        click.echo("\n".join(machine.install(who, root, page, runs_as)))
        _mask_brltty(mask, root)
        return
    machine.require_user(who, root)
    for name, text in machine.files(runs_as, page).items():
        click.echo(f"would write {os.path.join(root, name)}:\n\n{text}")
    for words in machine.commands(who, True):
        click.echo(f"would run {' '.join(words)}")


def _mask_brltty(mask: Optional[bool], root: str) -> None:
    """Mask brltty on this machine if the user wants that."""
    units = machine.brltty_units() if machine.is_machine(root) else []
    if not units:
        return
    if mask is None and sys.stdin.isatty():
        mask = agrees(
            "brltty takes the USB adapters of robots for Braille displays, and their ports vanish. Mask it? "
            "(no if you use a Braille display)",
            err=False,
        )
    if mask:
        click.echo("\n".join(machine.mask_brltty()))
    elif mask is None:
        click.echo(f"{' '.join(units)} may take the adapters of robots; add --mask-brltty to prevent that")


@system.command()
@root_option
@dry_option
def remove(root: str, dry_run: bool) -> None:
    """Delete the files that install wrote, and switch the service off.

    Groups and /etc/default/mrl-robot stay as they are, and brltty masked:
    sudo systemctl unmask brltty-udev.service brltty.path brltty.service
    """
    if not dry_run:
        click.echo("\n".join(machine.remove(root)))
        return
    for path in machine.removed(root):
        click.echo(f"would remove {path}" if os.path.lexists(path) else f"{path} does not exist")
