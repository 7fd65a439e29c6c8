"""The emulator's port on a network: serves the board by TCP or UDP on a given address."""

from typing import Optional, Union

from mrl_driver.protocol.table import BAUD
from mrl_driver.transport.listener import Listener, listen

from .pty import EVERYTHING, READ_BYTES, PtyPort

MOST_WAITING = 1 << 20  # more than the system keeps of what a host has sent [byte]


class SocketPort:
    """Listens on a URL; has the same interface as `PtyPort`.  ConfigError or LinkError if that is not possible.

    Bytes from the board are lost while there is no client, or its buffer is full.  While unplugged, the port does not
    listen.
    """

    def __init__(self, url: str) -> None:
        self._listener: Optional[Listener] = listen(url)
        self.path = str(self._listener.address)  # the URL that a driver opens
        self.dropped = 0  # number of lost bytes from the board

    @property
    def master(self) -> Optional[int]:
        return self._listener.data if self._listener else None

    @property
    def watch(self) -> Optional[int]:
        """Descriptor that is readable when a client connects; None while unplugged."""
        return self._listener.watch if self._listener else None

    baud = BAUD

    @property
    def plugged(self) -> bool:
        return self._listener is not None

    def plug(self) -> None:
        """Listens again, on the same address."""
        if self._listener is None:
            self._listener = listen(self.path)

    def unplug(self) -> None:
        if self._listener is not None:
            self._listener.close()
        self._listener = None

    @property
    def is_open(self) -> bool:
        return self._listener is not None and bool(self._listener.client)

    def newly_opened(self) -> bool:
        """Accepts clients; True if one connected since the last call."""
        return self._listener is not None and self._listener.attend()

    def read(self, limit: int = READ_BYTES) -> bytes:
        """Bytes from the client: at most `limit`, or one datagram."""
        return self._listener.read(limit) if self._listener else b""

    def write(self, data: bytes) -> None:
        self.dropped += len(data) - (self._listener.write(data) if self._listener and data else 0)

    close = unplug


BoardPort = Union[PtyPort, SocketPort]


def read_all(port: BoardPort) -> bytes:
    """All waiting bytes from the host, but not much more than `MOST_WAITING`: a host may send faster than we read."""
    waiting = bytearray()
    while len(waiting) < MOST_WAITING:
        data = port.read(EVERYTHING)
        if not data:
            break
        waiting += data
    return bytes(waiting)
