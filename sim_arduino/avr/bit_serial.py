"""A serial line as levels of a pin, 8N1: bytes to edges, and edges to bytes."""

import math
from bisect import bisect_left, bisect_right
from typing import Iterator, List, Sequence, Tuple

from .records import SentByte

FRAME_BITS = 10  # start, eight data bits, stop
CLOSE_ENOUGH = 0.04  # relative difference of two speeds at which the last bit is still read correctly
_BYTE_DECIDED = FRAME_BITS - 0.5  # the middle of the stop bit [bit]


def edges(data: bytes, start: float, bit: float) -> Iterator[Tuple[float, int]]:
    """The edges of bytes that follow each other on an idle line from `start` on: time and new level.

    `bit` is the length of a bit in the unit of the times.
    """
    level = 1
    for number, byte in enumerate(data):
        for place, value in enumerate((0, *(byte >> n & 1 for n in range(8)), 1)):
            if value != level:
                yield start + (number * FRAME_BITS + place) * bit, value
                level = value


class BitReceiver:
    """Reads the bytes on a line that is idle at first; each bit is sampled in its middle.

    Args:
        bit: Length of a bit, in the unit of all times.
    """

    def __init__(self, bit: float) -> None:
        self._bit = bit
        self._times: List[float] = []
        self._levels: List[int] = []

    def changed(self, level: int, time: float) -> None:
        """The line has a new level from a time on; times never decrease."""
        self._times.append(time)
        self._levels.append(level)

    def take(self, until: float) -> bytes:
        """The bytes whose stop bit has been sampled by `until`."""
        out, at = bytearray(), 0
        while True:
            at = next((n for n in range(at, len(self._levels)) if not self._levels[n]), len(self._levels))
            if at == len(self._levels) or self._times[at] + _BYTE_DECIDED * self._bit > until:
                break
            start = self._times[at]
            out.append(sum(self._level(start + (1.5 + bit) * self._bit) << bit for bit in range(8)))
            at = bisect_left(self._times, start + _BYTE_DECIDED * self._bit)
        del self._times[:at], self._levels[:at]
        return bytes(out)

    def _level(self, time: float) -> int:
        return self._levels[bisect_right(self._times, time) - 1]


def received(sent: Sequence[SentByte], bit_cycles: float) -> bytes:
    """The bytes that a receiver with this bit length [cycle] reads, including framing errors.

    Bytes at the receiver's speed pass unchanged; others are sampled in the middle of the receiver's bits.
    """
    lengths = [(byte.end_cycle - byte.start_cycle) / FRAME_BITS for byte in sent]
    if all(abs(length / bit_cycles - 1) < CLOSE_ENOUGH for length in lengths):
        return bytes(byte.data for byte in sent)
    line = BitReceiver(bit_cycles)
    for byte, length in zip(sent, lengths):
        for time, level in edges(bytes([byte.data]), byte.start_cycle, length):
            line.changed(level, time)
    return line.take(math.inf)
