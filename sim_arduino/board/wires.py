"""The wires between a simulated chip and the bridges or the radio of a plant, in slices of 1 ms.

The chip's time is that of the plant.
"""

import math
from typing import Callable, Dict, List

from sim_arduino.avr.bit_serial import FRAME_BITS, BitReceiver, edges
from sim_arduino.avr.machine import AvrMachine
from sim_arduino.hardware.bridge_plant import OUTPUT_PINS, BridgePlant
from sim_arduino.hardware.xbee import BAUD, XBee

SLICE_S = 1e-3
IN, OUT = 2, 3  # pins of the chip (Arduino numbers): from the module's DOUT, and to its DIN


class BridgeWires:
    """Bridges and encoders.

    At the end of a slice the shares of time for which the chip's outputs were high in it drive the motors for the next
    slice, and the encoder edges of the next slice are planned at their cycles.  So the motors answer 1 ms late, and the
    plant's motors are up to 1 ms ahead of the chip.
    """

    def __init__(self, machine: AvrMachine, bridge: BridgePlant) -> None:
        self._machine, self._bridge = machine, bridge
        self._slice = int(round(SLICE_S * machine.frequency_hz))
        self._since = self._end = machine.cycle
        self._high: Dict[int, int] = {pin: machine.high_cycles(pin) for pins in OUTPUT_PINS for pin in pins}
        for pin, level in bridge.levels.items():
            machine.set_pin(pin, level)
        self._plan()

    @property
    def next_s(self) -> float:
        """Time of the next call of `run` if the chip does nothing [s]: now while a wheel turns or is driven."""
        return math.inf if all(self._bridge.motor(wheel).at_rest for wheel in (0, 1)) else -math.inf

    def run(self, to_cycle: int, run_to: Callable[[int], None]) -> None:
        """Runs the chip with `run_to` (`run_until` or `stall_until`), and the motors with it."""
        while self._machine.cycle < to_cycle:
            run_to(min(self._end, to_cycle))
            if self._machine.cycle >= self._end:
                self._drive()
                self._plan()

    def _drive(self) -> None:
        """Writes the shares of the last slice to the bridges."""
        cycles = self._machine.cycle - self._since
        self._since += cycles
        for motor, pins in enumerate(OUTPUT_PINS):
            shares = []
            for pin in pins:
                high = self._machine.high_cycles(pin)
                shares.append((high - self._high[pin]) / cycles)
                self._high[pin] = high
            self._bridge.write(self._bridge.time_s, motor, *shares)

    def _plan(self) -> None:
        """Moves the motors to the end of the next slice, and plans the edges until then."""
        self._end += self._slice
        self._bridge.advance(self._end / self._machine.frequency_hz)
        planned: Dict[int, List[int]] = {}
        for edge in self._bridge.take_edges():
            cycles = planned.setdefault(edge.pin, [self._machine.cycle - 1])
            cycles.append(max(cycles[-1] + 1, int(round(edge.time_s * self._machine.frequency_hz))))
        for pin, cycles in planned.items():
            self._machine.plan_edges(pin, cycles[1:])


class RadioWires:
    """A radio module.

    At the end of a slice it gets the bytes that the chip has sent in it, and its own bytes begin.  So it answers up to
    1 ms late.
    """

    def __init__(self, machine: AvrMachine, xbee: XBee) -> None:
        self._machine, self._xbee = machine, xbee
        self._receiver = BitReceiver(1.0 / BAUD)
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
        """Runs the chip with `run_to` (`run_until` or `stall_until`), and the module with it."""
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
        for at_s, level in edges(data, start_s, 1.0 / BAUD):
            self._machine.set_pin(IN, level, int(round(at_s * self._machine.frequency_hz)))
        self._free_s = start_s + len(data) * FRAME_BITS / BAUD
