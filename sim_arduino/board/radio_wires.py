"""The two wires between a simulated chip and its radio module, in slices of 1 ms.

At the end of a slice the module gets the bytes that the chip has sent in it, and its own bytes begin.  So the module
answers up to 1 ms late.
"""

from typing import Callable

from sim_arduino.avr.bit_serial import FRAME_BITS, BitReceiver, edges
from sim_arduino.avr.machine import AvrMachine
from sim_arduino.hardware.xbee import BAUD, XBee

SLICE_S = 1e-3
IN, OUT = 2, 3
"""Pins of the chip (Arduino numbers): from the module's DOUT, and to its DIN."""


class RadioWires:
    """Connects `machine` and `xbee`; the chip's time is that of the module."""

    def __init__(self, machine: AvrMachine, xbee: XBee) -> None:
        self._machine, self._xbee = machine, xbee
        self._receiver = BitReceiver(BAUD)
        self._slice = int(round(SLICE_S * machine.frequency_hz))
        self._free_s = 0.0
        machine.set_pin(IN, 1)

    @property
    def next_s(self) -> float:
        """Time at which the next packet to the chip begins [s]; may be infinite."""
        return self._xbee.next_s

    def changed(self, level: int, at_s: float) -> None:
        """The chip's output has a new level."""
        self._receiver.changed(level, at_s)

    def run(self, to_cycle: int, run_to: Callable[[int], None]) -> None:
        """Runs the chip with `run_to` (`run_until` or `stall_until`), and the wires with it."""
        while self._machine.cycle < to_cycle:
            run_to(min(self._machine.cycle + self._slice, to_cycle))
            self._exchange(self._machine.time_s)

    def _exchange(self, now_s: float) -> None:
        for byte in self._receiver.take(now_s):
            self._xbee.receive(bytes([byte]), now_s)
        data = b"".join(self._xbee.take(now_s))
        if not data:
            return
        start_s = max(self._free_s, now_s)
        for at_s, level in edges(data, start_s, BAUD):
            self._machine.set_pin(IN, level, int(round(at_s * self._machine.frequency_hz)))
        self._free_s = start_s + len(data) * FRAME_BITS / BAUD
