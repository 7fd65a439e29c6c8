"""The board's encoder inputs: edges to counts and samples, as the interrupts of hal_bridge_avr.cpp."""

from itertools import zip_longest
from typing import Dict, Iterable, Mapping, NamedTuple, Sequence, Tuple

from mrl_driver.protocol.table import TICK_S
from sim_arduino.hardware.bridge_plant import ENCODER_PINS, PinEdge

SAMPLE_TICKS = 78  # time between two samples [64 us]: 4.992 ms, 200.3 Hz
MOST_EDGES = 250  # this many edges between two samples mask an encoder's interrupt
MOST_IMPOSSIBLE = 65535
READ_S, INTERRUPT_S = 1.0e-6, 4.2e-6
"""Time from an edge until the interrupt reads the pins, and until it ends [s]: 16 and 67 cycles of the chip.  Edges
that come meanwhile are seen together."""
_PLACES: Dict[Tuple[int, ...], int] = {(0, 0): 0, (1, 0): 1, (1, 1): 2, (0, 1): 3}
"""Order of the levels of A and B when the encoder turns forward."""
_SKIPPED = 2
_MASK_16 = 0xFFFF


class EncoderSample(NamedTuple):
    """What the sampling interrupt has latched.  Counts and ticks wrap at 16 bits."""

    counts: Tuple[int, int]
    edge_ticks: Tuple[int, int]  # times of the last edges that counted [64 us]
    tick: int  # time of the sample [64 us]


class _Input:
    """One encoder."""

    def __init__(self, pins: Tuple[int, int], levels: Mapping[int, int]) -> None:
        self.pins = pins
        self.count = self.edge_tick = 0
        self.edges_left = MOST_EDGES
        self.masked = False
        self.free_s = 0.0  # the last interrupt has ended [s]
        self.look(levels)

    def look(self, levels: Mapping[int, int]) -> None:
        """Goes on from the present state of the pins."""
        self.levels = [levels[pin] for pin in self.pins]
        self.seen = tuple(self.levels)


class EncoderInputs:
    """Both encoders of a board, 0 on the left pins, 1 on the right; `levels` are those of pins (Arduino numbers)."""

    def __init__(self, levels: Mapping[int, int]) -> None:
        self.single_channel = False  # only edges of channel A count, each one up
        self.impossible = 0  # number of steps that changed both channels at once; stops at 65535
        self._inputs = [_Input(pins, levels) for pins in ENCODER_PINS]

    def take(self, edges: Iterable[PinEdge], start_s: float) -> None:
        """Handles edges in order of time; tick 0 of the board's clock was at `start_s`."""
        found = list(edges)
        for encoder in self._inputs:
            self._take(encoder, [edge for edge in found if edge.pin in encoder.pins], start_s)

    def _take(self, encoder: _Input, edges: Sequence[PinEdge], start_s: float) -> None:
        enabled = encoder.pins[:1] if self.single_channel else encoder.pins
        waiting = False
        for edge, following in zip_longest(edges, edges[1:]):
            encoder.levels[encoder.pins.index(edge.pin)] = edge.level
            waiting = waiting or edge.pin in enabled
            entry_s = max(edge.time_s, encoder.free_s)
            if waiting and not (following and following.time_s < entry_s + READ_S):
                waiting = False
                encoder.free_s = entry_s + INTERRUPT_S
                self._interrupt(encoder, int((entry_s - start_s) / TICK_S) & _MASK_16)

    def _interrupt(self, encoder: _Input, tick: int) -> None:
        before, encoder.seen = encoder.seen, tuple(encoder.levels)
        if encoder.masked:
            return
        encoder.edges_left -= 1
        encoder.masked = encoder.edges_left == 0
        if self.single_channel:
            step = int(before[0] != encoder.seen[0])
        else:
            step = (_PLACES[encoder.seen] - _PLACES[before]) & 3
        if step == _SKIPPED:
            self.impossible = min(MOST_IMPOSSIBLE, self.impossible + 1)
        elif step:
            encoder.count = (encoder.count + (-1 if step == 3 else 1)) & _MASK_16
            encoder.edge_tick = tick

    def read(self, tick: int) -> EncoderSample:
        """The counts at a time [64 us]."""
        left, right = self._inputs
        return EncoderSample((left.count, right.count), (left.edge_tick, right.edge_tick), tick & _MASK_16)

    def sample(self, tick: int) -> EncoderSample:
        """The same at the end of a period; each encoder may have as many edges again."""
        for encoder in self._inputs:
            encoder.edges_left = MOST_EDGES
        return self.read(tick)

    def masked(self, encoder: int) -> bool:
        """Whether an encoder had too many edges; it stays masked until `unmask`."""
        return self._inputs[encoder].masked

    def unmask(self, encoder: int, levels: Mapping[int, int]) -> None:
        """Goes on from the present levels of the pins."""
        self._inputs[encoder].look(levels)
        self._inputs[encoder].masked = False
