"""`mrl serve`: offer a robot's serial port on the network."""

import contextlib
import signal
from typing import Optional

import click

from mrl_driver.errors import ConfigError
from mrl_driver.host import access
from mrl_driver.host.named_robots import Target
from mrl_driver.robot import models
from mrl_driver.transport.address import parse

from .shared import FOREVER_S, Between, print_message, require_port, robot_options


@click.command(short_help="Put a robot's port on the network.")
@robot_options
@click.option(
    "--listen",
    metavar="URL",
    required=True,
    help="tcp://ADDRESS:PORT or udp://ADDRESS:PORT; ADDRESS is one of this computer's, or 0.0.0.0 for all of them.",
)
@click.option(
    "--insecure",
    is_flag=True,
    help="Listen beyond this computer: everybody who can reach the address can drive the robot.",
)
@click.option(
    "--port-timeout",
    "port_timeout_s",
    type=Between(0),
    default=FOREVER_S,
    help="End if the robot cannot be served within this time after the start [s]; default: wait for it.",
)
def serve(target: Target, listen: str, insecure: bool, port_timeout_s: float) -> None:
    """Pass bytes between a robot's port and one client on the network.

    There is neither encryption nor a password, so the address is one that only this computer reaches; other computers
    come through a tunnel, such as ssh -L 7000:127.0.0.1:7000 ROBOT.  The robot stops when the client disconnects or
    this command ends.  If the board is unplugged, the client is disconnected with the reason, and the same robot is
    served again when it is back, also on another port; another robot is not.

    \b
    Examples:
      mrl serve --port /dev/ttyACM0 --listen tcp://127.0.0.1:7000
      mrl serve --robot lab3 --listen udp://10.0.0.7:7000 --insecure
    """
    from mrl_driver.driver.served_robot import ServedRobot
    from mrl_driver.driver.suspension import on_suspend
    from mrl_driver.transport.listener import listen as listen_on
    from mrl_driver.transport.relay import Bridge

    port, address = require_port(target), parse(listen, listening=True)
    if not insecure and not access.is_loopback(address.host):
        raise ConfigError(
            f"{address} would let everybody on the network drive the robot: listen on "
            f"{address._replace(host='127.0.0.1')} and let other computers come through a tunnel (ssh -L), or add "
            "--insecure"
        )
    with contextlib.ExitStack() as stack:
        stack.enter_context(on_suspend(signal.SIG_IGN))  # a suspended bridge passes no stop
        listener = listen_on(listen)
        stack.callback(listener.close)
        click.echo(
            f"{listener.address} serves {port}; everybody who can reach this address can drive the robot"
        )
        robot = ServedRobot(port, print_message, target.baud, target.id, port_timeout_s, _virtual(target))
        Bridge(robot.find, robot.lose, listener, print_message).run()


def _virtual(target: Target) -> Optional[bool]:
    """Return whether the robot is virtual, as its name or model says; None accepts both."""
    if target.virtual is None and target.model != "auto":
        return models.is_virtual(models.load(target.model))
    return target.virtual
