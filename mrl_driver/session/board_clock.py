"""Conversion of board time to host time.

A frame arrives later than its stamp.  The delay varies (USB polls every 1 to 16 ms, the host's scheduler), but it has a
minimum.  Plotted over board time, the arrivals lie above a straight line.  The slope of the line is the drift of the
board's resonator against the host's clock; its height is the offset plus the minimum delay.  The line is the edge of
the points' lower convex hull at the middle of the window (Moon, Skelly and Towsley, "Estimation and removal of clock
skew from network delay measurements", INFOCOM 1999).
"""

from typing import List, Optional, Tuple

from mrl_driver.protocol.table import TICK_S

MAX_DRIFT = 0.01  # largest drift accepted [s/s]; the Uno's ceramic resonator is accurate to 0.5 %
_BUCKET_S = 0.25
_BUCKETS, _SPARE = 80, 20
"""The window is 80 buckets (20 s).  It may grow by a quarter before its oldest part is dropped and the hull rebuilt."""
_LEAST_SPAN_S = 1.0
_STEEP = 0.1  # an edge that rises by more leads to frames that waited, and is not drift [s/s]
_EARLIER = 0xF000
"""A larger step of the lower 16 bits, between frames of two streams, is one back by less than 0.26 s [64 us]."""

_Point = Tuple[float, float]


class BoardClock:
    """Estimates the offset and drift of one board's clock from its stamped frames.

    Host times are seconds of any clock that never jumps (`time.monotonic`).  The estimate uses the last 20 to 25 s.

    Attributes:
        board_s: board time of the last frame since the first one [s], without wraps.
        latency_s: delay of the last frame beyond the minimum delay [s].
    """

    def __init__(self) -> None:
        self._ticks: Optional[int] = None
        self._time = 0
        self._mixed = False  # the last frame belongs to the other stream
        self._stamp_s = float("-inf")
        self._lows: List[_Point] = []
        self._hull: List[_Point] = []
        self._bucket_end_s = float("-inf")
        self._line: _Point = (0.0, 0.0)
        self._low = 0.0
        self.drift = self.board_s = self.latency_s = 0.0

    def update(self, time: int, arrival_s: float, next_one: bool = False) -> float:
        """Return the host time of a frame with board time `time` [64 us, int16] that arrived at `arrival_s`.

        Give it the frames of one board in order.  The host's clock counts the wraps of board time in a gap, so it must
        be exact to 2 s over the gap after the drift is corrected.  Stamps are strictly increasing.  `next_one` says
        that this frame follows the previous one within one wrap of board time, even if it arrives late.
        """
        if self._ticks is None:
            self._ticks = 0
        else:
            step = (time - self._time) & 0xFFFF
            if self._mixed:
                self._mixed = False
                step = step - 0x10000 if step > _EARLIER else step
            self._ticks += step
            if not next_one:
                self.count_wraps(arrival_s)
        self._time = time
        self.board_s = board_s = self._ticks * TICK_S
        offset = arrival_s - board_s
        if board_s >= self._bucket_end_s or offset - self.drift * board_s < self._low:
            self._collect((board_s, offset))
        at, height = self._line
        estimate = board_s + height + self.drift * (board_s - at)
        stamp_s = estimate if estimate < arrival_s else arrival_s
        if stamp_s < self._stamp_s + 1e-6:
            stamp_s = self._stamp_s + 1e-6
        self._stamp_s = stamp_s
        self.latency_s = arrival_s - estimate if arrival_s > estimate else 0.0
        return stamp_s

    def beside(self, time: int, arrival_s: float, next_one: bool = False) -> Tuple[float, float]:
        """Return the board time since the first frame [s] and the host time [s] of a frame of another stream.

        Its stamp may be a little earlier than that of the frame before it, because one of them waited for the other on
        the board.  The fit of the two clocks does not use it.  `next_one` is as for `update`.
        """
        if self._ticks is None:
            self._ticks, self._time = 0, time
        step = (time - self._time) & 0xFFFF
        if step > _EARLIER and not self._mixed:
            step -= 0x10000
        self._ticks += step
        if not next_one:
            self.count_wraps(arrival_s)
        self._time, self._mixed = time, True
        board_s = self._ticks * TICK_S
        return board_s, min(arrival_s, self._estimate(board_s)) if self._hull else arrival_s

    def count_wraps(self, arrival_s: float) -> None:
        """The last frame arrived at `arrival_s` [s] without waiting: count the whole wraps in its delay.

        The frame before it may have waited for this program, so the time between the two arrivals does not matter.
        """
        if self._ticks is not None and self._hull:
            delay_s = arrival_s - self._estimate(self._ticks * TICK_S)
            self._ticks += max(0, (round(delay_s / (1.0 + self.drift) / TICK_S) + 0x8000) >> 16 << 16)

    def _estimate(self, board_s: float) -> float:
        at, height = self._line
        return board_s + height + self.drift * (board_s - at)

    def _collect(self, point: _Point) -> None:
        """Add the first point of a bucket, or replace its point with a lower one; fit the line again if needed."""
        if point[0] >= self._bucket_end_s:
            self._bucket_end_s = point[0] + _BUCKET_S
            self._lows.append(point)
            if len(self._lows) > _BUCKETS + _SPARE:  # drop what is older than the window
                del self._lows[:-_BUCKETS]
                self._hull.clear()
                for low in self._lows[:-1]:
                    _append(self._hull, low)
            fits = False
        else:
            self._lows[-1] = point
            self._hull.pop()
            fits = point[1] >= self._line[1] + self.drift * (point[0] - self._line[0])
        _append(self._hull, point)
        if not fits:
            self._fit()
        self._low = point[1] - self.drift * point[0]

    def _fit(self) -> None:
        hull, first_s = self._hull, self._lows[0][0]
        middle = (first_s + self._lows[-1][0]) / 2
        for (x0, y0), (x1, y1) in zip(hull, hull[1:]):
            slope = (y1 - y0) / (x1 - x0)
            if x1 >= middle and x1 - x0 >= _LEAST_SPAN_S and slope < _STEEP:
                self.drift = min(MAX_DRIFT, max(-MAX_DRIFT, slope))
                if slope >= -MAX_DRIFT:
                    break
                first_s = x1  # frames waited before that, or the host's clock stood still: the computer was suspended
        if first_s > self._lows[0][0]:
            self._lows = [low for low in self._lows if low[0] >= first_s]
            hull[:] = [low for low in hull if low[0] >= first_s]
        drift = self.drift
        self._line = min([(y - drift * x, x, y) for x, y in hull])[1:]


def _append(hull: List[_Point], point: _Point) -> None:
    """Add a point to a lower convex hull; the point must lie to the right of all others."""
    while len(hull) > 1:
        (x0, y0), (x1, y1) = hull[-2:]
        if (x1 - x0) * (point[1] - y0) > (y1 - y0) * (point[0] - x0):  # the last point is below the line
            break
        hull.pop()
    hull.append(point)
