"""The emulator's port on a network: a serial bridge with a board behind it, by TCP or UDP, on an address asked for."""

from typing import Optional

from mrl_driver.transport.listener import Listener, listen

from .pty import READ_BYTES, USUAL_BAUD

_EVERYTHING = 65536


class SocketPort:
    """Listens on an URL; the same interface as `PtyPort`.

    What the board sends while no client is there, or has no room, is lost.  While unplugged nothing listens.

    Attributes:
        path: The URL that a driver opens.
        dropped: Bytes from the board that nobody took.

    Raises:
        ConfigError, LinkError: it cannot be listened on.
    """

    def __init__(self, url: str) -> None:
        self._listener: Optional[Listener] = listen(url)
        self.path = str(self._listener.address)
        self.dropped = 0

    @property
    def master(self) -> Optional[int]:
        """Descriptor that tells of data; None without a client."""
        return self._listener.data if self._listener else None

    @property
    def watch(self) -> Optional[int]:
        """Descriptor that tells of clients; None where there is none."""
        return self._listener.watch if self._listener else None

    baud = USUAL_BAUD

    @property
    def plugged(self) -> bool:
        """It listens."""
        return self._listener is not None

    def plug(self) -> None:
        """Listens again, on the same address."""
        if self._listener is None:
            self._listener = listen(self.path)

    def unplug(self) -> None:
        """Lets go of the client, and listens no more."""
        if self._listener is not None:
            self._listener.close()
        self._listener = None

    @property
    def is_open(self) -> bool:
        """Whether there is a client."""
        return self._listener is not None and bool(self._listener.client)

    def opened_anew(self) -> bool:
        """Lets clients in; True if one came."""
        return self._listener is not None and self._listener.attend()

    def read(self, limit: int = READ_BYTES) -> bytes:
        """What the client has sent: at most `limit` bytes, or one datagram."""
        return self._listener.read(limit) if self._listener else b""

    def read_all(self) -> bytes:
        """Everything that waits."""
        data = b""
        while True:
            piece = self.read(_EVERYTHING)
            if not piece:
                return data
            data += piece

    def unread(self) -> int:
        """Bytes that wait for a program at this end: none, the network has them."""
        return 0

    def write(self, data: bytes) -> None:
        """Sends to the client what it has room for; the rest is lost."""
        self.dropped += len(data) - (self._listener.write(data) if self._listener and data else 0)

    def close(self) -> None:
        """Listens no more."""
        self.unplug()
