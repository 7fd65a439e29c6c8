"""What the link has seen: counters for people and for diagnostics."""

from typing import Dict, NamedTuple


class Statistics(NamedTuple):
    """A snapshot of the counters since the link was opened."""

    bytes_in: int
    bytes_out: int
    frames: int
    """Accepted frames of any kind."""
    garbage: Dict[str, int]
    """Pieces that were no frame, by reason (names of `table.REASONS`, and `text`)."""
    lost: int
    """Stream frames that the sequence numbers say are missing (boards with check value)."""
    duplicates: int
    """Stream frames that came once more."""
    overtaken: int
    """Stream frames that came after a later one, as datagrams may; not used, and counted as lost before."""
    refused_counts: int
    """Readings that no wheel could have made; never used."""
    restarts: int
    """Times the board was greeted again and had restarted, or may have."""
    unanswered: int
    """Requests whose answer did not come in time."""
    blocked_writes: int
    """Writes that the port did not take within 100 ms."""
    reconnects: int
    """Times the port was lost and the robot found again."""


class Counters:
    """The same while they count."""

    def __init__(self) -> None:
        self.bytes_in = self.bytes_out = self.frames = self.lost = self.duplicates = 0
        self.overtaken = 0
        self.refused_counts = self.restarts = self.unanswered = self.blocked_writes = 0
        self.reconnects = 0
        self.garbage: Dict[str, int] = {}

    def count_garbage(self, reason: str) -> None:
        """One more piece that was no frame."""
        self.garbage[reason] = self.garbage.get(reason, 0) + 1

    def snapshot(self) -> Statistics:
        """The counters as they stand."""
        values = dict(vars(self), garbage=dict(self.garbage))
        return Statistics(**values)
