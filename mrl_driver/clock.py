"""Board time to host time.

A frame arrives later than it was stamped, by a delay that varies (USB polls every 1 to 16 ms, the host's scheduler)
but never falls below a least value.  Plotted over board time, the arrivals lie above a straight line: its slope is
the drift of the board's resonator against the host's clock, its height is offset plus least delay.  The line is the
edge, below the middle of the window, of the points' lower convex hull (Moon, Skelly and Towsley, "Estimation and
removal of clock skew from network delay measurements", INFOCOM 1999).
"""

from typing import List, NamedTuple, Optional, Tuple

from .table import TICK_S

MAX_DRIFT = 0.01
"""Largest drift believed [s/s]; the Uno's ceramic resonator is good to 0.5 %."""
_BUCKET_S = 0.25
_BUCKETS, _SPARE = 80, 20
"""The window is 20 s; it grows by a quarter before its oldest part is dropped at once, which costs a new hull."""
_LEAST_SPAN_S = 1.0

_Point = Tuple[float, float]


class HostTime(NamedTuple):
    """When a frame was stamped, in host time [s], and how long it took to arrive beyond the least delay [s]."""

    stamp_s: float
    latency_s: float


class BoardClock:
    """Estimates offset and drift of one board's clock from its stamped frames.

    Host times are seconds of any clock that never jumps (`time.monotonic`).  Estimates rest on the last 20 to 25 s.
    """

    def __init__(self) -> None:
        self._ticks: Optional[int] = None
        self._time = 0
        self._arrival_s = 0.0
        self._stamp_s = float("-inf")
        self._lows: List[_Point] = []
        self._hull: List[_Point] = []
        self._bucket_end_s = 0.0
        self._line: _Point = (0.0, 0.0)
        self.drift = 0.0

    def board_s(self) -> float:
        """Board time of the newest frame since the first one [s], wraps undone."""
        return (self._ticks or 0) * TICK_S

    def update(self, time: int, arrival_s: float, next_one: bool = False) -> HostTime:
        """Host time of a frame with board time `time` [64 us, int16] that arrived at `arrival_s`.

        Frames of one board in order.  A gap may be as long as the host's clock tells it to within 2 s.  Stamps are
        strictly increasing.  `next_one`: the frame follows the one before within one wrap of the board's time, however
        late it arrives.
        """
        self._unwrap(time, arrival_s, next_one)
        board_s = self.board_s()
        self._collect((board_s, arrival_s - board_s))
        at, offset = self._line
        estimate = board_s + offset + self.drift * (board_s - at)
        self._stamp_s = max(min(estimate, arrival_s), self._stamp_s + 1e-6)
        return HostTime(self._stamp_s, max(0.0, arrival_s - estimate))

    def _unwrap(self, time: int, arrival_s: float, next_one: bool) -> None:
        if self._ticks is None:
            self._ticks = 0
        else:
            expected = round((arrival_s - self._arrival_s) / TICK_S)
            step = (time - self._time) & 0xFFFF
            self._ticks += step if next_one else step + max(0, (expected - step + 0x8000) >> 16 << 16)
        self._time = time
        self._arrival_s = arrival_s

    def _collect(self, point: _Point) -> None:
        """Keeps the lowest point of each bucket; a new low, or a full bucket, moves the line."""
        board_s, offset = point
        at, height = self._line
        if not self._lows or board_s >= self._bucket_end_s:
            self._lows.append(point)
            self._bucket_end_s = board_s + _BUCKET_S
            self._shorten()
            _append(self._hull, point)
            self._fit()
        elif offset - self.drift * board_s < self._lows[-1][1] - self.drift * self._lows[-1][0]:
            self._lows[-1] = point
            self._hull.pop()
            _append(self._hull, point)
            if offset < height + self.drift * (board_s - at):
                self._fit()

    def _shorten(self) -> None:
        """Drops what is older than the window, and rebuilds the hull of all but the newest point."""
        if len(self._lows) > _BUCKETS + _SPARE:
            del self._lows[:-_BUCKETS]
            self._hull.clear()
            for low in self._lows[:-1]:
                _append(self._hull, low)

    def _fit(self) -> None:
        hull = self._hull
        middle = (self._lows[0][0] + self._lows[-1][0]) / 2
        for (x0, y0), (x1, y1) in zip(hull, hull[1:]):
            if x1 >= middle and x1 - x0 >= _LEAST_SPAN_S:
                self.drift = min(MAX_DRIFT, max(-MAX_DRIFT, (y1 - y0) / (x1 - x0)))
                break
        self._line = min(hull, key=lambda p: p[1] - self.drift * p[0])


def _append(hull: List[_Point], point: _Point) -> None:
    """One more point, right of all others, for a lower convex hull."""
    while len(hull) > 1 and _turn(hull[-2], hull[-1], point) <= 0:
        hull.pop()
    hull.append(point)


def _turn(a: _Point, b: _Point, c: _Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
