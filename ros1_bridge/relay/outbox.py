"""Messages that wait for a slow link: the newest of each publisher.  Pure: times are arguments."""

import math
from collections import deque
from typing import Deque, Dict, Optional, Tuple

from .relay_frames import Message

MOST_BYTES = 16384
"""At most this many bytes are in transit: what waits in a network cannot be replaced by something newer."""
MOST_OF_ONE = 4  # at most this many messages of one publisher are in transit
MOST_MESSAGES = 64  # at most this many messages are in transit, and one if the link is slow
SLOWER_S = 0.05
"""A link is slow if an answer takes longer than the fastest one by this time: then messages wait in the network."""
_FORGETS = 1.001
"""The fastest time grows by this factor with each answer, so that a lasting change of the network is accepted."""


class Outbox:
    """What leaves next on one connection.

    A message replaces the one of the same publisher that still waits.  It leaves when enough of the messages before it
    have arrived.  How many may be in transit depends on how fast the answers come.
    """

    def __init__(self) -> None:
        self._waiting: Dict[int, Message] = {}
        self._in_transit: Deque[Tuple[int, int, float]] = deque()
        self._bytes = self._arrived = 0
        self._messages: Dict[int, int] = {}
        self._fastest_s, self._most = math.inf, float(MOST_OF_ONE)

    def put(self, message: Message) -> None:
        """Let a message wait; it takes the place of the one that it replaces."""
        self._waiting[message.number] = message

    def next(self, now_s: float) -> Optional[Message]:
        """The message to send now; None if none waits or too much is in transit."""
        for number, message in self._waiting.items():
            if self._may_leave(message):
                del self._waiting[number]
                size = len(message.body)
                self._in_transit.append((number, size, now_s))
                self._bytes += size
                self._messages[number] = self._messages.get(number, 0) + 1
                return message
        return None

    def taken(self, count: int, now_s: float) -> None:
        """The receiver says that `count` messages have arrived since the beginning."""
        while self._arrived < count and self._in_transit:
            self._arrived += 1
            number, size, left_s = self._in_transit.popleft()
            self._bytes -= size
            self._messages[number] -= 1
            self._adapt(now_s - left_s)

    def _may_leave(self, message: Message) -> bool:
        if not self._in_transit:
            return True
        if len(self._in_transit) >= int(self._most) or self._bytes + len(message.body) > MOST_BYTES:
            return False
        return self._messages.get(message.number, 0) < MOST_OF_ONE

    def _adapt(self, took_s: float) -> None:
        """One more in transit after a round of fast answers, half after a slow one."""
        self._fastest_s = min(took_s, self._fastest_s * _FORGETS)
        if took_s > self._fastest_s + SLOWER_S:
            self._most = max(1.0, self._most / 2)
        else:
            self._most = min(float(MOST_MESSAGES), self._most + 1 / self._most)
