"""Publishing without a queue, from which no subscriber can stall the publisher.

rospy's queued publishers wake one more thread for each message and subscriber, which doubles the cost of a
topic; its unqueued ones wait for ever for a subscriber that has stopped reading.  Here a message goes
straight to the sockets, and one that does not read misses messages until it does.
"""

import fcntl
import io
import socket
import struct
import termios
import warnings
from typing import Any, Callable, Type

BACKLOG_BYTES = 32768
"""More than this unread, beside what the subscriber's own socket holds: it misses messages."""
BUFFER_BYTES = 131072
"""Room in a socket (the kernel grants twice that); far above the backlog, so that sending never waits."""
STALL_S = 0.02
"""Should sending wait nevertheless, then no longer than this; the subscriber is disconnected."""
_LENGTH = struct.Struct("<I")
_TIMEVAL = struct.pack("ll", 0, round(STALL_S * 1e6))


class _Guard:
    """A subscribe listener that makes the connections of a publisher drop messages rather than wait."""

    def __init__(self, publisher: Any) -> None:
        self._publisher = publisher

    def peer_subscribe(self, _topic: str, _publish: Callable, _publish_peer: Callable) -> None:
        """A subscriber has connected."""
        for connection in self._publisher.impl.connections:
            if connection.socket is not None and "write_data" not in vars(connection):
                _make_dropping(connection)

    def peer_unsubscribe(self, _topic: str, _peers: int) -> None:
        """A subscriber has gone."""


def direct_publisher(
    publisher_class: Callable[..., Any], topic: str, message_class: type, **options: Any
) -> Any:
    """A publisher made by `publisher_class` (rospy.Publisher) without a queue.

    `options` go to it, as latch does.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)  # rospy warns of a missing queue
        publisher = publisher_class(topic, message_class, queue_size=None, tcp_nodelay=True, **options)
    publisher.impl.add_subscriber_listener(_Guard(publisher))
    return publisher


class Fast:
    """Publishes through an unlatched publisher of `direct_publisher`, past what rospy does for each message.

    That is checks and locks which one thread does not need.
    """

    def __init__(self, publisher: Any, lost: Type[Exception]) -> None:
        """`lost` is what a connection that broke raises."""
        self.impl, self._lost = publisher.impl, (lost, OSError)
        """rospy's part of the publisher; it has `connections` where somebody subscribes."""
        self._buffer = io.BytesIO()
        self.sequence = 1
        """Number of the message that is sent next."""

    def publish(self, message: Any) -> None:
        """Send `message`, which has a header, to everybody who subscribes."""
        if self.impl.connections:
            message.header.seq = self.sequence
            self.send(self._packed(message))

    def send(self, data: bytes) -> None:
        """Send a message as it goes over the wire."""
        self.sequence = (self.sequence + 1) & 0xFFFFFFFF
        for connection in self.impl.connections:
            try:
                connection.write_data(data)
            except self._lost:
                connection.close()  # and a new list without it replaces the one that is walked here

    def _packed(self, message: Any) -> bytes:
        """The message as it goes over the wire: its length, then itself."""
        buffer = self._buffer
        buffer.seek(4)
        message.serialize(buffer)
        end = buffer.tell()
        buffer.seek(0)
        buffer.write(_LENGTH.pack(end - 4))
        buffer.truncate(end)
        return buffer.getvalue()


def _make_dropping(connection: Any) -> None:
    """Let a connection of rospy's drop messages while too much is unread."""
    near = connection.socket
    near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _TIMEVAL)
    near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
    send = near.sendall

    most = BACKLOG_BYTES  # unread at most, as far as is known: asking the kernel costs as much as packing a message

    def write_or_drop(data: bytes) -> bool:
        nonlocal most
        size = len(data)
        most += size
        if most > BACKLOG_BYTES:
            unread = _unread(near)
            most = unread + size
            if unread > BACKLOG_BYTES:
                return True
        send(data)
        connection.stat_bytes += size
        connection.stat_num_msg += 1
        return True

    connection.write_data = write_or_drop


def _unread(connection: socket.socket) -> int:
    """Bytes in the socket that the peer has not acknowledged; 0 for a closed one, as writing tells more."""
    try:
        return struct.unpack("i", fcntl.ioctl(connection, termios.TIOCOUTQ, bytes(4)))[0]
    except (OSError, ValueError):
        return 0
