"""Whether a message of another node is fresh, by its stamp.  Pure: times are arguments.

The time of arrival says nothing: a message may have waited in a connection, or its source may repeat an old one.
"""

import math

AHEAD_S = 0.1
"""A stamp may be ahead of this node's clock by this much: synchronised clocks agree within some 10 ms [s]."""


class StampAge:
    """Judges the messages of one source."""

    def __init__(self, limit_s: float) -> None:
        """`limit_s`: an older message is not fresh [s]."""
        self._limit_s = limit_s
        self._stamp_s, self._since_s = math.nan, -math.inf
        self.made_s = -math.inf  # when the last fresh message was made, on the clock of its arrival [s]

    def trouble(self, stamp_s: float, now_s: float, arrived_s: float) -> str:
        """Why a message is not fresh; empty if it is.

        Args:
            stamp_s: of the message [s].
            now_s: this node's clock of stamps, which may be simulated and stand still [s].
            arrived_s: when the message arrived, on a clock that never jumps [s].
        """
        age_s = now_s - stamp_s
        # A stamp that repeats ages from its first arrival, although `now_s` may stand still.
        if stamp_s != self._stamp_s:
            self._stamp_s, self._since_s = stamp_s, arrived_s - max(0.0, age_s)
        old_s = arrived_s - self._since_s
        if stamp_s and age_s >= -AHEAD_S and old_s <= self._limit_s:
            self.made_s = self._since_s
            return ""
        if not stamp_s:
            return "its stamp is 0, expected the time of its measurement"
        told = f"{-age_s:.3f} s ahead of" if age_s < -AHEAD_S else f"{old_s:.3f} s old by"
        cause = "look for what delays or repeats it, or whether a clock was set"
        if self.made_s == -math.inf:
            cause = "if another machine sends it, the clocks probably differ: synchronise them (NTP)"
        return (
            f"its stamp {stamp_s:.3f} is {told} this node's clock {now_s:.3f}, expected at most {self._limit_s:g} s "
            f"old and {AHEAD_S:g} s ahead; {cause}"
        )
