"""When faults of a line are on, and one behind the other: pure, times do not decrease."""

import math
from typing import List, Protocol, Tuple


class Window:
    """When a fault is on: for `lasts` seconds from `at` on, and again every `every` seconds (0: once)."""

    def __init__(self, at: float = 0.0, lasts: float = math.inf, every: float = 0.0) -> None:
        self._start_s, self._lasts_s, self._every_s = at, lasts, every

    def on(self, now_s: float) -> bool:
        """Whether it is on; ask with times that do not decrease."""
        while self._every_s and now_s >= self._start_s + min(self._lasts_s, self._every_s):
            self._start_s += self._every_s
        return self._start_s <= now_s < self._start_s + self._lasts_s

    def next_s(self, now_s: float) -> float:
        """When it is switched next [s], later than `now_s`; may be infinite."""
        if self.on(now_s):
            return self._start_s + min(self._lasts_s, self._every_s or math.inf)
        return self._start_s if now_s < self._start_s else math.inf


class LineFault(Protocol):
    """One fault on one direction of the line."""

    @property
    def next_s(self) -> float:
        """When it has something to let out by itself [s]; may be infinite."""

    def run(self, data: bytes, now_s: float) -> bytes:
        """What comes out at `now_s` when `data` goes in; nothing may go in as well."""

    def empty(self) -> bytes:
        """What it still holds; it holds nothing from then on."""


class Chain:
    """Faults of one direction, one behind the other, each in its window."""

    def __init__(self) -> None:
        self._links: List[Tuple[LineFault, Window]] = []

    def add(self, fault: LineFault, window: Window) -> None:
        """One more fault, nearest to the receiver."""
        self._links.append((fault, window))

    def clear(self) -> None:
        """No fault any more; what they hold is lost."""
        self._links.clear()

    def run(self, data: bytes, now_s: float) -> bytes:
        """What comes out of the last one at `now_s`."""
        for fault, window in self._links:
            data = fault.run(data, now_s) if window.on(now_s) else fault.empty() + data
        return data

    def empty(self) -> None:
        """What is on the way is lost."""
        for fault, _ in self._links:
            fault.empty()

    def next_s(self, now_s: float) -> float:
        """When something happens by itself, after `now_s` [s]."""
        times = [math.inf]
        for fault, window in self._links:
            times.append(window.next_s(now_s))
            if window.on(now_s) and fault.next_s > now_s:
                times.append(fault.next_s)
        return min(times)
