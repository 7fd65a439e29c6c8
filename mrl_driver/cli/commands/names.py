"""`mrl names`: robots by name."""

import glob
import os
from typing import TYPE_CHECKING, Optional, Tuple

import click

from mrl_driver.errors import ConfigError
from mrl_driver.host import named_robots
from mrl_driver.host.named_robots import Target
from mrl_driver.protocol.table import BAUD, INT16_MAX
from mrl_driver.robot import models
from mrl_driver.transport.address import is_url, require_port

from .progress import waiting
from .shared import BAUDS, complete_port, completion_of, json_option, print_json, print_message

if TYPE_CHECKING:
    from mrl_driver.driver.probe import Answer


@click.group(invoke_without_command=True)
@json_option
@click.pass_context
def names(ctx: click.Context, as_json: bool) -> None:
    """Name robots; list and remove the names.

    A name stands for a port, a model, a baud rate and a robot id: every command refuses another board that answers on
    the port.  The name of a virtual robot (mrl flash --build virtual) refuses a real one, and that of a real one a
    virtual one.  Without a sub-command, lists the names.

    \b
    Examples:
      mrl names add lab3 --port /dev/ttyACM0
      mrl names list --json
      mrl names remove lab3
      mrl --robot lab3 monitor
    """
    if ctx.invoked_subcommand is None:
        ctx.invoke(list_, as_json=as_json)


@names.command("list")
@json_option
def list_(as_json: bool) -> None:
    """List the named robots."""
    named = named_robots.read()
    if as_json:
        keys = ("port", "model", "baud", "id", "virtual")
        print_json({name: {key: getattr(each, key) for key in keys} for name, each in named.items()})
        return
    if not named:
        click.echo("no robot has a name; give one with: mrl names add NAME --port PORT")
    width = max(map(len, named), default=0)
    for name, each in sorted(named.items()):
        baud = "" if each.baud == BAUD else f"  {each.baud} Bd"
        number = "" if each.id is None else f"  robot {each.id}"
        number += "  virtual" if each.virtual else ""
        click.echo(f"{name:<{width}}  {each.port}  {each.model}{number}{baud}")


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
@click.option("--baud", type=BAUDS, default=BAUD, show_default=True, help="Baud rate of the port.")
@click.option(
    "--id",
    "robot_id",
    type=click.IntRange(1, INT16_MAX),
    metavar="ID",
    help="Robot id of its board  [default: the id that answers on the port]",
)
def add(name: str, port: str, model: str, baud: int, robot_id: Optional[int]) -> None:
    """Name a robot, or change the robot that a name stands for.

    The board is asked for its robot id; opening the port resets an Arduino Uno.  If its USB serial number is its own,
    the port's name under /dev/serial/by-id is stored, the same in every socket; otherwise that of the socket.

    \b
    Examples:
      mrl names add lab3 --port /dev/ttyACM0 --model traxbot
      mrl names add lab4 --port /dev/ttyUSB0 --id 4
    """
    named_robots.require_name(name)
    if not port.strip():
        raise ConfigError(f"--port is {port!r}, expected a serial port such as /dev/ttyACM0")
    require_port(port)
    if model != "auto":
        models.load(model)
    if model.endswith((".yaml", ".yml")):
        model = os.path.abspath(model)
    named = named_robots.read()
    from mrl_driver.driver.probe import Answer

    answer = Answer(robot_id) if robot_id is not None else _answer_on(port, baud)
    robot_id, virtual = answer.robot_id or None, "virtual" in answer.capabilities
    stored, lasting = _lasting_name(port)
    named[name] = Target(stored, model, baud, name, robot_id, virtual)
    named_robots.write(named)
    if robot_id is None:
        why = answer.error or "which has no id yet; set it with: mrl set-id"
        print_message(f"warning: {name} is any robot on its port ({why}); add it again then, or give --id")
    kind = "virtual robot" if virtual else "robot"
    click.echo(f"{name} is {'' if robot_id is None else f'{kind} {robot_id} on '}{stored}{lasting}")


def _answer_on(port: str, baud: int) -> "Answer":
    """Return what answers on a port; the reason if nothing does now."""
    from mrl_driver.driver.probe import Answer, probe
    from mrl_driver.transport.reconnect import may_be_there

    if not may_be_there(port):
        return Answer(error="which is not there now")
    with waiting("asking the board for its id"):
        return probe(port, baud)


def _lasting_name(port: str) -> Tuple[str, str]:
    """Return the name of a port that stays the same for the longest, and how long that is, in words."""
    from mrl_driver.transport.port_info import described, described_as, tells_apart

    if is_url(port):
        return port, ""
    there, device = described(), os.path.realpath(port)
    found = described_as(device, there)
    alike = [each for each in there if each.is_like(found) and each.serial == found.serial]
    if found.links and tells_apart(found.serial) and len(alike) == 1:
        return found.links[0], ", wherever it is plugged in"
    sockets = [
        link for link in sorted(glob.glob("/dev/serial/by-path/*")) if os.path.realpath(link) == device
    ]
    if sockets and device == os.path.abspath(port):
        return sockets[0], ", while it is plugged in there"
    return os.path.abspath(port), ""


@names.command()
@click.argument("name", shell_complete=completion_of(lambda: list(named_robots.read())))
def remove(name: str) -> None:
    """Remove a name."""
    named = named_robots.read()
    if name not in named:
        known = ", ".join(sorted(named)) or "a name; there is none yet"
        raise ConfigError(f"name {name!r} is unknown, expected {known}")
    del named[name]
    named_robots.write(named)
    click.echo(f"{name} is removed")
