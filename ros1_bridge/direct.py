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
                connection.write_data = _dropping(connection.socket, connection.write_data)

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

    That is checks and locks which one thread with one prepared message does not need; rospy itself is asked
    only after a connection has failed, and takes that one away.
    """

    def __init__(self, publisher: Any, lost: Type[Exception], with_header: bool = True) -> None:
        """`lost` is what a connection that broke raises; `with_header` messages are numbered."""
        self._publisher, self._impl = publisher, publisher.impl
        self._lost, self._with_header = (lost, OSError), with_header
        self._buffer, self._broken = io.BytesIO(), False

    def publish(self, message: Any) -> None:
        """Send `message` to everybody who subscribes."""
        connections = self._impl.connections
        if not connections:
            return
        if self._broken:
            self._broken = False
            self._publisher.publish(message)
            return
        if self._with_header:
            message.header.seq += 1
        data = self._packed(message)
        for connection in connections:
            try:
                connection.write_data(data)
            except self._lost:
                self._broken = True

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


def _dropping(connection: socket.socket, write: Callable[[bytes], Any]) -> Callable[[bytes], Any]:
    """`write` unless too much is unread."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _TIMEVAL)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)

    most = BACKLOG_BYTES  # unread at most, as far as is known: asking the kernel costs as much as packing a message

    def write_or_drop(data: bytes) -> Any:
        nonlocal most
        most += len(data)
        if most > BACKLOG_BYTES:
            most = _unread(connection) + len(data)
            if most - len(data) > BACKLOG_BYTES:
                return True
        return write(data)

    return write_or_drop


def _unread(connection: socket.socket) -> int:
    """Bytes in the socket that the peer has not acknowledged; 0 for a closed one, as writing tells more."""
    try:
        return struct.unpack("i", fcntl.ioctl(connection, termios.TIOCOUTQ, bytes(4)))[0]
    except (OSError, ValueError):
        return 0
