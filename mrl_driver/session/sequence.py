"""Sequence numbers and times of the board's frames: which are new, which were lost, and when each was made."""

import math
from typing import Optional

from mrl_driver.protocol.codec import Stamp

from .board_clock import BoardClock, HostTime
from .link_counters import Counters

STAMP_STEP_S = 1e-6
"""Frames without board time that arrive together get stamps that differ by this [s]."""
_OVERTAKEN = 0x10000 - 1024
"""A frame with a number up to 1024 before the last one was overtaken by a later frame (datagrams may be).  A number
further back is a gap, because the numbers wrap.
"""


class Stream:
    """Sequence numbers and times of the frames since the board's start."""

    def __init__(self, counters: Counters) -> None:
        self._counters = counters
        self._clock = BoardClock()
        self._stamp_s = -math.inf
        self._sequence: Optional[int] = None

    def begin_anew(self) -> None:
        """The board has restarted: forget the earlier numbers and times."""
        self._clock, self._sequence = BoardClock(), None

    def unnumbered(self, now: float) -> HostTime:
        """Return the time of a frame without board time: its arrival `now`."""
        self._stamp_s = max(now, self._stamp_s + STAMP_STEP_S)
        return HostTime(self._stamp_s, now, 0.0)

    def numbered(self, stamp: Stamp, now: float, silent: bool) -> Optional[HostTime]:
        """Return the time of a frame that arrived at `now`; None if it, or a later one, arrived before."""
        missing = self.missing(stamp.sequence, silent)
        return None if missing < 0 else self._clock.update(stamp.time, now, not missing)

    def missing(self, sequence: int, silent: bool) -> int:
        """Return the number of frames lost before this one; -1 if it, or a later one, arrived before.

        `silent` says that a silence came before: then the numbers may have wrapped, and no frame counts as overtaken.
        """
        last, self._sequence = self._sequence, sequence
        if last is None:
            return 0
        missing = (sequence - last - 1) & 0xFFFF
        if missing == 0xFFFF or (missing >= _OVERTAKEN and not silent):
            self._sequence = last
            if missing == 0xFFFF:
                self._counters.duplicates += 1
            else:
                self._counters.overtaken += 1
            return -1
        self._counters.lost += missing
        return missing
