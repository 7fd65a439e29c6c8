"""Links over a network: a TCP connection to a serial bridge (ser2net, an ESP as WiFi bridge), and UDP datagrams.

Both have a descriptor, so `DescriptorLink` reads and writes them like a serial port.  `UdpSender` sends datagrams to a
program that may be there or not.
"""

import contextlib
import errno
import os
import socket
from typing import Any, Dict, List, Optional, Tuple, Type

from mrl_driver.errors import ConfigError, LinkError, LinkLost, PortDenied, PortMissing, shortage

from .address import UDP, Address, is_url, parse
from .link import READ_SIZE, DescriptorLink
from .listener import REASON, prompt

_REMEDY = {
    errno.ECONNREFUSED: "nothing listens there; start the bridge, or check the port number",
    errno.ETIMEDOUT: "check the address, the bridge's power and the network; a firewall may be in between",
    errno.EHOSTUNREACH: "check the address, the bridge's power and the network",
    errno.ENETUNREACH: "check the network of this computer",
    errno.EADDRNOTAVAIL: "this computer has no such address; check the part behind bind=",
    errno.EADDRINUSE: "another program has this computer's port; check the part behind bind=",
    errno.ECONNRESET: "the bridge may have restarted, or serve another program",
}

HEARD = 24  # number of first bytes that the error quotes if the connection ends without a frame


class SocketLink(DescriptorLink):
    """A link over a socket."""

    _socket: socket.socket

    def _release(self) -> None:
        self._socket.close()

    def _lost(self, why: str) -> LinkLost:
        by_words = {os.strerror(number): text for number, text in _REMEDY.items()}
        remedy = by_words.get(why, "check the bridge's power and the network")
        return LinkLost(f"{self.port} went away ({why.lower()}): {remedy}")

    def _end_of_data(self) -> None:
        raise LinkLost(
            f"{self.port}: the other end closed the connection; it may serve another program, or have lost its board"
        )


class TcpLink(SocketLink):
    """A connection to `tcp://host:port`, which carries the board's bytes unchanged.

    Raises:
        ConfigError: the URL does not parse.
        PortMissing: connection refused, host name not resolved, unreachable, or no answer within `patience_s`.
        LinkError: the operating system refused the connection.
    """

    def __init__(self, port: str, patience_s: float) -> None:
        self._socket = connect(parse(port), port, patience_s)
        self._heard = self._last = b""
        self._begin(port, self._socket.fileno())

    def read(self, timeout_s: float) -> bytes:
        data = super().read(timeout_s)
        if data:
            self._last, self._heard = data, (self._heard + data)[:HEARD]
        return data

    def _lost(self, why: str) -> LinkLost:
        with contextlib.suppress(OSError):  # a write may fail before the bridge's last words were read
            self._last = self._socket.recv(READ_SIZE) or self._last
        return self._told() or super()._lost(why)

    def _told(self) -> Optional[LinkLost]:
        """Return the error that `mrl serve` announced before it closed the connection."""
        _, told, why = self._last.rpartition(REASON)
        words = why.decode(errors="replace").strip()
        return LinkLost(f"{self.port}: the other end closed the connection: {words}") if told else None

    def _end_of_data(self) -> None:
        told = self._told()
        if told:
            raise told
        if self._heard and b"@" not in self._heard:
            raise LinkLost(
                f"{self.port}: the other end sent {self._heard!r} and closed the connection, expected frames of a "
                "board: another service listens there; check the address and the port number"
            )
        super()._end_of_data()


class UdpLink(SocketLink):
    """Datagrams to and from `udp://host:port`; datagrams from other senders are not received.

    Each `write` sends one datagram with whole frames.  Only the session can notice a lost datagram; the system reports
    only a host on which nothing listens.

    Raises:
        ConfigError: the URL does not parse.
        PortMissing: host name not resolved, or unreachable.
        LinkError: the operating system refused the socket.
    """

    def __init__(self, port: str) -> None:
        address = parse(port)
        self._socket = _first(address, port, socket.SOCK_DGRAM, 0.0)  # it has nobody to wait for
        self._begin(port, self._socket.fileno())

    def _end_of_data(self) -> None:
        """Ignore an empty datagram: it does not end the link."""


def connect(address: Address, port: str, patience_s: float) -> socket.socket:
    """Return a connection that never blocks; `port` is the name for errors.

    Raises:
        PortMissing, LinkError: as `TcpLink`.
    """
    end = _first(address, port, socket.SOCK_STREAM, patience_s)
    try:
        if end.getsockname() == end.getpeername():
            end.close()
            raise PortMissing(f"{port} cannot be opened (it leads back here): {_REMEDY[errno.ECONNREFUSED]}")
        end.setblocking(False)
        prompt(end)
    except OSError as error:  # the other end has left again
        end.close()
        raise explain(port, error) from None
    return end


def _first(address: Address, port: str, kind: int, patience_s: float) -> socket.socket:
    """Return a socket connected to the first of the host's addresses that accepts."""
    for family, _, _, _, there in resolve(address, port, kind):
        with contextlib.ExitStack() as undo:
            try:
                end = undo.enter_context(socket.socket(family, kind))
                if address.bind is not None:
                    end.bind(address.bind)
                end.settimeout(patience_s)
                end.connect(there)
                undo.pop_all()
                return end
            except OSError as error:
                failure = error
    raise explain(port, failure)


def resolve(address: Address, port: str, kind: int) -> List[Tuple[Any, Any, int, str, Any]]:
    """Return the addresses of a host, as `socket.getaddrinfo` does; `port` is the name for errors.

    Raises:
        PortMissing: the host name is unknown.
    """
    try:
        return socket.getaddrinfo(address.host, address.port, type=kind)
    except (OSError, UnicodeError) as error:
        words = str(error.args[-1]).lower()
        raise PortMissing(
            f"{port} cannot be opened ({address.host!r}: {words}): check the name, or give the address in numbers"
        ) from None


def explain(port: str, error: OSError) -> LinkError:
    """Return the error for a port that could not be opened."""
    if shortage(error):
        return LinkError(f"{port} cannot be opened: {shortage(error)}")
    number = errno.ETIMEDOUT if isinstance(error, socket.timeout) else error.errno or 0
    kinds: Dict[int, Type[LinkError]] = {errno.EACCES: PortDenied, errno.EPERM: PortDenied}
    kind = kinds.get(number, PortMissing if number in _REMEDY else LinkError)
    words = (os.strerror(number) if number else str(error)).lower()
    remedy = _REMEDY.get(number, "check the address and the network")
    return kind(f"{port} cannot be opened ({words}): {remedy}")


class UdpSender:
    """Sends datagrams to HOST:PORT.  Nothing here waits, and a program that does not listen there makes no error.

    If a name has several addresses, the first of IPv4 is used: PlotJuggler listens on no other.

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
        family, _, _, _, self._there = min(found, key=lambda each: each[0])  # AF_INET is the least
        try:
            self._socket = socket.socket(family, socket.SOCK_DGRAM)
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
        if address.scheme not in UDP or address.bind is not None:
            raise ConfigError("another protocol, or a local address")
    except ConfigError:
        raise ConfigError(
            f"--udp is {to!r}, expected HOST:PORT, such as 127.0.0.1:9870 or [::1]:9870"
        ) from None
    return address
