"""The age of messages from a machine with another clock.  Pure: times are arguments."""

import math
from collections import deque
from typing import Deque, Tuple

WINDOW_S = 60.0
"""Heartbeats older than this are forgotten: clocks drift, by less than 0.01 % of it."""
AHEAD_S = 0.1
"""A message that seems to be from so far in the future shows that a clock was set [s]."""


class MessageAge:
    """Upper bound of the age of a message, from heartbeats; the clocks need not agree.

    The sender answered a heartbeat after it had left here.  So its clock was not behind by more than the difference of
    these two times; the largest difference is the best bound.  The age is never too small; it is too large by the time
    that the fastest heartbeat took to the sender.
    """

    def __init__(self) -> None:
        self._differences: Deque[Tuple[float, float]] = deque()

    def pong(self, sent_s: float, answered_s: float) -> None:
        """A heartbeat that left at `sent_s` (here) was answered at `answered_s` (the sender's clock)."""
        difference = sent_s - answered_s
        while self._differences and self._differences[-1][1] <= difference:
            self._differences.pop()
        self._differences.append((sent_s, difference))
        while self._differences[0][0] < sent_s - WINDOW_S:
            self._differences.popleft()

    def age_s(self, stamp_s: float, now_s: float) -> float:
        """Age of a message of `stamp_s` (the sender's clock) at `now_s` (here).

        Infinite before the first heartbeat, and before the next one if a clock was set.
        """
        if not self._differences:
            return math.inf
        age_s = now_s - (stamp_s + self._differences[0][1])
        if age_s >= -AHEAD_S:
            return age_s
        self._differences.clear()
        return math.inf
