"""What a board can tell of its own health: refusals by reason, faults, why it started and why it stopped."""

from typing import Dict, Tuple

from mrl_driver.protocol.table import FAULTS, INT16_MAX, REASONS, RESET_CAUSES, STOP_REASONS

_BIT = {name: 1 << bit for bit, (name, _) in enumerate(FAULTS)}


class Health:
    """Counters and flags since the last reset.

    Attributes:
        counters: Refusals by the names of `table.REASONS`; each stays at 32767.
        reset_cause, stop_reason: Rows of their tables.
        clamped: Moves beyond the ceiling.
    """

    def __init__(self, reset_cause: str) -> None:
        self.counters: Dict[str, int] = {reason.name: 0 for reason in REASONS}
        self.reset_cause = RESET_CAUSES.index(reset_cause)
        self.stop_reason = STOP_REASONS.index("boot")
        self.clamped = 0
        self._turning = False
        self._present = self._unread = 0

    def count(self, reason: str) -> None:
        """Counts a refusal."""
        self.counters[reason] = min(INT16_MAX, self.counters[reason] + 1)

    def count_clamped(self) -> None:
        """Counts a move beyond the ceiling."""
        self.clamped = min(INT16_MAX, self.clamped + 1)

    def turned(self) -> None:
        """Notes that the motors were told to turn; the next stop is another one, even for the same reason."""
        if not self._turning:
            self.stop_reason = STOP_REASONS.index("none")
        self._turning = True

    def stopped(self, reason: str) -> None:
        """Notes why the motors were stopped; a stop of motors that nobody had turned keeps the earlier reason."""
        if self._turning:
            self.stop_reason = STOP_REASONS.index(reason)
        self._turning = False

    def set_fault(self, name: str, present: bool) -> None:
        """Raises or clears a fault; one that has gone stays visible until it has been read."""
        self._present = self._present | _BIT[name] if present else self._present & ~_BIT[name]
        self._unread |= self._present

    def has_fault(self, name: str) -> bool:
        """Whether a fault is present."""
        return bool(self._present & _BIT[name])

    def read(self) -> Tuple[int, int, int, int]:
        """Reset cause, stop reason, faults present or gone since the last call, and moves clamped."""
        faults, self._unread = self._unread, self._present
        return self.reset_cause, self.stop_reason, faults, self.clamped
