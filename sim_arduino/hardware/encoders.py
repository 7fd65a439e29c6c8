"""An encoder on a motor: the edges of its two channels at their true times, faults of its wires, and its counter.

Forward, channel A leads channel B by one count.  Position 0 lies in the middle of the count in which both are low: the
n-th edge forward comes n - 0.5 counts from the start.
"""

import math
from typing import List, NamedTuple, Sequence, Tuple

from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.table import NOT_CONNECTED

from .dc_motor import Motion

A, B = 0, 1
PULLED_UP = 1  # level of a wire with nothing on it: the board's pull-up


class PinEdge(NamedTuple):
    """A change of an encoder's pin, or of another input: time [s], Arduino pin, new level."""

    time_s: float
    pin: int
    level: int


class Bounce(NamedTuple):
    """Each edge of the encoder is followed by `pulses` short pulses, each edge `spacing_s` after the one before [s]."""

    pulses: int
    spacing_s: float


class Wire:
    """A wire of an encoder to a pin of the board: what the board sees of the encoder's output."""

    def __init__(self, pin: int, level: int = 0) -> None:
        self.pin = pin
        self.level = level  # level at the board
        self.open = False  # the wire is broken, so that the board sees its own pull-up
        self.oscillation_hz = 0.0  # edges per second that a broken wire picks up; 0 for none
        self.next_s = math.inf  # time of the next of these edges [s]
        self._bounces: List[float] = []

    def follow(
        self, start_s: float, end_s: float, source: int, toggles: Sequence[float], bounce: Bounce
    ) -> List[PinEdge]:
        """Edges from `start_s` to `end_s` of a wire to a source that toggles at these times; none without a pin.

        `source` is the source's level before its first toggle.
        """
        if self.pin == NOT_CONNECTED:
            return []
        if self.open or self._bounces or bounce.pulses or self.level != source:
            toggles = self._seen(start_s, end_s, source, toggles, bounce)
        edges = []
        for time_s in toggles:
            self.level ^= 1
            edges.append(PinEdge(time_s, self.pin, self.level))
        return edges

    def _seen(
        self, start_s: float, end_s: float, source: int, toggles: Sequence[float], bounce: Bounce
    ) -> List[float]:
        if self.open:
            self._bounces.clear()
            expected = self.level if self.oscillation_hz else PULLED_UP
            jump = [start_s] if self.level != expected else []
            return jump + self._oscillation(start_s, end_s)
        waiting = [time_s for time_s in self._bounces if time_s < end_s]
        later = [time_s for time_s in self._bounces if time_s >= end_s]
        expected = source ^ (len(self._bounces) & 1)
        jump = [start_s] if self.level != expected else []
        for edge_s in toggles:
            extra = [edge_s + bounce.spacing_s * n for n in range(1, 2 * bounce.pulses + 1)]
            waiting += [edge_s, *(time_s for time_s in extra if time_s < end_s)]
            later += [time_s for time_s in extra if time_s >= end_s]
        self._bounces = later
        return sorted(jump + waiting)

    def _oscillation(self, start_s: float, end_s: float) -> List[float]:
        if not self.oscillation_hz:
            return []
        period_s = 1.0 / self.oscillation_hz
        if self.next_s == math.inf:
            self.next_s = start_s + period_s
        count = max(0, math.ceil((end_s - self.next_s) / period_s))
        times = [self.next_s + n * period_s for n in range(count)]
        self.next_s += count * period_s
        return times


class Quadrature:
    """An encoder and its two wires to the board.

    Args:
        pins: Where the channels A and B are connected, Arduino numbers.
        phase_error: Delay of channel B's edges, as a share of a count; -0.5 to 0.5.
        single: Only channel A is connected, and a count is the way from one of its edges to the next.
        reversed_: The channels are swapped where the encoder is made, so that the other direction counts as forward.
    """

    def __init__(
        self,
        pins: Sequence[int] = (A, B),
        phase_error: float = 0.0,
        single: bool = False,
        reversed_: bool = False,
    ) -> None:
        self._sign = -1 if reversed_ else 1
        self._first = (0.5, 1.5 + phase_error)
        self._apart = 1.0 if single else 2.0
        self._passed = [self._count(channel, 0.0) for channel in (A, B)]
        self.swapped = False  # the wires have been swapped
        self.bounce = Bounce(0, 0.0)  # short pulses after each edge
        self.wires = tuple(Wire(pin, passed & 1) for pin, passed in zip(pins, self._passed))
        """The wires on the board's inputs A and B."""
        self._single = single
        if single:
            self.wires[B].open, self.wires[B].level = True, PULLED_UP

    def open(self, channel: int, is_open: bool, oscillation_hz: float = 0.0) -> None:
        """Breaks or mends a wire; the board sees its pull-up, or this many edges per second [1/s]."""
        wire = self.wires[channel]
        wire.open = is_open or (self._single and channel == B)
        wire.oscillation_hz = oscillation_hz if is_open else 0.0
        if not wire.oscillation_hz:
            wire.next_s = math.inf

    def _count(self, channel: int, position: float) -> int:
        """Number of this channel's edges between the start and a position [count]."""
        return math.floor((position - self._first[channel]) / self._apart) + 1

    def follow(self, start_s: float, end_s: float, motions: Sequence[Motion]) -> List[PinEdge]:
        """Edges at the board from `start_s` to `end_s` [s], in order of time; `motions` begin after `start_s`."""
        before = tuple(self._passed)
        toggles: Tuple[List[float], List[float]] = ([], [])
        for motion in motions:
            end = self._sign * motion.after(motion.duration_s)[0]
            for channel, old in enumerate(tuple(self._passed)):
                new = self._passed[channel] = self._count(channel, end)
                if new != old:
                    toggles[channel].extend(self._times(motion, channel, old, new, start_s))
        edges: List[PinEdge] = []
        for channel, wire in enumerate(self.wires):
            source = channel ^ int(self.swapped)
            edges += wire.follow(start_s, end_s, before[source] & 1, toggles[source], self.bounce)
        return sorted(edges)

    def _times(self, motion: Motion, channel: int, old: int, new: int, start_s: float) -> List[float]:
        """Times at which the channel's edges `old` to `new` pass during a motion [s]."""
        passed = range(old, new) if new > old else range(old - 1, new - 1, -1)
        first = self._first[channel]
        return [
            start_s + motion.start_s + motion.time_at(self._sign * (first + self._apart * index))
            for index in passed
        ]


class EncoderCounter:
    """A 16-bit counter: a wheel's counts from a preset value on, divided by its prescaler.

    `travel` is the sum of all counts of the wheel; `prescale` of them make a step of the counter.
    """

    def __init__(self) -> None:
        self._count = self._travel = 0
        self.prescale = 1

    def read(self, travel: int) -> int:
        """The counter (int16)."""
        return to_int16(self._count + (travel - self._travel) // self.prescale)

    def preset(self, count: int, travel: int) -> None:
        """The counter is `count` from now on."""
        self._count, self._travel = count, travel

    def set_prescaler(self, power: int, travel: int) -> None:
        """A step of the counter takes 10^power counts; the counter stays."""
        self.preset(self.read(travel), travel)
        self.prescale = 10**power

    def travel_at(self, count: int, travel: int) -> int:
        """The travel at which the counter is `count`, the shorter way round."""
        return travel + to_int16(count - self.read(travel)) * self.prescale
