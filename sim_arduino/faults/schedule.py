"""Time windows of faults, and faults on a line, one after the other.  Pure; times must not decrease."""

import heapq
import math
import random
from typing import Any, Iterable, List, Tuple


class Window:
    """The time for which a fault is on: from `at` for `lasts` seconds, and again every `every` seconds (0: once)."""

    def __init__(self, at: float = 0.0, lasts: float = math.inf, every: float = 0.0) -> None:
        self._start_s, self._lasts_s, self._every_s = at, lasts, every

    def on(self, now_s: float) -> bool:
        """Whether the fault is on; successive times must not decrease."""
        while self._every_s and now_s >= self._start_s + min(self._lasts_s, self._every_s):
            self._start_s += self._every_s
        return self._start_s <= now_s < self._start_s + self._lasts_s

    def next_s(self, now_s: float) -> float:
        """Time of the next switch [s], later than `now_s`; may be infinite."""
        if self.on(now_s):
            return self._start_s + min(self._lasts_s, self._every_s or math.inf)
        return self._start_s if now_s < self._start_s else math.inf


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

    def pieces(self, data: bytes, now_s: float) -> Iterable[Tuple[float, bytes]]:
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


class Chain:
    """The faults of one direction, one after the other, each in its window."""

    def __init__(self) -> None:
        self._links: List[Tuple[LineFault, Window]] = []

    def add(self, fault: LineFault, window: Window) -> None:
        """Adds a fault at the receiver's end."""
        self._links.append((fault, window))

    def clear(self) -> None:
        """Removes all faults; the bytes they hold are lost."""
        self._links.clear()

    def run(self, data: bytes, now_s: float) -> bytes:
        """The bytes that come out of the last fault at `now_s`."""
        for fault, window in self._links:
            data = fault.run(data, now_s) if window.on(now_s) else fault.empty() + data
        return data

    def empty(self) -> None:
        """Drops the bytes that the faults hold."""
        for fault, _ in self._links:
            fault.empty()

    def next_s(self, now_s: float) -> float:
        """Time of the next event after `now_s` [s]."""
        times = [math.inf]
        for fault, window in self._links:
            times.append(window.next_s(now_s))
            if window.on(now_s) and fault.next_s > now_s:
                times.append(fault.next_s)
        return min(times)
