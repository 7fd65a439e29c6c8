"""Faults of the link, which hit the bytes, or the frames, in one direction.  Pure; seeded; the caller passes time.

Random faults hit the same bytes, no matter how the stream is cut into pieces.  A frame ends with its `e`; bytes between
frames belong to the next frame.  The keys of each fault are its attributes.
"""

import heapq
import math
import random
from typing import Any, Iterable, List, Tuple

from mrl_driver.protocol.table import BAUD

from .fault_kind import fault
from .key_values import Key

_SHARE = Key("rate", 0.001, 0.0, 1.0, "share of bytes")
_FRAMES = _SHARE._replace(text="share of frames")
_LONGEST = 256
_TEXT = "[INFO] the wheel e turned, @13e and @6,1,2e are not frames here"
_FLOOD_STEP_S = 0.01
_NEIGHBOUR_S = 0.01
_Pieces = Iterable[Tuple[float, bytes]]


class LineFault:
    """A fault on one direction of the line, whose parameters are its attributes: bytes come out at their own times.

    A kind of fault has its own `pieces`; `rest` holds bytes that wait for the next ones.
    """

    rest = b""

    def __init__(self, rng: random.Random, **values: Any) -> None:
        self.rng = rng
        self._held: List[Tuple[float, int, bytes]] = []
        self._count = 0
        vars(self).update(values)

    def pieces(self, data: bytes, now_s: float) -> _Pieces:
        """What becomes of `data`, which may be empty: bytes, and the time at which they come out [s]."""
        raise NotImplementedError

    @property
    def next_s(self) -> float:
        """Time at which bytes come out without new input [s]; may be infinite."""
        return self._held[0][0] if self._held else math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
        """The bytes that come out at `now_s` when `data`, which may be empty, goes in."""
        for due_s, piece in self.pieces(data, now_s):
            if piece:
                self._count += 1
                heapq.heappush(self._held, (due_s, self._count, piece))
        return self._due(now_s)

    def empty(self) -> bytes:
        """Returns and drops all held bytes."""
        rest, self.rest = self.rest, b""
        return self._due(math.inf) + rest

    def _due(self, now_s: float) -> bytes:
        out = bytearray()
        while self._held and self._held[0][0] <= now_s:
            out += heapq.heappop(self._held)[2]
        return bytes(out)


class _Random(LineFault):
    """A fault that hits bytes or frames with the probability `rate`."""

    rate: float

    def _hits(self) -> bool:
        return self.rng.random() < self.rate


@fault(
    Key("rate", 0.001, 0.0, 1.0, "share of bytes at which a loss begins"),
    Key("burst", 1, 1, 1024, "bytes lost in a row", "byte"),
)
class _Loss(_Random):
    """Bytes are lost."""

    burst: float
    _losing = 0

    def pieces(self, data: bytes, now_s: float) -> _Pieces:
        out = bytearray()
        for byte in data:
            if not self._losing and self._hits():
                self._losing = int(self.burst)
            if self._losing:
                self._losing -= 1
            else:
                out.append(byte)
        yield now_s, bytes(out)


@fault(_SHARE)
class _Change(_Random):
    """A byte is replaced by another one."""

    def pieces(self, data: bytes, now_s: float) -> _Pieces:
        yield now_s, bytes([byte ^ self._wrong() if self._hits() else byte for byte in data])

    def _wrong(self) -> int:
        return self.rng.randrange(1, 256)


@fault(_SHARE)
class _Flip(_Change):
    """One bit of a byte is flipped."""

    def _wrong(self) -> int:
        return 1 << self.rng.randrange(8)


@fault(_SHARE)
class _Swap(_Random):
    """A byte and the next one are exchanged.

    If no byte follows within 10 ms, it keeps its place.
    """

    next_s = math.inf

    def pieces(self, data: bytes, now_s: float) -> _Pieces:
        if now_s >= self.next_s:
            yield now_s, self.empty()
        for byte in data:
            if self.rest:
                yield now_s, bytes([byte])
            else:
                self.rest = bytes([byte])
            if not self._hits():
                yield now_s, self.rest
                self.rest = b""
        if data or not self.rest:
            self.next_s = now_s + _NEIGHBOUR_S if self.rest else math.inf


class _Frames(_Random):
    """A fault that hits frames; `rest` is the frame that has begun."""

    def pieces(self, data: bytes, now_s: float) -> _Pieces:
        *ended, rest = data.split(b"e")
        for part in ended:
            whole, self.rest = self.rest + part + b"e", b""
            yield from self._hit(whole, now_s) if b"@" in whole and self._hits() else [(now_s, whole)]
        self.rest += rest
        if b"@" not in self.rest and self.rest.endswith(b"\n") or len(self.rest) > _LONGEST:
            yield now_s, self.rest  # not a frame
            self.rest = b""

    def _hit(self, whole: bytes, now_s: float) -> _Pieces:
        """What becomes of a frame, and bytes before it, that is hit."""
        raise NotImplementedError


@fault(_FRAMES)
class _Drop(_Frames):
    """A whole frame is lost, as a datagram is."""

    def _hit(self, whole: bytes, now_s: float) -> _Pieces:
        return ()


@fault(_FRAMES)
class _Repeat(_Frames):
    """A frame arrives twice."""

    def _hit(self, whole: bytes, now_s: float) -> _Pieces:
        yield now_s, whole + whole[whole.rfind(b"@") :]


@fault(_FRAMES, Key("delay", 0.05, 0.0, 60.0, "longest delay", "s"))
class _Overtake(_Frames):
    """A frame arrives after later ones."""

    delay: float

    def _hit(self, whole: bytes, now_s: float) -> _Pieces:
        yield now_s + self.rng.random() * self.delay, whole


@fault(
    Key("delay", 0.0, 0.0, 60.0, "delay of every piece", "s"),
    Key("jitter", 0.016, 0.0, 60.0, "largest random addition", "s"),
)
class _Delay(LineFault):
    """Bytes arrive late, in their order."""

    delay: float
    jitter: float
    _last_s = -math.inf

    def pieces(self, data: bytes, now_s: float) -> _Pieces:
        if data:
            self._last_s = max(self._last_s, now_s + self.delay + self.rng.random() * self.jitter)
            yield self._last_s, data


@fault(
    Key("size", 3, 1, 1024, "largest size of a piece", "byte"),
    Key("gap", 0.003, 0.0, 1.0, "time between pieces", "s"),
)
class _Split(LineFault):
    """Bytes arrive in small pieces."""

    size: float
    gap: float
    _free_s = -math.inf

    def pieces(self, data: bytes, now_s: float) -> _Pieces:
        while data:
            size, at_s = self.rng.randint(1, int(self.size)), max(now_s, self._free_s)
            yield at_s, data[:size]
            self._free_s, data = at_s + self.gap, data[size:]


@fault(at_s=1.0, lasts_s=1.0)
class _Stall(LineFault):
    """All bytes are held back, then delivered at once."""

    def pieces(self, data: bytes, now_s: float) -> _Pieces:
        yield math.inf, data


class _Insert(LineFault):
    """Inserts bytes from time to time."""

    next_s = -math.inf

    def pieces(self, data: bytes, now_s: float) -> _Pieces:
        if now_s >= self.next_s:
            pause_s, inserted = self._inserted()
            self.next_s = now_s + pause_s
            yield now_s, inserted
        yield now_s, data

    def _inserted(self) -> Tuple[float, bytes]:
        """Time until the next insertion [s], and the bytes of this one."""
        raise NotImplementedError


def _junk(bytes_per_s: float) -> Key:
    return Key("rate", bytes_per_s, 0.1, 100000.0, "bytes per second", "byte/s")


@fault(_junk(11520.0), name="flood", text="random bytes at the full rate of the serial link")
@fault(_junk(20.0))
class _Junk(_Insert):
    """Random bytes are inserted."""

    rate: float

    def _inserted(self) -> Tuple[float, bytes]:
        pause_s = max(_FLOOD_STEP_S, 1 / self.rate)
        return pause_s, bytes(self.rng.randrange(256) for _ in range(round(self.rate * pause_s)))


@fault(
    Key("period", 1.0, 0.001, 3600.0, "time between lines", "s"),
    Key("text", _TEXT, None, 0.0, "the text, without commas"),
)
class _Text(_Insert):
    """Lines of text are inserted, as 2013 boards send them."""

    period: float
    text: str

    def _inserted(self) -> Tuple[float, bytes]:
        return self.period, self.text.encode("utf-8") + b"\r\n"


@fault(Key("rate", 57600, 300, 1000000, "rate of the host's port", "Bd"))
class _Baud(LineFault):
    """The host's port has another baud rate than the board.

    Bytes are sent at 115200 baud, and the receiver samples where it expects the bits.

    The line is idle before each piece.
    """

    rate: float

    def pieces(self, data: bytes, now_s: float) -> _Pieces:
        line = [level for byte in data for level in (0, *(byte >> i & 1 for i in range(8)), 1)]
        out, at, bits = bytearray(), 0.0, BAUD / self.rate
        while True:
            at = next((i for i in range(math.ceil(at), len(line)) if not line[i]), len(line))
            if at >= len(line):
                break
            out.append(sum(_level(line, at + (i + 1.5) * bits) << i for i in range(8)))
            at += 9.5 * bits
        yield now_s, bytes(out)


def _level(line: List[int], at: float) -> int:
    return line[int(at)] if at < len(line) else 1
