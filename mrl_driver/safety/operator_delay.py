"""The operator's delay: the time from an input to the command that it causes, and when driving must stop.  Pure.

Both ends judge it, because their clocks need not agree.  The operator's end measures, on its own clock, from the input
to the echo of the command (`EchoDelay`), which is more than the command itself took, and stops above a limit
(`DelayGuard`).  The robot's end sees how much later than the fastest message a command arrives (`Lateness`), and does
not follow late ones.  `Lateness` cannot see the delay of that fastest message.  But its echo came within the
operator's limit, or the operator's end stops.  So the robot follows no command that is older than both limits
together, except those that the operator's end sent before it knew the delay: at most as long as its limit.
"""

import math
from collections import deque
from typing import Deque

MAX_DELAY_S = 0.5
"""Default limit [s], the same as the timeout of commands: at 0.25 m/s the robot covers 13 cm in this time."""
DRIFT = 1e-3  # largest drift between two clocks [s/s]: NTP slews each by at most 500 ppm
_MOST_WAITING = 1000
_SAME_S = 1e-6


class EchoDelay:
    """Delay of the newest echo, or of the oldest command that still has none."""

    def __init__(self) -> None:
        self._waiting: Deque[float] = deque()
        self._last_s = math.nan

    def sent(self, stamp_s: float) -> None:
        """Take note of a command whose input was at `stamp_s` [s, the operator's clock]."""
        if len(self._waiting) < _MOST_WAITING:
            self._waiting.append(stamp_s)

    def echoed(self, stamp_s: float, now_s: float) -> None:
        """The echo of the command with this stamp has arrived; those before it were replaced by it."""
        while self._waiting and self._waiting[0] <= stamp_s + _SAME_S:
            self._waiting.popleft()
        self._last_s = now_s - stamp_s

    def forget(self) -> None:
        """Nobody echoes any more: the delay is unknown."""
        self._waiting.clear()
        self._last_s = math.nan

    def delay_s(self, now_s: float) -> float:
        """The delay now [s]; NaN before the first command."""
        if self._waiting and not now_s - self._waiting[0] <= self._last_s:
            return now_s - self._waiting[0]
        return self._last_s


class DelayGuard:
    """Stops an operator's driving above a limit, until the keys are released and pressed again."""

    def __init__(self, most_s: float) -> None:
        """`most_s`: the limit [s], 0 for none."""
        self._most_s = most_s
        self._driving, self.reason = False, ""  # the reason why a held key does not drive; empty if it may

    def may_drive(self, wanted: bool, delay_s: float) -> bool:
        """Return whether the robot may drive now; `wanted` says that the operator wants it.  NaN never stops it."""
        self._driving = wanted and not self.reason
        if not wanted:
            self.reason = ""
        elif self._most_s and delay_s > self._most_s and not self.reason:
            most = delay_text(self._most_s)
            self._hold(
                f"the delay is {delay_text(delay_s)}, above the limit of {most}: computer or network is too slow"
            )
        return self._driving

    def lose(self) -> None:
        """The delay can no longer be measured: the operator must begin again."""
        if self._driving:
            self._hold("the robot no longer reports the delay")

    def _hold(self, cause: str) -> None:
        self.reason, self._driving = f"stopped: {cause}; release and press again", False


class Lateness:
    """How much later than the fastest message so far one arrives, from stamps of a clock that is not ours."""

    def __init__(self) -> None:
        self._offset_s = math.inf
        self._arrival_s = 0.0

    def of(self, stamp_s: float, arrival_s: float) -> float:
        """Return how much later than the fastest a message arrives [s]; 0 for the first.

        Args:
            stamp_s: when it was sent [s, the sender's clock].
            arrival_s: when it arrived [s, our clock].  Neither clock may jump.
        """
        drifted_s = self._offset_s + DRIFT * max(0.0, arrival_s - self._arrival_s)
        self._offset_s, self._arrival_s = min(arrival_s - stamp_s, drifted_s), arrival_s
        return arrival_s - stamp_s - self._offset_s


def delay_text(delay_s: float) -> str:
    """Return a delay as text: `12 ms`, `unknown`."""
    if math.isnan(delay_s):
        return "unknown"
    return f"{delay_s * 1000:.0f} ms" if delay_s < 1 else f"{delay_s:.1f} s"
