"""The age of a page's messages, although its clock is not ours.  Pure.

Each message of a page has its time `t`, and the time `heard` of the newest message that the page has from us, with the
page's time `heard_t` of its arrival (see `safety.message_age`).
"""

import math
from typing import Optional

from mrl_driver.safety.message_age import MessageAge
from mrl_driver.safety.operator_delay import DRIFT

WINDOW_S = 10.0  # older pairs of `heard` and `heard_t` do not count [s]
SAME_S = 1e-6  # times on the wire are rounded to this [s]
DEAF_S = 2.0
"""The age is unknown if the newest message that the page has is older than this [s]: its picture stands still."""
COARSE_S = 0.02
"""Browsers that hide the exact time round it to at most this [s].  A message that seems to arrive longer before it was
sent shows that the page's clock has jumped."""


class Freshness:
    """The age of the messages of one page, over one connection."""

    def __init__(self) -> None:
        self._age = MessageAge(WINDOW_S, COARSE_S, DRIFT)

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
        self._age.heard(heard_s, heard_t_s)
        return self._age.age_s(t_s, now_s) if now_s - heard_s <= DEAF_S else math.inf
