"""Faults of a network with datagrams, which hit whole frames in one direction.  Pure; seeded; the caller passes time.

A frame ends with its `e`; bytes between frames belong to the next frame.
"""

import heapq
import math
import random
from typing import Iterator, List, Tuple

_LONGEST = 256


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
        """The frames that come out."""
        return b"".join([self._turn(part, now_s) for part in self._whole(data)])

    def _turn(self, part: bytes, now_s: float) -> bytes:
        raise NotImplementedError

    def empty(self) -> bytes:
        """Returns and drops the incomplete frame."""
        begun, self._begun = self._begun, b""
        return begun


class Drop(_Frames):
    """Loses whole frames."""

    def _turn(self, part: bytes, now_s: float) -> bytes:
        return b"" if self._hit(part) else part


class Repeat(_Frames):
    """Repeats frames."""

    def _turn(self, part: bytes, now_s: float) -> bytes:
        return part + part[part.rfind(b"@") :] if self._hit(part) else part


class Overtake(_Frames):
    """Delays frames by up to `delay` [s], so that later frames overtake them."""

    def __init__(self, rng: random.Random, rate: float, delay: float) -> None:
        super().__init__(rng, rate)
        self._delay_s = delay
        self._held: List[Tuple[float, int, bytes]] = []
        self._count = 0

    @property
    def next_s(self) -> float:  # type: ignore[override]
        """Time at which the first delayed frame comes out [s]."""
        return self._held[0][0] if self._held else math.inf

    def run(self, data: bytes, now_s: float) -> bytes:
        """The frames that come out, and the delayed frames that are due."""
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
        """Returns and drops the delayed frames and the incomplete one."""
        held, self._held = sorted(self._held), []
        return b"".join([part for _, _, part in held]) + super().empty()
