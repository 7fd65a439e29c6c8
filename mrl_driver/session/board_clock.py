"""Board time to host time.

A frame arrives later than it was stamped, by a delay that varies (USB polls every 1 to 16 ms, the host's scheduler)
but never falls below a least value.  Plotted over board time, the arrivals lie above a straight line: its slope is
the drift of the board's resonator against the host's clock, its height is offset plus least delay.  The line is the
edge, below the middle of the window, of the points' lower convex hull (Moon, Skelly and Towsley, "Estimation and
removal of clock skew from network delay measurements", INFOCOM 1999).
"""

from typing import List, NamedTuple, Optional, Tuple

from mrl_driver.protocol.table import TICK_S

MAX_DRIFT = 0.01
"""Largest drift believed [s/s]; the Uno's ceramic resonator is good to 0.5 %."""
_BUCKET_S = 0.25
_BUCKETS, _SPARE = 80, 20
"""The window is 20 s; it grows by a quarter before its oldest part is dropped at once, which costs a new hull."""
_LEAST_SPAN_S = 1.0

_Point = Tuple[float, float]


class HostTime(NamedTuple):
    """When a frame was stamped."""

    stamp_s: float
    """Host time [s]."""
    board_s: float
    """Board time since the first frame [s], wraps undone."""
    latency_s: float
    """How long the frame took to arrive beyond the least delay."""


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
        self._low = 0.0
        self.drift = 0.0

    def update(self, time: int, arrival_s: float, next_one: bool = False) -> HostTime:
        """Host time of a frame with board time `time` [64 us, int16] that arrived at `arrival_s`.

        Frames of one board in order.  A gap may be as long as the host's clock, its drift undone, tells it to within
        2 s.  Stamps are strictly increasing.  `next_one`: the frame follows the one before within one wrap of the
        board's time, however late it arrives.
        """
        if self._ticks is None:
            self._ticks = 0
        else:
            step = (time - self._time) & 0xFFFF
            self._ticks += step if next_one else step + self._wraps(step, arrival_s)
        self._time, self._arrival_s = time, arrival_s
        board_s = self._ticks * TICK_S
        offset = arrival_s - board_s
        if board_s >= self._bucket_end_s or offset - self.drift * board_s < self._low:
            self._collect((board_s, offset))
        at, height = self._line
        estimate = board_s + height + self.drift * (board_s - at)
        stamp_s = estimate if estimate < arrival_s else arrival_s
        if stamp_s < self._stamp_s + 1e-6:
            stamp_s = self._stamp_s + 1e-6
        self._stamp_s = stamp_s
        latency_s = arrival_s - estimate
        return _new(HostTime, (stamp_s, board_s, latency_s if latency_s > 0.0 else 0.0))

    def _wraps(self, step: int, arrival_s: float) -> int:
        """Ticks of the whole wraps that the host's clock says have passed besides `step`."""
        expected = round((arrival_s - self._arrival_s) / (1.0 + self.drift) / TICK_S)
        return max(0, (expected - step + 0x8000) >> 16 << 16)

    def _collect(self, point: _Point) -> None:
        """Takes the first point of a bucket, or one lower than all others of its own, which moves the line."""
        if point[0] >= self._bucket_end_s:
            self._bucket_end_s = point[0] + _BUCKET_S
            self._lows.append(point)
            self._shorten()
            fits = False
        else:
            self._lows[-1] = point
            self._hull.pop()
            fits = point[1] >= self._line[1] + self.drift * (point[0] - self._line[0])
        _append(self._hull, point)
        if not fits:
            self._fit()
        self._low = point[1] - self.drift * point[0]

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
        drift = self.drift
        self._line = min([(y - drift * x, x, y) for x, y in hull])[1:]


def _append(hull: List[_Point], point: _Point) -> None:
    """One more point, right of all others, for a lower convex hull."""
    while len(hull) > 1 and _turn(hull[-2], hull[-1], point) <= 0:
        hull.pop()
    hull.append(point)


def _turn(a: _Point, b: _Point, c: _Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


_new = tuple.__new__
