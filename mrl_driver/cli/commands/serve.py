"""`mrl serve`: offer a robot's serial port on the network."""

import contextlib
import signal

import click

from mrl_driver.host.named_robots import Target

from .shared import print_message, require_port, robot_options


@click.command(short_help="Put a robot's port on the network.")
@robot_options
@click.option(
    "--listen",
    metavar="URL",
    required=True,
    help="tcp://ADDRESS:PORT or udp://ADDRESS:PORT; ADDRESS is one of this computer's, or 0.0.0.0 for all of them.",
)
def serve(target: Target, listen: str) -> None:
    """Pass bytes between a robot's port and one client on the network.

    There is no password: everybody who can reach the address can drive the robot.  Use a network of your own, or
    127.0.0.1 and a tunnel (ssh -L 7000:127.0.0.1:7000 robot).  The robot stops when the client disconnects or this
    command ends.

    \b
    Examples:
      mrl serve --port /dev/ttyACM0 --listen tcp://10.0.0.7:7000
      mrl serve --robot lab3 --listen udp://10.0.0.7:7000
    """
    from mrl_driver.driver.suspension import on_suspend
    from mrl_driver.transport.listener import listen as listen_on
    from mrl_driver.transport.open_link import open_link
    from mrl_driver.transport.relay import Bridge

    port = require_port(target)
    with contextlib.ExitStack() as stack:
        stack.enter_context(on_suspend(signal.SIG_IGN))  # a suspended bridge passes no stop
        listener = listen_on(listen)
        stack.callback(listener.close)
        link = open_link(port, target.baud)
        stack.callback(link.close)
        click.echo(
            f"{listener.address} serves {port}; everybody who can reach this address can drive the robot"
        )
        Bridge(link, listener, print_message).run()
