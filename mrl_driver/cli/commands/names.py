"""`mrl names`: robots by name."""

import os
from typing import Any, Dict, List, Optional

import click

from mrl_driver.errors import ConfigError
from mrl_driver.host import named_robots
from mrl_driver.host.named_robots import Target
from mrl_driver.protocol.table import BAUD
from mrl_driver.robot import models
from mrl_driver.transport.address import is_url, require_port

from .shared import complete_port, json_option, print_json


@click.group(invoke_without_command=True)
@json_option
@click.pass_context
def names(ctx: click.Context, as_json: bool) -> None:
    """Name robots; list and remove the names.

    A name stands for a port, a model and a baud rate.  Without a sub-command, lists the names.

    \b
    Examples:
      mrl names add lab3 --port /dev/ttyACM0
      mrl names list --json
      mrl names remove lab3
      mrl --robot lab3 monitor
    """
    if ctx.invoked_subcommand is None:
        _list(as_json)


def _complete_name(ctx: click.Context, param: click.Parameter, incomplete: str) -> List[str]:
    """Return the named robots, for shell completion."""
    try:
        return [name for name in named_robots.read() if name.startswith(incomplete)]
    except ConfigError:
        return []


@names.command("list")
@json_option
def list_(as_json: bool) -> None:
    """List the named robots."""
    _list(as_json)


def _list(as_json: bool) -> None:
    named = named_robots.read()
    if as_json:
        print_json({name: _entry(each) for name, each in named.items()})
        return
    if not named:
        click.echo("no robot has a name; give one with: mrl names add NAME --port PORT")
    width = max(map(len, named), default=0)
    for name, each in sorted(named.items()):
        baud = "" if each.baud == BAUD else f"  {each.baud} Bd"
        click.echo(f"{name:<{width}}  {each.port}  {each.model}{baud}")


def _entry(target: Target) -> Dict[str, Any]:
    return {"port": target.port, "model": target.model, "baud": target.baud}


@names.command()
@click.argument("name")
@click.option(
    "--port",
    metavar="PORT",
    required=True,
    shell_complete=complete_port,
    help="Serial port; it need not exist yet.",
)
@click.option("--model", default="auto", show_default=True, help="Robot model, or a .yaml file.")
@click.option("--baud", type=int, default=BAUD, show_default=True, help="Baud rate of the port.")
def add(name: str, port: str, model: str, baud: int) -> None:
    """Name a robot, or change the robot that a name stands for.

    If the board has a serial number, its name under /dev/serial/by-id is stored, which stays the same on every port.

    \b
    Example:
      mrl names add lab3 --port /dev/ttyACM0 --model traxbot
    """
    named_robots.require_name(name)
    named_robots.require_baud(baud, "--")
    if not port.strip():
        raise ConfigError(f"--port is {port!r}, expected a serial port such as /dev/ttyACM0")
    require_port(port)
    if model != "auto":
        models.load(model)
    if model.endswith((".yaml", ".yml")):
        model = os.path.abspath(model)
    named = named_robots.read()
    persistent = _persistent_name(port)
    named[name] = Target(persistent or (port if is_url(port) else os.path.abspath(port)), model, baud, name)
    named_robots.write(named)
    click.echo(f"{name} is {named[name].port}" + (", wherever it is plugged in" if persistent else ""))


def _persistent_name(port: str) -> Optional[str]:
    """Return the port's name under /dev/serial/by-id, if a serial number makes it unique."""
    from mrl_driver.transport.link import describe

    found = describe(port)
    return found.links[0] if found.links and found.serial else None


@names.command()
@click.argument("name", shell_complete=_complete_name)
def remove(name: str) -> None:
    """Remove a name."""
    named = named_robots.read()
    if name not in named:
        known = ", ".join(sorted(named)) or "a name; there is none yet"
        raise ConfigError(f"name {name!r} is unknown, expected {known}")
    del named[name]
    named_robots.write(named)
    click.echo(f"{name} is removed")
