"""The listening end of a network connection to a board: one client at a time.

Nothing here blocks.  The first to connect is the client, until it has left (TCP) or was silent for `SILENT_S` when
another one comes.  Other connections get a line that names it and are closed; other senders' datagrams are dropped.
"""

import contextlib
import errno
import math
import socket
import time
from typing import Any, List, Optional, Tuple, Union

from mrl_driver.errors import ConfigError, LinkError, MrlError, PortBusy, PortDenied, shortage

from .address import TCP, Address, parse

SILENT_S = 3.0
"""A client that sends nothing for this time has no right to its place [s]; a driver sends something every 0.5 s, to a
board of 2013 every 2 s."""
GONE_S = 2
READ_SIZE = 4096
LONGEST = 1400  # longest datagram [byte]; Ethernet would split a longer one
REASON = b"\r\nmrl serve: "
"""Begin of the line with which a bridge tells its client why it closes the connection."""
MOST_DATAGRAMS = 32
"""At most this many datagrams are looked at in one read: a flood by others does not hold up the caller."""
MOST_WAITING = 10_000  # more datagrams than the system keeps


class TcpListener:
    """Accepts TCP connections.  One that does not begin with a frame or a line end is closed: it may be a browser's
    `GET`, `POST` or TLS, by which a page of any site could send frames to this computer.

    Raises:
        ConfigError: the address does not belong to this computer.
        PortBusy, PortDenied, LinkError: listening on the address is not possible.
    """

    def __init__(self, address: Address) -> None:
        self._listening = bound(address, socket.SOCK_STREAM)
        self._end: Optional[socket.socket] = None
        self._accepts, self._silent, self._heard_s = True, True, -math.inf
        self.address = address._replace(port=self._listening.getsockname()[1])
        """Address of the listener; if port 0 was requested, with the port that the system chose."""
        self.client = ""  # address of the connected client; empty without one

    @property
    def watch(self) -> Optional[int]:
        """Descriptor that becomes readable when a client connects; None if `data` does, as with datagrams, and after a
        connection could not be accepted, as without descriptors.
        """
        return self._listening.fileno() if self._accepts else None

    @property
    def data(self) -> Optional[int]:
        """Descriptor that becomes readable when data arrive; None without a client."""
        return self._end.fileno() if self._end is not None else None

    def attend(self) -> bool:
        """Accept waiting connections; return True if there is a new client."""
        came = False
        while True:
            try:
                end, name = self._listening.accept()
            except OSError as error:
                self._accepts = isinstance(error, (BlockingIOError, ConnectionError))
                return came
            end.setblocking(False)
            if self._end is not None:
                self._make_room(self._end)
            if self._end is not None:
                with contextlib.suppress(OSError):
                    end.send(REASON + f"{self.client} is served; end that program first\r\n".encode())
                end.close()
                continue
            prompt(end)
            self._end, self.client, came, self._silent = end, spell(name), True, True
            self._heard_s = time.monotonic()

    def _make_room(self, client: socket.socket) -> None:
        """Drop the client if it has closed its connection already, or is silent."""
        try:
            there = bool(client.recv(1, socket.MSG_PEEK))
        except OSError as error:
            heard = time.monotonic() - self._heard_s < SILENT_S
            there = isinstance(error, BlockingIOError) and heard
        if not there:
            self.drop()

    def read(self, limit: int = READ_SIZE) -> bytes:
        """Return the client's bytes; drop the client if it has left."""
        if self._end is None:
            return b""
        try:
            data = self._end.recv(limit)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data or (self._silent and data[:1] not in b"@\r\n"):
            self.drop()
            return b""
        self._silent, self._heard_s = False, time.monotonic()
        return data

    def write(self, data: bytes) -> int:
        """Send as many bytes as there is room for; return their number."""
        if self._end is None:
            return 0
        try:
            return self._end.send(data)
        except OSError as error:
            if not isinstance(error, BlockingIOError):
                self.drop()
            return 0

    def drop(self) -> None:
        """Close the connection of the client; what it has sent is lost."""
        if self._end is not None:
            self._end.close()
        self._end, self.client = None, ""

    def close(self) -> None:
        """Listen no more."""
        self.drop()
        self._listening.close()


class UdpListener:
    """As `TcpListener`, for datagrams.  Each datagram that it sends holds whole frames."""

    watch: Optional[int] = None
    _there: Any  # address of the client's socket; None without one
    _heard_s: float  # time of the client's last datagram

    def __init__(self, address: Address) -> None:
        self._socket = bound(address, socket.SOCK_DGRAM)
        self.address = address._replace(port=self._socket.getsockname()[1])
        self._came = False
        self.drop()

    @property
    def data(self) -> Optional[int]:
        """Descriptor that becomes readable when data arrive."""
        return self._socket.fileno()

    def attend(self) -> bool:
        """Return True once after a new client's first datagram; drop a silent client."""
        if self.client and time.monotonic() - self._heard_s >= SILENT_S:
            self.drop()
        came, self._came = self._came, False
        return came

    def read(self, limit: int = READ_SIZE) -> bytes:
        """Return the client's next datagram, always whole, if it is among the next `MOST_DATAGRAMS`.

        `limit` applies only to TCP.
        """
        for _ in range(MOST_DATAGRAMS):
            try:
                data, there = self._socket.recvfrom(65536)
            except OSError:
                return b""
            now = time.monotonic()
            if self._there is not None and there != self._there and now - self._heard_s < SILENT_S:
                continue
            if there != self._there:
                self._there, self.client, self._came, self._unsent = there, spell(there), True, b""
            self._heard_s = now
            if data:
                return data
        return b""

    def write(self, data: bytes) -> int:
        """Send all whole frames; keep the rest, at most `LONGEST` bytes, until more bytes follow."""
        if self._there is None:
            return 0
        self._unsent += data
        end = max(self._unsent.rfind(b"e"), self._unsent.rfind(b"\n")) + 1
        whole, self._unsent = self._unsent[:end], self._unsent[end:][-LONGEST:]
        for datagram in datagrams(whole):
            with contextlib.suppress(OSError):
                self._socket.sendto(datagram, self._there)
        return len(data)

    def drop(self) -> None:
        """Forget the client, and the datagrams that wait."""
        self._there, self.client, self._unsent = None, "", b""
        with contextlib.suppress(OSError):
            for _ in range(MOST_WAITING):
                self._socket.recv(1)

    def close(self) -> None:
        """Listen no more."""
        self.drop()
        self._socket.close()


Listener = Union[TcpListener, UdpListener]


def listen(url: str) -> Listener:
    """Listen on `tcp://ADDRESS:PORT` or `udp://ADDRESS:PORT`.

    Raises:
        ConfigError: the URL does not parse, or the address does not belong to this computer.
        PortBusy, PortDenied, LinkError: listening on the address is not possible.
    """
    address = parse(url, listening=True)
    return TcpListener(address) if address.scheme in TCP else UdpListener(address)


def prompt(end: socket.socket) -> None:
    """Make a connection send at once, and notice within about `GONE_S` that the other end is gone [s]."""
    end.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 1)
    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, GONE_S)
    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, GONE_S * 1000)


def datagrams(data: bytes) -> List[bytes]:
    """Split `data` into pieces of at most `LONGEST` bytes, after the end of a frame if possible."""
    pieces = []
    while len(data) > LONGEST:
        end = data[:LONGEST].rfind(b"e") + 1 or LONGEST
        pieces.append(data[:end])
        data = data[end:]
    return [*pieces, data] if data else pieces


def bound(address: Address, kind: int, waiting: int = 1) -> socket.socket:
    """Return a socket of this kind on an address of this computer; it never blocks.

    A stream socket listens already; this many connections may wait to be accepted.

    Raises:
        ConfigError: the address does not belong to this computer.
        PortBusy, PortDenied, LinkError: the address cannot be used.
    """
    try:
        family, _, _, _, there = socket.getaddrinfo(address.host, address.port, type=kind)[0]
        end = socket.socket(family, kind)
    except (OSError, UnicodeError) as error:
        if shortage(error):
            raise _refused(address, error) from None
        raise ConfigError(f"{address}: {error}; expected an address of this computer") from None
    try:
        if kind == socket.SOCK_STREAM:
            end.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        end.bind(there)
        if kind == socket.SOCK_STREAM:
            end.listen(waiting)
        end.setblocking(False)
        return end
    except OSError as error:
        end.close()
        raise _refused(address, error) from None


def _refused(address: Address, error: Exception) -> MrlError:
    if shortage(error):
        return LinkError(f"{address} cannot be listened on: {shortage(error)}")
    assert isinstance(error, OSError)
    if error.errno == errno.EADDRINUSE:
        return PortBusy(f"{address} is in use by another program; end that, or choose another port")
    if error.errno in (errno.EACCES, errno.EPERM):
        return PortDenied(f"no permission to listen on {address}; choose a port above 1023")
    if error.errno == errno.EADDRNOTAVAIL:
        return ConfigError(
            f"{address} is not an address of this computer; expected one, or 127.0.0.1 for itself alone"
        )
    return LinkError(f"{address} cannot be listened on ({error.strerror}); choose another address")


def spell(there: Tuple[Any, ...]) -> str:
    """Return the address of a socket as text."""
    host = f"[{there[0]}]" if ":" in there[0] else there[0]
    return f"{host}:{there[1]}"
