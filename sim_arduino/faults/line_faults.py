"""Faults of the link, which hit the bytes, or the frames, in one direction.  Pure; seeded; the caller passes time.

A fault gets bytes and their time, and returns the bytes that come out at this time.  Random faults hit the same bytes,
no matter how the stream is cut into pieces.  A frame ends with its `e`; bytes between frames belong to the next frame.
Each class has the methods of `schedule.LineFault`.
"""

import heapq
import math
import random
from collections import deque
from typing import Deque, Iterator, List, Tuple

from mrl_driver.protocol.table import BAUD

from .fault_kind import fault
from .key_values import Key

_SHARE = Key("rate", 0.001, 0.0, 1.0, "share of bytes")
_FRAMES = _SHARE._replace(text="share of frames")
_LONGEST = 256
_TEXT = "[INFO] the wheel e turned, @13e and @6,1,2e are not frames here"
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
        return b""


@fault(
    Key("rate", 0.001, 0.0, 1.0, "share of bytes at which a loss begins"),
    Key("burst", 1, 1, 1024, "bytes lost in a row", "byte"),
)
class _Loss(_Instant):
    """Bytes are lost."""

    def __init__(self, rng: random.Random, rate: float, burst: float) -> None:
        self._hits, self._burst = _Hits(rng, rate), int(burst)
        self._losing = 0

    def run(self, data: bytes, now_s: float) -> bytes:
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


@fault(_SHARE)
class _Change(_Instant):
    """A byte is replaced by another one."""

    bits = False  # whether only one bit changes

    def __init__(self, rng: random.Random, rate: float) -> None:
        self._rng, self._hits = rng, _Hits(rng, rate)

    def run(self, data: bytes, now_s: float) -> bytes:
        out = bytearray(data)
        for i in self._hits.among(len(data)):
            out[i] ^= 1 << self._rng.randrange(8) if self.bits else self._rng.randrange(1, 256)
        return bytes(out)


@fault(_SHARE)
class _Flip(_Change):
    """One bit of a byte is flipped."""

    bits = True


@fault(_SHARE)
class _Swap:
    """A byte and the next one are exchanged.

    If no byte follows within 10 ms, it keeps its place.
    """

    def __init__(self, rng: random.Random, rate: float) -> None:
        self._hits = _Hits(rng, rate)
        self._held = b""
        self.next_s = math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
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
        held, self._held, self.next_s = self._held, b"", math.inf
        return held


class _Frames:
    """A fault that hits each frame with the probability `rate`."""

    next_s = math.inf

    def __init__(self, rng: random.Random, rate: float) -> None:
        self._rng, self._rate = rng, rate
        self._begun = b""

    def _whole(self, data: bytes) -> Iterator[bytes]:
        """The frames that are complete."""
        *ended, rest = data.split(b"e")
        for part in ended:
            yield self._begun + part + b"e"
            self._begun = b""
        self._begun += rest
        if b"@" not in self._begun and self._begun.endswith(b"\n") or len(self._begun) > _LONGEST:
            yield self._begun  # not a frame
            self._begun = b""

    def _hit(self, part: bytes) -> bool:
        return b"@" in part and self._rng.random() < self._rate

    def run(self, data: bytes, now_s: float) -> bytes:
        return b"".join([self._turn(part, now_s) for part in self._whole(data)])

    def _turn(self, part: bytes, now_s: float) -> bytes:
        raise NotImplementedError

    def empty(self) -> bytes:
        begun, self._begun = self._begun, b""
        return begun


@fault(_FRAMES)
class _Drop(_Frames):
    """A whole frame is lost, as a datagram is."""

    def _turn(self, part: bytes, now_s: float) -> bytes:
        return b"" if self._hit(part) else part


@fault(_FRAMES)
class _Repeat(_Frames):
    """A frame arrives twice."""

    def _turn(self, part: bytes, now_s: float) -> bytes:
        return part + part[part.rfind(b"@") :] if self._hit(part) else part


@fault(_FRAMES, Key("delay", 0.05, 0.0, 60.0, "longest delay", "s"))
class _Overtake(_Frames):
    """A frame arrives after later ones."""

    def __init__(self, rng: random.Random, rate: float, delay: float) -> None:
        super().__init__(rng, rate)
        self._delay_s = delay
        self._held: List[Tuple[float, int, bytes]] = []
        self._count = 0

    @property
    def next_s(self) -> float:  # type: ignore[override]
        return self._held[0][0] if self._held else math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
        out = super().run(data, now_s)
        while self._held and self._held[0][0] <= now_s:
            out += heapq.heappop(self._held)[2]
        return out

    def _turn(self, part: bytes, now_s: float) -> bytes:
        if not self._hit(part):
            return part
        self._count += 1
        heapq.heappush(self._held, (now_s + self._rng.random() * self._delay_s, self._count, part))
        return b""

    def empty(self) -> bytes:
        held, self._held = sorted(self._held), []
        return b"".join([part for _, _, part in held]) + super().empty()


class _Holding:
    """A fault that delays bytes and keeps their order."""

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._held: Deque[Tuple[float, bytes]] = deque()

    @property
    def next_s(self) -> float:
        return self._held[0][0] if self._held else math.inf

    def _due(self, now_s: float) -> bytes:
        out = bytearray()
        while self._held and self._held[0][0] <= now_s:
            out += self._held.popleft()[1]
        return bytes(out)

    def empty(self) -> bytes:
        return self._due(math.inf)


@fault(
    Key("delay", 0.0, 0.0, 60.0, "delay of every piece", "s"),
    Key("jitter", 0.016, 0.0, 60.0, "largest random addition", "s"),
)
class _Delay(_Holding):
    """Bytes arrive late, in their order."""

    def __init__(self, rng: random.Random, delay: float, jitter: float) -> None:
        super().__init__(rng)
        self._delay_s, self._jitter_s = delay, jitter
        self._last_s = -math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
        if data:
            self._last_s = max(self._last_s, now_s + self._delay_s + self._rng.random() * self._jitter_s)
            self._held.append((self._last_s, data))
        return self._due(now_s)


@fault(
    Key("size", 3, 1, 1024, "largest size of a piece", "byte"),
    Key("gap", 0.003, 0.0, 1.0, "time between pieces", "s"),
)
class _Split(_Holding):
    """Bytes arrive in small pieces."""

    def __init__(self, rng: random.Random, size: float, gap: float) -> None:
        super().__init__(rng)
        self._size, self._gap_s = int(size), gap
        self._free_s = -math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
        while data:
            size = self._rng.randint(1, self._size)
            at_s = max(now_s, self._free_s)
            self._held.append((at_s, data[:size]))
            self._free_s, data = at_s + self._gap_s, data[size:]
        return self._due(now_s)


@fault(at_s=1.0, lasts_s=1.0)
class _Stall(_Holding):
    """All bytes are held back, then delivered at once."""

    def run(self, data: bytes, now_s: float) -> bytes:
        if data:
            self._held.append((math.inf, data))
        return b""


def _junk(bytes_per_s: float) -> Key:
    return Key("rate", bytes_per_s, 0.1, 100000.0, "bytes per second", "byte/s")


class _Insert(_Instant):
    """Inserts bytes every `step_s` [s]."""

    next_s = -math.inf

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s

    def run(self, data: bytes, now_s: float) -> bytes:
        if now_s < self.next_s:
            return data
        self.next_s = now_s + self._step_s
        return self._inserted() + data

    def _inserted(self) -> bytes:
        raise NotImplementedError


@fault(_junk(11520.0), name="flood", text="random bytes at the full rate of the serial link")
@fault(_junk(20.0))
class _Junk(_Insert):
    """Random bytes are inserted."""

    def __init__(self, rng: random.Random, rate: float) -> None:
        super().__init__(max(_FLOOD_STEP_S, 1 / rate))
        self._rng, self._count = rng, round(rate * self._step_s)

    def _inserted(self) -> bytes:
        return bytes(self._rng.randrange(256) for _ in range(self._count))


@fault(
    Key("period", 1.0, 0.001, 3600.0, "time between lines", "s"),
    Key("text", _TEXT, None, 0.0, "the text, without commas"),
)
class _Text(_Insert):
    """Lines of text are inserted, as 2013 boards send them."""

    def __init__(self, rng: random.Random, period: float, text: str) -> None:
        super().__init__(period)
        self._line = text.encode("utf-8") + b"\r\n"

    def _inserted(self) -> bytes:
        return self._line


@fault(Key("rate", 57600, 300, 1000000, "rate of the host's port", "Bd"))
class _Baud(_Instant):
    """The host's port has another baud rate than the board.

    Bytes are sent at 115200 baud, and the receiver samples where it expects the bits.

    The line is idle before each piece.
    """

    def __init__(self, rng: random.Random, rate: float) -> None:
        self._bits = BAUD / rate

    def run(self, data: bytes, now_s: float) -> bytes:
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
