"""Counters of the link, for users and for diagnostics."""

from typing import Dict, NamedTuple


class Statistics(NamedTuple):
    """A snapshot of the counters since the link was opened."""

    bytes_in: int
    bytes_out: int
    frames: int  # accepted frames of any kind
    garbage: Dict[str, int]  # pieces that were not frames, by reason (names of `table.REASONS`, and `text`)
    lost: int  # stream frames missing by their sequence numbers (boards with checksums)
    duplicates: int  # stream frames that arrived twice
    overtaken: int
    """Stream frames that arrived after a later one (datagrams may); they are not used and also count as lost."""
    refused_counts: int  # readings that no wheel could have made; never used
    restarts: int  # times the board restarted, or may have, and was greeted again
    unanswered: int  # requests without an answer in time
    blocked_writes: int  # writes that the port did not accept within 100 ms
    reconnects: int  # times the port was lost and the robot found again
    streamed: int = 0  # frames of the stream that were used
    texts_dropped: int = 0
    """Texts for the radio that were not sent, because the board was silent for too long."""
    uncommanded_motions: int = 0
    """Times that the counters of a standing robot began to change without a command, and it was stopped again."""


class Counters:
    """The running counters; `snapshot` returns them as `Statistics`."""

    def __init__(self) -> None:
        self.bytes_in = self.bytes_out = self.frames = self.lost = self.duplicates = 0
        self.overtaken = 0
        self.refused_counts = self.restarts = self.unanswered = self.blocked_writes = 0
        self.reconnects = self.streamed = self.texts_dropped = self.uncommanded_motions = 0
        self.garbage: Dict[str, int] = {}

    def count_garbage(self, reason: str) -> None:
        """Count one piece that was not a frame."""
        self.garbage[reason] = self.garbage.get(reason, 0) + 1

    def snapshot(self) -> Statistics:
        """Return the current counters."""
        values = dict(vars(self), garbage=dict(self.garbage))
        return Statistics(**values)
