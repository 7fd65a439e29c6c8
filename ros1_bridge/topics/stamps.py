"""Arrival times of one clock as stamps of another, wall clock or simulated time, that never repeat.  Pure."""

from typing import Tuple

STEP_S = 1e-6
"""Two frames out of one read differ at least by this; four times what a float of today's seconds tells apart."""
JUMP_S = 1.0
"""A clock set back further than this was set on purpose, and is followed."""


class Stamps:
    """Wall-clock stamps for events that were timed by the monotonic clock."""

    def __init__(self) -> None:
        self._least_s = 0.0

    def next(self, event_s: float, monotonic_s: float, wall_s: float) -> Tuple[int, int]:
        """Wall time [s, ns] of an event at `event_s` of the monotonic clock, later than the one before.

        `monotonic_s` and `wall_s` are both clocks read now.
        """
        stamp_s = max(0.0, wall_s - monotonic_s + event_s)  # simulated time begins at 0
        if stamp_s < self._least_s and stamp_s > self._least_s - JUMP_S:
            stamp_s = self._least_s
        self._least_s = stamp_s + STEP_S
        secs = int(stamp_s)
        return secs, int((stamp_s - secs) * 1e9)
