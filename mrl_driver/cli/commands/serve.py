"""`mrl serve`: offer a robot's serial port on the network."""

import contextlib
import signal
from typing import TYPE_CHECKING, List, Tuple

import click

from mrl_driver.errors import ConfigError
from mrl_driver.host import access
from mrl_driver.host.named_robots import Target
from mrl_driver.transport.address import TLS, UDP, Address, parse

from .shared import print_message, require_port, robot_options

if TYPE_CHECKING:
    from mrl_driver.transport.listener import Listener


@click.command(short_help="Put a robot's port on the network.")
@robot_options
@click.option(
    "--listen",
    metavar="URL",
    required=True,
    help="tls://ADDRESS:PORT, tcp://ADDRESS:PORT or udp://ADDRESS:PORT; ADDRESS is one of this computer's, or 0.0.0.0 "
    "for all of them.",
)
@click.option(
    "--insecure",
    is_flag=True,
    help="Listen without encryption and token: everybody who can reach the address can drive the robot.",
)
@click.option(
    "--new-tokens",
    is_flag=True,
    help="Make other tokens first; links that were printed before no longer work after a restart.",
)
def serve(target: Target, listen: str, insecure: bool, new_tokens: bool) -> None:
    """Pass bytes between a robot's port and one client on the network.

    On an address that other computers can reach, the connection is encrypted, and a client needs the link that is
    printed.  On 127.0.0.1, tcp:// and udp:// need no link.  The robot stops when the client disconnects or this command
    ends.

    \b
    Examples:
      mrl serve --port /dev/ttyACM0 --listen tls://10.0.0.7:7000
      mrl serve --robot lab3 --listen udp://10.0.0.7:7000 --insecure
    """
    from mrl_driver.driver.suspension import on_suspend
    from mrl_driver.transport.open_link import open_link
    from mrl_driver.transport.relay import Bridge

    port, address = require_port(target), parse(listen, listening=True)
    _require_secure(address, insecure)
    if new_tokens:
        access.tokens(renew=True)
    with contextlib.ExitStack() as stack:
        stack.enter_context(on_suspend(signal.SIG_IGN))  # a suspended bridge passes no stop
        listener, links = _listen(address, insecure)
        stack.callback(listener.close)
        link = open_link(port, target.baud)
        stack.callback(link.close)
        who = "has this link" if links else "can reach this address"
        names = links or [str(listener.address)]
        click.echo(
            "\n".join(f"{name} serves {port}; everybody who {who} can drive the robot" for name in names)
        )
        Bridge(link, listener, print_message).run()


def _require_secure(address: Address, insecure: bool) -> None:
    """Check that UDP, which is never encrypted, is for this computer alone, or wanted so.

    Raises:
        ConfigError: it is not.
    """
    if address.scheme in UDP and not insecure and not access.is_loopback(address.host):
        raise ConfigError(
            f"{address} would let everybody on the network drive the robot: UDP has neither encryption nor token; "
            f"use {address._replace(scheme='tls')}, or add --insecure"
        )
    if address.scheme in TLS and insecure:
        raise ConfigError(f"--insecure is given with {address}, expected tcp:// or udp:// with it")


def _listen(address: Address, insecure: bool) -> Tuple["Listener", List[str]]:
    """Listen; return the links for clients as well, none if it is not encrypted."""
    if address.scheme not in TLS and (insecure or access.is_loopback(address.host)):
        from mrl_driver.transport.listener import listen

        return listen(str(address)), []
    from mrl_driver.host import certificate
    from mrl_driver.transport.tls_listener import TlsListener

    tokens = access.tokens()
    context = certificate.context([address.host], print_message)
    listener = TlsListener(
        address._replace(scheme="tls"),
        context,
        lambda token: tokens.role(token) == access.DRIVE,
        print_message,
    )
    found = certificate.fingerprint()
    ends = [listener.address._replace(host=host) for host in access.reachable(address.host)]
    return listener, [f"{str(end).replace('://', f'://{tokens.drive}@')}?sha256={found}" for end in ends]
