"""A serial line as levels of a pin, 8N1: bytes to edges, and edges to bytes.  Times in seconds."""

from typing import Iterator, List, Optional, Tuple

FRAME_BITS = 10
"""Start, eight data bits, stop."""
_BYTE_DECIDED = FRAME_BITS - 0.5
"""The middle of the stop bit [bit]."""


def edges(data: bytes, at_s: float, baud: float) -> Iterator[Tuple[float, int]]:
    """The edges of bytes that follow each other on an idle line from `at_s` on: time [s] and new level."""
    level, bit_s = 1, 1.0 / baud
    for number, byte in enumerate(data):
        for bit, value in enumerate((0, *(byte >> n & 1 for n in range(8)), 1)):
            if value != level:
                yield at_s + (number * FRAME_BITS + bit) * bit_s, value
                level = value


class BitReceiver:
    """Reads the bytes on a line that is idle at first; each bit is sampled in its middle."""

    def __init__(self, baud: float) -> None:
        self._bit_s = 1.0 / baud
        self._edges: List[Tuple[float, int]] = []

    def changed(self, level: int, at_s: float) -> None:
        """The line has a new level from `at_s` [s] on; times never decrease."""
        self._edges.append((at_s, level))

    def take(self, to_s: float) -> bytes:
        """The bytes whose stop bit has been sampled by `to_s` [s]."""
        out = bytearray()
        while True:
            start_s = self._start_s()
            if start_s is None or start_s + _BYTE_DECIDED * self._bit_s > to_s:
                return bytes(out)
            out.append(self._byte(start_s))
            self._forget(start_s + _BYTE_DECIDED * self._bit_s)

    def _start_s(self) -> Optional[float]:
        return next((at_s for at_s, level in self._edges if level == 0), None)

    def _byte(self, start_s: float) -> int:
        return sum(self._level(start_s + (1.5 + bit) * self._bit_s) << bit for bit in range(8))

    def _level(self, at_s: float) -> int:
        return next((level for when_s, level in reversed(self._edges) if when_s <= at_s), 1)

    def _forget(self, to_s: float) -> None:
        """Drops the edges of a byte that was read."""
        self._edges = [edge for edge in self._edges if edge[0] >= to_s]
