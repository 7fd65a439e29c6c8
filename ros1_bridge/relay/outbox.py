"""Messages that wait for a slow link: the newest of each publisher.  Pure."""

from collections import deque
from typing import Deque, Dict, Optional, Tuple

from .relay_frames import Message

WINDOW_BYTES = 16384
"""At most this many bytes are in transit: what waits in a network cannot be replaced by something newer."""
WINDOW_MESSAGES = 4
"""At most this many messages of one publisher are in transit."""


class Outbox:
    """What leaves next on one connection.

    A message replaces the one of the same publisher that still waits.  It leaves when the messages before it have
    arrived, or nearly so: `WINDOW_BYTES` in all and `WINDOW_MESSAGES` of its publisher may be in transit.
    """

    def __init__(self) -> None:
        self._waiting: Dict[int, Message] = {}
        self._in_transit: Deque[Tuple[int, int]] = deque()
        self._bytes = self._arrived = 0
        self._messages: Dict[int, int] = {}

    def put(self, message: Message) -> None:
        """Let a message wait; it takes the place of the one that it replaces."""
        self._waiting[message.number] = message

    def next(self) -> Optional[Message]:
        """The message to send now; None if none waits or too much is in transit."""
        for number, message in self._waiting.items():
            if self._may_leave(message):
                del self._waiting[number]
                size = len(message.body)
                self._in_transit.append((number, size))
                self._bytes += size
                self._messages[number] = self._messages.get(number, 0) + 1
                return message
        return None

    def taken(self, count: int) -> None:
        """The receiver says that `count` messages have arrived since the beginning."""
        while self._arrived < count and self._in_transit:
            self._arrived += 1
            number, size = self._in_transit.popleft()
            self._bytes -= size
            self._messages[number] -= 1

    def _may_leave(self, message: Message) -> bool:
        if not self._in_transit:
            return True
        enough = self._bytes + len(message.body) > WINDOW_BYTES
        return not enough and self._messages.get(message.number, 0) < WINDOW_MESSAGES
