"""Counters of the link, for users and for diagnostics."""

from dataclasses import dataclass, field, replace
from typing import Dict


@dataclass
class Counters:
    """What happened on the link since it was opened."""

    bytes_in: int = 0
    bytes_out: int = 0
    frames: int = 0  # accepted, of any kind
    garbage: Dict[str, int] = field(default_factory=dict)
    """Pieces that were not frames, by reason (names of `table.REASONS`, and `text`)."""
    lost: int = 0  # stream frames missing by their sequence numbers (boards with checksums)
    duplicates: int = 0  # stream frames that arrived twice
    overtaken: int = 0
    """Stream frames that arrived after a later one (datagrams may); they are not used and also count as lost."""
    refused_counts: int = 0  # readings that no wheel could have made; never used
    restarts: int = 0  # times the board restarted, or may have, and was greeted again
    unanswered: int = 0  # requests without an answer in time
    blocked_writes: int = 0  # writes that the port did not accept within 100 ms
    reconnects: int = 0  # times the port was lost and the robot found again
    streamed: int = 0  # frames of the stream that were used
    texts_dropped: int = 0  # texts for the radio that were not sent: the board was silent for too long
    uncommanded_motions: int = 0
    """Times that the counters of a standing robot began to change without a command, and it was stopped again."""

    def count_garbage(self, reason: str) -> None:
        """Count one piece that was not a frame."""
        self.garbage[reason] = self.garbage.get(reason, 0) + 1

    def snapshot(self) -> "Counters":
        """Return a copy, which does not change any more."""
        return replace(self, garbage=dict(self.garbage))
