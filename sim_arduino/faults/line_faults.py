"""Faults of the serial link, which hit the bytes in one direction.  Pure; seeded; the caller passes time.

A fault gets bytes and their time, and returns the bytes that come out at this time.  Random faults hit the same bytes,
no matter how the stream is cut into pieces.
"""

import math
import random
from collections import deque
from typing import Deque, Iterator, List, Tuple

from mrl_driver.protocol.table import BAUD

_FLOOD_STEP_S = 0.01
_NEIGHBOUR_S = 0.01


class _Hits:
    """Random positions in an endless stream of bytes; each byte is hit with the same probability."""

    def __init__(self, rng: random.Random, rate: float) -> None:
        self._rng, self._rate = rng, rate
        self._left = self._gap()

    def _gap(self) -> int:
        """Number of bytes that pass unchanged before the next hit."""
        if self._rate >= 1:
            return 0
        if self._rate <= 0:
            return 1 << 62
        return int(min(1e18, math.log(1 - self._rng.random()) / math.log1p(-self._rate)))

    def among(self, count: int) -> Iterator[int]:
        """Offsets of the hits among the next `count` bytes."""
        done = 0
        while self._left < count - done:
            done += self._left + 1
            self._left = self._gap()
            yield done - 1
        self._left -= count - done


class _Instant:
    """A fault that holds no bytes back."""

    next_s = math.inf

    def empty(self) -> bytes:
        """Returns no bytes."""
        return b""


class Loss(_Instant):
    """Loses bytes: with the probability `rate` a byte begins a loss of `burst` bytes."""

    def __init__(self, rng: random.Random, rate: float, burst: float) -> None:
        self._hits, self._burst = _Hits(rng, rate), int(burst)
        self._losing = 0

    def run(self, data: bytes, now_s: float) -> bytes:
        """The bytes that are not lost."""
        hits = set(self._hits.among(len(data)))
        if not hits and not self._losing:
            return data
        out = bytearray()
        for i, byte in enumerate(data):
            if i in hits and not self._losing:
                self._losing = self._burst
            if self._losing:
                self._losing -= 1
            else:
                out.append(byte)
        return bytes(out)


class Change(_Instant):
    """Changes bytes: to any other value, or by one flipped bit if `bits` is set."""

    def __init__(self, rng: random.Random, rate: float, bits: bool = False) -> None:
        self._rng, self._hits, self._bits = rng, _Hits(rng, rate), bits

    def run(self, data: bytes, now_s: float) -> bytes:
        """The bytes with the changes."""
        out = bytearray(data)
        for i in self._hits.among(len(data)):
            out[i] ^= 1 << self._rng.randrange(8) if self._bits else self._rng.randrange(1, 256)
        return bytes(out)


class Flip(Change):
    """Flips one bit of a byte."""

    def __init__(self, rng: random.Random, rate: float) -> None:
        super().__init__(rng, rate, bits=True)


class Swap:
    """Swaps a byte with the next one; if no byte follows within 10 ms, it keeps its place."""

    def __init__(self, rng: random.Random, rate: float) -> None:
        self._hits = _Hits(rng, rate)
        self._held = b""
        self.next_s = math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
        """The bytes with the swaps."""
        out = bytearray(self.empty() if now_s >= self.next_s else b"")
        hits = set(self._hits.among(len(data)))
        for i in range(len(data)):
            later = self._held
            if later:
                out += data[i : i + 1]
            else:
                later = data[i : i + 1]
            self._held = later if i in hits else b""
            out += b"" if self._held else later
        if data:
            self.next_s = now_s + _NEIGHBOUR_S if self._held else math.inf
        return bytes(out)

    def empty(self) -> bytes:
        """Returns and drops the byte that waits for the next one."""
        held, self._held, self.next_s = self._held, b"", math.inf
        return held


class _Holding:
    """A fault that delays bytes and keeps their order."""

    def __init__(self) -> None:
        self._held: Deque[Tuple[float, bytes]] = deque()

    @property
    def next_s(self) -> float:
        """Time at which the first delayed bytes come out [s]."""
        return self._held[0][0] if self._held else math.inf

    def _due(self, now_s: float) -> bytes:
        out = bytearray()
        while self._held and self._held[0][0] <= now_s:
            out += self._held.popleft()[1]
        return bytes(out)

    def empty(self) -> bytes:
        """Returns and drops all delayed bytes."""
        return self._due(math.inf)


class Delay(_Holding):
    """Delays pieces by `delay` plus up to `jitter` [s]; no piece overtakes another."""

    def __init__(self, rng: random.Random, delay: float, jitter: float) -> None:
        super().__init__()
        self._rng, self._delay_s, self._jitter_s = rng, delay, jitter
        self._last_s = -math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
        """The bytes whose delay is over."""
        if data:
            self._last_s = max(self._last_s, now_s + self._delay_s + self._rng.random() * self._jitter_s)
            self._held.append((self._last_s, data))
        return self._due(now_s)


class Split(_Holding):
    """Splits data into pieces of at most `size` bytes, `gap` [s] apart."""

    def __init__(self, rng: random.Random, size: float, gap: float) -> None:
        super().__init__()
        self._rng, self._size, self._gap_s = rng, int(size), gap
        self._free_s = -math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
        """The pieces that are due."""
        while data:
            size = self._rng.randint(1, self._size)
            at_s = max(now_s, self._free_s)
            self._held.append((at_s, data[:size]))
            self._free_s, data = at_s + self._gap_s, data[size:]
        return self._due(now_s)


class Hold(_Holding):
    """Holds all bytes until the fault is over; then they come at once."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__()

    def run(self, data: bytes, now_s: float) -> bytes:
        """Returns no bytes; stores `data`."""
        if data:
            self._held.append((math.inf, data))
        return b""


class Junk(_Instant):
    """Inserts random bytes, `rate` per second."""

    def __init__(self, rng: random.Random, rate: float) -> None:
        self._rng, self._rate = rng, rate
        self._step_s = max(_FLOOD_STEP_S, 1 / rate)
        self.next_s = -math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
        """The bytes, after junk if it is due."""
        if now_s < self.next_s:
            return data
        self.next_s = now_s + self._step_s
        return bytes(self._rng.randrange(256) for _ in range(round(self._rate * self._step_s))) + data


class Text(_Instant):
    """Inserts a line of text every `period` [s]."""

    def __init__(self, rng: random.Random, period: float, text: str) -> None:
        self._period_s, self._line = period, text.encode("utf-8") + b"\r\n"
        self.next_s = -math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
        """The bytes, after the text if it is due."""
        if now_s < self.next_s:
            return data
        self.next_s = now_s + self._period_s
        return self._line + data


class Baud(_Instant):
    """Bytes sent at 115200 baud and read at another baud rate: the receiver samples where it expects the bits.

    The line is idle before each piece.
    """

    def __init__(self, rng: random.Random, rate: float) -> None:
        self._bits = BAUD / rate

    def run(self, data: bytes, now_s: float) -> bytes:
        """The bytes that the receiver reads."""
        line = [level for byte in data for level in (0, *(byte >> i & 1 for i in range(8)), 1)]
        out, at = bytearray(), 0.0
        while True:
            at = next((i for i in range(math.ceil(at), len(line)) if not line[i]), len(line))
            if at >= len(line):
                return bytes(out)
            out.append(sum(_level(line, at + (i + 1.5) * self._bits) << i for i in range(8)))
            at += 9.5 * self._bits


def _level(line: List[int], at: float) -> int:
    return line[int(at)] if at < len(line) else 1
