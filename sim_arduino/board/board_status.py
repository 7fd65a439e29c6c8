"""The status of a board: refused requests by reason, faults, reset cause, stop reason."""

from typing import Callable, Dict, Tuple

from mrl_driver.protocol.stop_reason import STOP_REASONS, StopReason
from mrl_driver.protocol.table import FAULTS, INT16_MAX, REASONS, RESET_CAUSES

_BIT = {name: 1 << bit for bit, (name, _) in enumerate(FAULTS)}


class BoardStatus:
    """Counters and flags since the last reset; `ask` queues the reply to `read_status`."""

    def __init__(self, reset_cause: str, ask: Callable[[], None]) -> None:
        self._ask = ask
        self.counters: Dict[str, int] = {reason.name: 0 for reason in REASONS}  # refusals; they stop at 32767
        self.reset_cause = RESET_CAUSES.index(reset_cause)
        self.stop_reason = STOP_REASONS.index(StopReason.BOOT)
        self.clamped = 0  # number of moves beyond the speed ceiling
        self.stops_are_final = False
        """After a stop that the host did not order, only its own stop ends the refusals."""
        self._turning = self._own_stop = False
        self._present = self._unread = 0

    def count(self, reason: str) -> None:
        """Counts a refusal."""
        self.counters[reason] = min(INT16_MAX, self.counters[reason] + 1)

    def count_clamped(self) -> None:
        """Counts a move beyond the speed ceiling."""
        self.clamped = min(INT16_MAX, self.clamped + 1)

    def turned(self) -> None:
        """Notes a command that turns the motors; the next stop is a new one, even for the same reason."""
        if not self._turning:
            self.stop_reason = STOP_REASONS.index(StopReason.NONE)
        self._turning, self._own_stop = True, False

    def stopped(self, reason: StopReason) -> None:
        """Notes why the motors were stopped; if they were not turning, the earlier reason stays."""
        if self._turning:
            self.stop_reason = STOP_REASONS.index(reason)
        self._own_stop = self._own_stop or (self._turning and reason != StopReason.HOST)
        self._turning = False

    def host_stopped(self) -> None:
        """Notes a stop (13)."""
        self._own_stop = False

    def refuses_move(self) -> bool:
        """Whether only the host's stop lets the robot move again; a refused move is answered with the status."""
        refused = self._own_stop and self.stops_are_final
        if refused:
            self._ask()
        return refused

    def set_fault(self, name: str, present: bool) -> None:
        """Sets or clears a fault; a cleared fault stays visible until it has been read."""
        self._present = self._present | _BIT[name] if present else self._present & ~_BIT[name]
        self._unread |= self._present

    def has_fault(self, name: str) -> bool:
        """Whether a fault is present."""
        return bool(self._present & _BIT[name])

    def read(self) -> Tuple[int, int, int, int]:
        """Reset cause, stop reason, faults present now or since the last call, and number of clamped moves."""
        faults, self._unread = self._unread, self._present
        return self.reset_cause, self.stop_reason, faults, self.clamped
