"""Sequence numbers and times of the board's frames: which are new, which were lost, and when each was made."""

import math
from typing import Optional

from mrl_driver.protocol.table import INT16_MAX, INT16_MIN

from .board_clock import BoardClock
from .link_counters import Counters

STAMP_STEP_S = 1e-6  # frames without board time that arrive together get stamps that differ by this [s]
# A frame with a number up to 1024 before the last one was overtaken by a later frame (datagrams may be).  A number
# further back is a gap, because the numbers wrap.
_OVERTAKEN = 0x10000 - 1024


class Stream:
    """Sequence numbers and times of the frames since the board's start.

    Attributes:
        clock: converts board time to host time.
        expected: the number that follows the last one (int16); None before the first.
    """

    def __init__(self, counters: Counters) -> None:
        self._counters = counters
        self._stamp_s = -math.inf
        self.begin_anew()

    def begin_anew(self) -> None:
        """The board has restarted: forget the earlier numbers and times."""
        self.clock = BoardClock()
        self.expected: Optional[int] = None

    def unnumbered(self, now: float) -> float:
        """Return the time of a frame without board time: its arrival `now`, but after the one before [s]."""
        self._stamp_s = max(now, self._stamp_s + STAMP_STEP_S)
        return self._stamp_s

    def missing(self, sequence: int, silent: bool) -> int:
        """Return the number of frames lost before this one; -1 if it, or a later one, arrived before.

        `silent` says that a silence came before: then the numbers may have wrapped, and no frame counts as overtaken.
        """
        missing = 0 if self.expected is None else (sequence - self.expected) & 0xFFFF
        if missing == 0xFFFF:
            self._counters.duplicates += 1
            return -1
        if missing >= _OVERTAKEN and not silent:
            self._counters.overtaken += 1
            return -1
        self.expected = sequence + 1 if sequence < INT16_MAX else INT16_MIN
        self._counters.lost += missing
        return missing
