"""Which frames of the board are new, which were lost, and when each was made."""

import math
from typing import Optional

from mrl_driver.protocol.codec import Stamp

from .board_clock import BoardClock, HostTime
from .link_counters import Counters

STAMP_STEP_S = 1e-6
"""Frames without board time that came in one piece are told apart by this."""
_OVERTAKEN = 0x10000 - 1024
"""A frame numbered up to 1024 before the last one was overtaken on its way (datagrams are); numbers further back are a
gap, for they wrap.
"""


class Stream:
    """Numbers and times of the frames since the board started."""

    def __init__(self, counters: Counters) -> None:
        self._counters = counters
        self._clock = BoardClock()
        self._stamp_s = -math.inf
        self._sequence: Optional[int] = None

    def begin_anew(self) -> None:
        """The board has restarted: numbers and times have no past."""
        self._clock, self._sequence = BoardClock(), None

    def unnumbered(self, now: float) -> HostTime:
        """When a frame without board time was made that came at `now`: then."""
        self._stamp_s = max(now, self._stamp_s + STAMP_STEP_S)
        return HostTime(self._stamp_s, now, 0.0)

    def numbered(self, stamp: Stamp, now: float, silent: bool) -> Optional[HostTime]:
        """When a frame was made that came at `now`; None where it or a later one came before."""
        missing = self.missing(stamp.sequence, silent)
        return None if missing < 0 else self._clock.update(stamp.time, now, not missing)

    def missing(self, sequence: int, silent: bool) -> int:
        """Frames lost before the one of this number; -1 where it or a later one came before.

        After a `silent` time numbers may have gone once round, nearly.
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
