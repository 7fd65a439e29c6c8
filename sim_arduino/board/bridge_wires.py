"""The wires between a simulated chip and the bridges and encoders of a plant, in slices of 1 ms.

At the end of a slice the shares of time for which the chip's outputs were high in it drive the motors for the next
slice, and the encoder edges of the next slice are planned at their cycles.  So the motors answer 1 ms late, and the
plant's motors are up to 1 ms ahead of the chip.
"""

from typing import Callable, Dict, List

from sim_arduino.avr.machine import AvrMachine
from sim_arduino.hardware.bridge_plant import OUTPUT_PINS, BridgePlant

SLICE_S = 1e-3


class BridgeWires:
    """Connects `machine` and `bridge`.

    Args:
        machine: The chip; its cycle count is the time, from power-up on.
        bridge: Bridges and encoders, at the same time as the chip.
    """

    def __init__(self, machine: AvrMachine, bridge: BridgePlant) -> None:
        self._machine, self._bridge = machine, bridge
        self._slice = int(round(SLICE_S * machine.frequency_hz))
        self._since = machine.cycle
        self._end = machine.cycle
        self._high: Dict[int, int] = {pin: machine.high_cycles(pin) for pins in OUTPUT_PINS for pin in pins}
        for pin, level in bridge.levels.items():
            machine.set_pin(pin, level)
        self._plan()

    @property
    def moving(self) -> bool:
        """The wheels turn or are driven: the next slice can bring edges."""
        return any(not self._bridge.motor(wheel).at_rest for wheel in (0, 1))

    @property
    def next_s(self) -> float:
        """End of the running slice [s]."""
        return self._end / self._machine.frequency_hz

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
        self._bridge.advance(self.next_s)
        planned: Dict[int, List[int]] = {}
        for edge in self._bridge.take_edges():
            cycles = planned.setdefault(edge.pin, [self._machine.cycle - 1])
            cycles.append(max(cycles[-1] + 1, int(round(edge.time_s * self._machine.frequency_hz))))
        for pin, cycles in planned.items():
            self._machine.plan_edges(pin, cycles[1:])
