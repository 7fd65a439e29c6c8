"""`mrl serve`: offer a robot's serial port on the network."""

import contextlib

import click

from mrl_driver.host.named_robots import Target

from .shared import complain, require_port, robot_options


@click.command(short_help="Put a robot's port on the network.")
@robot_options
@click.option(
    "--listen",
    metavar="URL",
    required=True,
    help="tcp://ADDRESS:PORT or udp://ADDRESS:PORT, ADDRESS being one of this computer's; 0.0.0.0 is all of them.",
)
def serve(target: Target, listen: str) -> None:
    """Pass bytes between a robot's port and one client on the network.

    Whoever reaches the address drives the robot: there is no password.  Use a network of your own, or 127.0.0.1 and
    a tunnel (ssh -L 7000:127.0.0.1:7000 robot).  When the client leaves, or this ends, the robot is stopped.

    \b
    Examples:
      mrl serve --port /dev/ttyACM0 --listen tcp://10.0.0.7:7000
      mrl serve --robot lab3 --listen udp://10.0.0.7:7000
    """
    from mrl_driver.transport.listener import listen as listen_on
    from mrl_driver.transport.open_link import open_link
    from mrl_driver.transport.relay import Bridge

    port = require_port(target)
    with contextlib.ExitStack() as stack:
        listener = listen_on(listen)
        stack.callback(listener.close)
        link = open_link(port, target.baud)
        stack.callback(link.close)
        click.echo(f"{listener.address} serves {port}; whoever reaches this address drives the robot")
        Bridge(link, listener, complain).run()
