"""Converts arrival times from the monotonic clock to stamps of wall or simulated time that never repeat.  Pure."""

from typing import Tuple

STEP_S = 1e-6
"""Smallest difference of two stamps; four times the resolution of a float with today's time in seconds."""
JUMP_S = 1.0
"""If the clock goes back further than this, it was set on purpose, and the stamps follow it."""


class Stamps:
    """Makes wall-clock stamps for events timed by the monotonic clock."""

    def __init__(self) -> None:
        self._least_s = 0.0

    def next(self, event_s: float, monotonic_s: float, wall_s: float) -> Tuple[int, int]:
        """Wall time [s, ns] of an event at `event_s` of the monotonic clock; later than the previous stamp.

        `monotonic_s` and `wall_s` are the current readings of both clocks.
        """
        stamp_s = max(0.0, wall_s - monotonic_s + event_s)  # simulated time begins at 0
        if stamp_s < self._least_s and stamp_s > self._least_s - JUMP_S:
            stamp_s = self._least_s
        self._least_s = stamp_s + STEP_S
        secs = int(stamp_s)
        return secs, int((stamp_s - secs) * 1e9)
