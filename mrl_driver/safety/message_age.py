"""The age of messages from a computer whose clock is not ours.  Pure.

The other computer says when it got which of our messages.  A message does not arrive before it was sent, so our clock
is ahead of the other one by at least `sent_s - there_s`, and a message of its time `t` that arrives `now` is at most
`(now - t) - (sent_s - there_s)` old, however the clocks are set.  The pair with the largest difference gives the best
bound: it is too large by the shortest way from us to the other computer.
"""

import math
from collections import deque
from typing import Deque, Tuple

APART_S = 0.01
"""Shortest time between two pairs that are kept [s]."""


class MessageAge:
    """Upper bound of the age of messages from one computer.

    Args:
        window_s: older pairs do not count [s].
        ahead_s: a message that seems to arrive longer before it was sent shows that a clock was set [s].
        drift: largest drift between the two clocks [s/s]; 0 if `window_s` times the drift is small.
    """

    def __init__(self, window_s: float, ahead_s: float, drift: float = 0.0) -> None:
        self._window_s, self._ahead_s, self._drift = window_s, ahead_s, drift
        self._pairs: Deque[Tuple[float, float]] = deque()
        """When we sent the message of a pair, and how far our clock is ahead, to be reduced by `drift` times our clock:
        the newest pair last, the largest first.
        """

    def heard(self, sent_s: float, there_s: float) -> None:
        """Take note that our message of `sent_s` was there at `there_s` [s, the other clock]."""
        pairs, ahead_s = self._pairs, sent_s - there_s + self._drift * sent_s
        if pairs and sent_s < pairs[-1][0]:
            return
        while pairs and pairs[-1][1] <= ahead_s:
            pairs.pop()
        if not pairs or sent_s - pairs[-1][0] >= APART_S:
            pairs.append((sent_s, ahead_s))
        self._forget_before(sent_s - self._window_s)

    def age_s(self, stamp_s: float, now_s: float) -> float:
        """Return an upper bound of the age of a message of `stamp_s` [s, the other clock] at `now_s`.

        It is infinite without a pair in the window, and until the next pair after a clock was set.
        """
        self._forget_before(now_s - self._window_s)
        if not self._pairs:
            return math.inf
        age_s = now_s - stamp_s - (self._pairs[0][1] - self._drift * now_s)
        if age_s < -self._ahead_s:
            self._pairs.clear()
            return math.inf
        return max(0.0, age_s)

    def _forget_before(self, oldest_s: float) -> None:
        while self._pairs and self._pairs[0][0] < oldest_s:
            self._pairs.popleft()
