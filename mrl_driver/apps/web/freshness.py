"""The age of a page's messages, although its clock is not ours.  Pure, except for `clock_s`.

Each message of a page has its time `t`, and the time `heard` of the newest message that the page has from us, with the
page's time `heard_t` of its arrival.  A message does not arrive before it was sent, so our clock is ahead of the page's
by at least `heard - heard_t`, and a message that arrives `now` is at most `(now - t) - (heard - heard_t)` old, however
the clocks are set.  The pair with the largest difference gives the best bound: it is too large by the shortest way
from us to the page of the last `WINDOW_S`.
"""

import math
import time
from collections import deque
from typing import Deque, Optional, Tuple

from mrl_driver.driver.connection import CLOCK_BOOTTIME
from mrl_driver.safety.operator_delay import DRIFT

WINDOW_S, APART_S = 10.0, 0.01
"""Pairs older than this do not count; shortest time between two that are kept [s]."""
SAME_S = 1e-6
"""Times on the wire are rounded to this [s]."""
DEAF_S = 2.0
"""The age is unknown if the newest message that the page has is older than this [s]: its picture stands still."""
COARSE_S = 0.02
"""Browsers that hide the exact time round it to at most this [s].  A message that seems to arrive longer before it was
sent shows that the page's clock has jumped.
"""


def clock_s() -> float:
    """The server's clock [s]; unlike `time.monotonic()` it goes on while the computer is suspended."""
    return time.clock_gettime(CLOCK_BOOTTIME)


class Freshness:
    """The age of the messages of one page, over one connection."""

    def __init__(self) -> None:
        self._pairs: Deque[Tuple[float, float]] = deque()
        """When we sent the message of a pair, and how far our clock is ahead, to be reduced by `DRIFT` times our clock:
        the newest pair last, the largest first.
        """

    def age_s(self, t_s: float, heard_s: Optional[float], heard_t_s: Optional[float], now_s: float) -> float:
        """Return an upper bound of the age of a message [s]; infinity if it is not known.

        Args:
            t_s: when it was sent [s, the page's clock].
            heard_s: when we sent the newest message that the page had then [s, our clock]; None: it had none.
            heard_t_s: when that arrived there [s, the page's clock].
            now_s: when the message is processed [s, our clock].
        """
        if heard_s is None or heard_t_s is None or not heard_s <= now_s + SAME_S or not heard_t_s <= t_s:
            return math.inf
        pairs = self._pairs
        self._add(heard_s, heard_s - heard_t_s + DRIFT * heard_s)
        while pairs and now_s - pairs[0][0] > WINDOW_S:
            pairs.popleft()
        if not pairs or now_s - heard_s > DEAF_S:
            return math.inf
        age_s = now_s - t_s - (pairs[0][1] - DRIFT * now_s)
        if age_s < -COARSE_S:
            pairs.clear()
            return math.inf
        return max(0.0, age_s)

    def _add(self, heard_s: float, ahead_s: float) -> None:
        """Keep a pair unless one that is newer, or hardly older, is better."""
        pairs = self._pairs
        if pairs and heard_s < pairs[-1][0]:
            return
        while pairs and pairs[-1][1] <= ahead_s:
            pairs.pop()
        if not pairs or heard_s - pairs[-1][0] >= APART_S:
            pairs.append((heard_s, ahead_s))
