"""The board's encoder inputs: edges to counts, as the interrupts of hal_bridge_avr.cpp."""

from itertools import zip_longest
from typing import Dict, Iterable, Mapping, Tuple

from mrl_driver.protocol.table import NOT_CONNECTED, TICK_S
from mrl_driver.robot.chips import ATMEGA328P, Chip
from sim_arduino.hardware.encoders import PULLED_UP, PinEdge

SAMPLE_TICKS = 78  # time between two samples [64 us]: 4.992 ms, 200.3 Hz
MOST_EDGES = 250  # this many edges between two samples mask an encoder's interrupt
READ_S, INTERRUPT_S = 1.0e-6, 4.2e-6
"""Time from an edge until the interrupt reads the pins, and until it ends [s]: 16 and 67 cycles of the chip.  Edges
that come meanwhile are seen together."""
_PLACES: Dict[Tuple[int, ...], int] = {(0, 0): 0, (1, 0): 1, (1, 1): 2, (0, 1): 3}
"""Order of the levels of A and B when the encoder turns forward."""
_IMPOSSIBLE = 6  # both channels have changed
_STEPS = (0, 1, _IMPOSSIBLE, -1)  # by the places that the encoder has passed
_MASK_16 = 0xFFFF


class EncoderInput:
    """One encoder of a board on its pins A and B (Arduino numbers), of whose levels it goes on; -1: not connected.

    A pin B that does not interrupt gives the direction of the edges of A, each of which counts two.
    """

    def __init__(self, pins: Tuple[int, ...], levels: Mapping[int, int], chip: Chip = ATMEGA328P) -> None:
        self.pins = pins
        self.single_channel = pins[1] == NOT_CONNECTED  # only edges of channel A count, each one up
        self._directed = not self.single_channel and not chip.pins[pins[1]].interrupts
        self.count = 0  # wraps at 16 bits
        self.edge_tick = 0  # time of the last edge that counted [64 us]; wraps at 16 bits
        self.impossible = 0  # number of steps that changed both channels at once
        self._edges_left = MOST_EDGES
        self._free_s = 0.0  # the last interrupt has ended [s]
        self.unmask(levels)

    def unmask(self, levels: Mapping[int, int]) -> None:
        """Goes on from the present levels of the pins."""
        self._levels = [levels.get(pin, PULLED_UP) for pin in self.pins]
        self._seen = tuple(self._levels)
        self.masked = False  # had too many edges between two samples, and does not count

    def sampled(self) -> None:
        """The time between two samples has ended: there may be as many edges again."""
        self._edges_left = MOST_EDGES

    def take(self, edges: Iterable[PinEdge], start_s: float) -> None:
        """Handles its own edges of these, in order of time; tick 0 of the board's clock was at `start_s`."""
        own = [edge for edge in edges if edge.pin in self.pins]
        enabled = self.pins[:1] if self.single_channel or self._directed else self.pins
        waiting = False
        for edge, following in zip_longest(own, own[1:]):
            self._levels[self.pins.index(edge.pin)] = edge.level
            waiting = waiting or edge.pin in enabled
            entry_s = max(edge.time_s, self._free_s)
            if waiting and not (following and following.time_s < entry_s + READ_S):
                waiting = False
                self._free_s = entry_s + INTERRUPT_S
                self._interrupt(int((entry_s - start_s) / TICK_S) & _MASK_16)

    def _interrupt(self, tick: int) -> None:
        before, self._seen = self._seen, tuple(self._levels)
        if self.masked:
            return
        self._edges_left -= 1
        self.masked = self._edges_left == 0
        if self.single_channel:
            step = int(before[0] != self._seen[0])
        elif self._directed:
            forward = self._seen[0] != self._seen[1]
            step = (2 if forward else -2) if before[0] != self._seen[0] else 0
        else:
            step = _STEPS[(_PLACES[self._seen] - _PLACES[before]) & 3]
        if step == _IMPOSSIBLE:
            self.impossible += 1
        elif step:
            self.count = (self.count + step) & _MASK_16
            self.edge_tick = tick
