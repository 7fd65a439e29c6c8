"""Computes the bytes that a receiver at another baud rate reads when a board sends."""

from bisect import bisect_right
from typing import List, Sequence

from .records import SentByte

FRAME_BITS = 10  # start, eight data bits, stop
CLOSE_ENOUGH = 0.04  # relative speed difference at which the last bit is still read correctly


def received(sent: Sequence[SentByte], bit_cycles: float) -> bytes:
    """The bytes that a receiver with this bit length [cycle] reads, including framing errors.

    Bytes at the receiver's speed pass unchanged; others are sampled in the middle of the receiver's bits.
    """
    if all(
        abs((byte.end_cycle - byte.start_cycle) / FRAME_BITS / bit_cycles - 1) < CLOSE_ENOUGH for byte in sent
    ):
        return bytes(byte.data for byte in sent)
    received: List[int] = []
    free_at = 0.0
    starts = [byte.start_cycle for byte in sent]
    for edge in _falling_edges(sent):
        if edge >= free_at:
            samples = (_level(sent, starts, edge + (1.5 + bit) * bit_cycles) << bit for bit in range(8))
            received.append(sum(samples))
            free_at = edge + 9.5 * bit_cycles
    return bytes(received)


def _bits(byte: SentByte) -> List[int]:
    return [0] + [byte.data >> bit & 1 for bit in range(8)] + [1]


def _falling_edges(sent: Sequence[SentByte]) -> List[float]:
    edges = []
    for byte in sent:
        bits, length = _bits(byte), (byte.end_cycle - byte.start_cycle) / FRAME_BITS
        falls = [at for at in range(FRAME_BITS) if not bits[at] and (at == 0 or bits[at - 1])]
        edges += [byte.start_cycle + at * length for at in falls]
    return edges


def _level(sent: Sequence[SentByte], starts: Sequence[int], moment: float) -> int:
    """Level of the line at a moment [cycle]; a binary search, because one second may hold over 10000 bytes."""
    byte = sent[max(0, bisect_right(starts, moment) - 1)]
    if not byte.start_cycle <= moment < byte.end_cycle:
        return 1
    at = int((moment - byte.start_cycle) * FRAME_BITS / (byte.end_cycle - byte.start_cycle))
    return _bits(byte)[at]
