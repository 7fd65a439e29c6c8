"""Arrival times of one clock as stamps of another that never repeat.  Pure, integers throughout."""

STEP_NS = 1000
"""Two frames out of one read differ at least by this."""
JUMP_NS = 1_000_000_000
"""A clock set back further than this was set on purpose, and is followed."""


class Stamps:
    """Wall-clock stamps for events that were timed by the monotonic clock."""

    def __init__(self) -> None:
        self._last_ns = 0

    def next(self, event_s: float, monotonic_ns: int, wall_ns: int) -> int:
        """Wall time [ns] of an event at `event_s` of the monotonic clock, later than the one before.

        `monotonic_ns` and `wall_ns` are both clocks read now.
        """
        stamp_ns = wall_ns - monotonic_ns + round(event_s * 1e9)
        least_ns = self._last_ns + STEP_NS
        if stamp_ns < least_ns and stamp_ns > self._last_ns - JUMP_NS:
            stamp_ns = least_ns
        self._last_ns = stamp_ns
        return stamp_ns
