"""Timing of the serial link: bytes follow each other, and each takes the time of its ten bits."""

import math
import re
from collections import deque
from typing import Deque, Optional, Tuple

from mrl_driver.protocol.table import BAUD

OUT_BYTE_S = 85.0e-6  # time of one byte from a Uno set to 115200 baud [s]; its real baud rate is 117647
IN_BYTE_S = 10.0 / BAUD  # time of one byte from the host [s]
SAME_BAUD = 0.05  # two baud rates that differ by less than this share work together
_ROUNDING_S = 1e-9
_PIECE = re.compile(b"[^e]*e|[^e]+")


def through_line(data: bytes, sender_baud: float, receiver_baud: float) -> bytes:
    """What arrives of `data`: garbage of the same length if the baud rates of both ends differ [Bd]."""
    return data if abs(sender_baud / receiver_baud - 1.0) < SAME_BAUD else b"\xff" * len(data)


class Outgoing:
    """Bytes in transit to the host; each takes `byte_s` [s]."""

    def __init__(self) -> None:
        self.free_s, self.byte_s = 0.0, OUT_BYTE_S
        self._chunks: Deque[Tuple[float, bytes]] = deque()

    def put(self, data: bytes, at_s: float) -> None:
        """Sends `data` from `at_s` [s] on, after the bytes that are still on the line."""
        start = max(at_s, self.free_s)
        self.free_s = start + len(data) * self.byte_s
        self._chunks.append((start, data))

    def take(self, to_s: float) -> bytes:
        """Bytes whose stop bit has passed by `to_s` [s]."""
        out = b""
        while self._chunks:
            start, data = self._chunks[0]
            done = int(math.floor((to_s - start + _ROUNDING_S) / self.byte_s))
            if done < len(data):
                if done > 0:
                    out += data[:done]
                    self._chunks[0] = (start + done * self.byte_s, data[done:])
                return out
            out += data
            self._chunks.popleft()
        return out

    @property
    def next_s(self) -> float:
        """Time at which the first frame on the line has left [s]; infinite if the line is empty."""
        if not self._chunks:
            return math.inf
        start, data = self._chunks[0]
        return start + len(data) * self.byte_s


class Incoming:
    """Bytes in transit from the host; each takes `byte_s` [s].

    They are cut after each end of a frame, where the board may have something to do.
    """

    def __init__(self) -> None:
        self._free_s, self.byte_s = 0.0, IN_BYTE_S
        self._pieces: Deque[Tuple[float, bytes]] = deque()

    def put(self, data: bytes, at_s: float) -> None:
        """Puts bytes on the line at `at_s` [s], or after the bytes that are still there."""
        start = max(at_s, self._free_s)
        done = 0
        for piece in _PIECE.findall(data):
            done += len(piece)
            self._pieces.append((start + done * self.byte_s, piece))
        self._free_s = start + done * self.byte_s

    @property
    def next_s(self) -> float:
        """Time at which the last byte of the next piece has arrived [s]; infinite if the line is empty."""
        return self._pieces[0][0] if self._pieces else math.inf

    def take(self) -> bytes:
        """The next piece."""
        return self._pieces.popleft()[1]

    def clear(self) -> None:
        """Drops all bytes on the line."""
        self._pieces.clear()
        self._free_s = 0.0


class Ring:
    """An input buffer of this many bytes; bytes that do not fit are lost."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._bytes: Deque[int] = deque()

    def put(self, data: bytes) -> None:
        """Stores the bytes that fit."""
        self._bytes.extend(data[: self._size - len(self._bytes)])

    def take(self) -> Optional[int]:
        """The oldest byte, or None."""
        return self._bytes.popleft() if self._bytes else None

    def __len__(self) -> int:
        return len(self._bytes)
