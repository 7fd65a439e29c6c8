"""The speed of a wheel out of its encoder's counts and the times of their last edges."""

from typing import List, NamedTuple

from mrl_driver.protocol.frames import to_int16

from .integers import INT16_MAX, uint16
from .wheel_settings import PERIOD_TICKS, WheelSettings

CYCLE = 4  # edges of both channels in a cycle; they are not evenly spaced
LEAST_TICKS = 120
MOST_COUNTS = 400
STANDING = 200  # samples without a change after which the wheel stands
MARKS = 5


class Mark(NamedTuple):
    """Counter and time [64 us] of its last edge, or of a sample without one."""

    counter: int
    tick: int


class SpeedEstimate:
    """Counts by time between the last edges of two samples, which are at least a cycle apart."""

    def __init__(self) -> None:
        self.speed = 0  # signed share of full speed
        self._marks: List[Mark] = []
        self._quiet = 0
        self._counts, self._ticks = 0, 1
        self._backward = False

    def update(self, settings: WheelSettings, count: int, edge_tick: int, tick: int) -> None:
        """Takes a sample: the counter, the tick of its last edge, the tick of the sample (uint16)."""
        if not self._marks:
            self._rest(count, tick)
        elif count == self._marks[0].counter:
            self._quiet = min(STANDING, self._quiet + 1)
            if self._quiet == STANDING:
                self._rest(count, tick)
            else:
                self._fade(settings, uint16(tick - self._marks[0].tick))
        else:
            self._quiet = 0
            self._marks = [Mark(count, edge_tick), *self._marks[: MARKS - 1]]
            self._measure(settings)

    def _rest(self, count: int, tick: int) -> None:
        self._marks = [Mark(count, tick)]
        self._quiet = STANDING
        self._counts = self.speed = 0

    def _measure(self, settings: WheelSettings) -> None:
        newest, counts = self._marks[0], 0
        for mark in self._marks[1:]:
            counts = to_int16(newest.counter - mark.counter)
            self._ticks = uint16(newest.tick - mark.tick)
            if abs(counts) >= CYCLE and self._ticks >= LEAST_TICKS:
                break
        self._backward = counts < 0
        self._counts = min(MOST_COUNTS, abs(counts))
        self._ticks = max(PERIOD_TICKS, self._ticks)
        self._set_speed(settings.share_per_count_tick * self._counts // self._ticks)

    def _fade(self, settings: WheelSettings, waited: int) -> None:
        """Without an edge for 1.5 times as long as expected, the wheel is slower than it was."""
        if 2 * waited * self._counts > 3 * self._ticks:
            self._set_speed(settings.share_per_count_tick * 3 // 2 // waited)

    def _set_speed(self, magnitude: int) -> None:
        most = min(INT16_MAX, magnitude)
        self.speed = -most if self._backward else most
