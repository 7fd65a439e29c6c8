"""Datagrams to a program that may be there or not."""

import socket

from mrl_driver.errors import ConfigError

from .address import UDP, Address, is_url, parse
from .sockets import explain, resolve


class UdpSender:
    """Sends datagrams to HOST:PORT.  Nothing here waits, and a program that does not listen there makes no error.

    If a name has several addresses, an IPv4 address is used: PlotJuggler listens on no other.

    Attributes:
        loss: how many datagrams the system did not accept, and why; empty if there are none.

    Raises:
        ConfigError: `to` does not parse.
        PortMissing: the host name is unknown.
        LinkError: the operating system refused the socket.
    """

    def __init__(self, to: str) -> None:
        self.loss, self._tried, self._lost = "", 0, 0
        self._to = f"--udp {to}"
        found = resolve(_address(to), self._to, socket.SOCK_DGRAM)
        family, kind, protocol, _, self._there = min(found, key=lambda each: each[0] != socket.AF_INET)
        try:
            self._socket = socket.socket(family, kind, protocol)
        except OSError as error:
            raise explain(self._to, error) from None
        self._socket.setblocking(False)

    def send(self, data: bytes) -> None:
        """Send one datagram; what the system does not accept is counted in `loss`."""
        self._tried += 1
        try:
            self._socket.sendto(data, self._there)
        except OSError as error:
            self._lost += 1
            self.loss = (
                f"{self._to}: {self._lost} of {self._tried} datagrams were not sent "
                f"({(error.strerror or str(error)).lower()}); check the address and the network of this computer"
            )

    def close(self) -> None:
        """Close the socket; what is sent later is lost."""
        self._socket.close()


def _address(to: str) -> Address:
    try:
        address = parse(to if is_url(to) else f"udp://{to}")
        if address.scheme not in UDP or address.bind[0]:
            raise ConfigError("another protocol, or a local address")
    except ConfigError:
        raise ConfigError(
            f"--udp is {to!r}, expected HOST:PORT, such as 127.0.0.1:9870 or [::1]:9870"
        ) from None
    return address
