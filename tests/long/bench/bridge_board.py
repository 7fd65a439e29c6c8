"""The H-bridge image on the simulated chip, with wheels that turn at steady rates, whatever the board does."""

from pathlib import Path
from typing import List, Mapping, Sequence, Tuple

from mrl_driver.protocol.table import NOT_CONNECTED, PARAMETER_BY_NAME, WIRING
from mrl_driver.robot import models, wiring
from sim_arduino.avr.machine import AvrMachine
from tests.long.bench.firmware_board import LEFT, RIGHT, Rig, request
from tests.models import DUO_PINS, wired_eeprom

ON_TIMER_1 = {
    **DUO_PINS,
    **{"pin_left_pwm_a": 9, "pin_left_pwm_b": 8, "pin_left_logic": 7},
    **{"pin_right_pwm_a": 10, "pin_right_pwm_b": 5, "pin_right_logic": 6},
    **{"pin_left_encoder_b": 3, "pin_right_encoder_a": 18, "pin_right_encoder_b": 19, "i2c": 0},
}
"""PWM on D9 and D10, so that the clock is timer 2; encoders on D2, D3, A4 and A5."""
CHAIN_S = 0.7  # warm-up and first chain of the sonars, which begin again when a wiring is accepted
PHASE_ERROR = 0.2  # Delay of channel B, as a share of the time between two edges
AHEAD_CYCLES, SLICE_CYCLES = 64, 32000
"""Edges are planned this far ahead, for a run ends behind an instruction, and in slices of 2 ms."""


class _Channel:
    """One output of an encoder: its edges come every two counts."""

    def __init__(self, pin: int, first: float) -> None:
        self.pin, self.next = pin, first

    def due(self, count: float) -> List[float]:
        """Places of the edges up to a place [count]."""
        places = []
        while self.next <= count:
            places.append(self.next)
            self.next += 2.0
        return places


class _Wheel:
    """A wheel that turns forward at a steady rate from a cycle on."""

    def __init__(self, pins: Tuple[int, int]) -> None:
        self.channels = (_Channel(pins[0], 0.5), _Channel(pins[1], 1.5 + PHASE_ERROR))
        self.edges = 0
        self._cycle, self._place, self._per_cycle = 0, 0.0, 0.0

    def turn(self, per_cycle: float, cycle: int) -> None:
        """Another rate from now on [edge/cycle]."""
        self._place += self._per_cycle * (cycle - self._cycle)
        self._cycle, self._per_cycle = cycle, per_cycle

    def plan(self, machine: AvrMachine, cycle: int) -> None:
        if not self._per_cycle:
            return
        place = self._place + self._per_cycle * (cycle - self._cycle)
        for channel in self.channels:
            due = channel.due(place)
            if due:
                self.edges += len(due)
                at = [self._cycle + int((each - self._place) / self._per_cycle) for each in due]
                machine.plan_edges(channel.pin, at)


class TurningMachine(AvrMachine):
    """A chip whose encoder pins get edges at steady rates while it runs."""

    encoders: Sequence[Sequence[int]] = wiring.encoder_pins(DUO_PINS)

    def power_cycle(self, seed: int = 0) -> None:
        """As the base class; both encoders stand still, with both channels low."""
        super().power_cycle(seed)
        self.wheels = tuple(_Wheel(pins) for pins in self.encoders)
        self._planned = 0
        for pins in self.encoders:
            for pin in pins:
                self.set_pin(pin, 0)

    def turn(self, *edges_hz: float) -> None:
        """Turns the wheels (left, right) forward at these rates [edge/s]."""
        for wheel, hertz in zip(self.wheels, edges_hz):
            wheel.turn(hertz / self.frequency_hz, max(self.cycle, self._planned))

    def run_until(self, cycle: int) -> None:
        slices = range(self.cycle + SLICE_CYCLES, int(cycle), SLICE_CYCLES)
        for end in (*slices, int(cycle)):
            until = end + AHEAD_CYCLES
            for wheel in self.wheels:
                wheel.plan(self, until)
            self._planned = max(self._planned, until)
            super().run_until(end)


class BridgeRig(Rig):
    """One H-bridge board on the bench, whose wheels turn."""

    FAULTS = ("left fast", "right fast")
    machine: TurningMachine

    def __init__(
        self, elf: Path, edges_hz: float = 0.0, pins: Mapping[str, int] = DUO_PINS, seed: int = 1
    ) -> None:
        self.pins = pins
        super().__init__(elf, seed)
        self.edges_hz = edges_hz

    @property
    def outputs(self) -> List[int]:
        """Pins of both bridges."""
        return [pin for pins in wiring.output_pins(self.pins) for pin in pins if pin != NOT_CONNECTED]

    def _powered(self, elf: Path, seed: int) -> AvrMachine:
        machine = TurningMachine(elf, seed=seed)
        machine.encoders = wiring.encoder_pins(self.pins)
        machine.write_eeprom(0, wired_eeprom(pins=self.pins))
        machine.power_cycle(seed)
        return machine

    def settle(self, **parameters: int) -> "BridgeRig":
        """As the base class, with the numbers of a duo, bridge and wiring set, no ramp, and turning wheels.

        Full speed is the largest one of its parameter, so that the wheels are not too fast for it.
        """
        facts = {
            **models.load("duo").board,
            **self.pins,
            "wiring": 1 << [name for name, _ in WIRING].index("set"),
            "full_speed": PARAMETER_BY_NAME["full_speed"].high,
            "ramp_time": 0,
        }
        super().settle(**{**facts, **parameters})
        self.run(CHAIN_S)
        self.machine.turn(self.edges_hz / 2, self.edges_hz / 2)
        return self

    def hold_counts(self) -> None:
        """As the base class: the counts begin at those of its motor board."""
        for encoder, count in ((3, RIGHT), (1, LEFT)):
            self.machine.send(request("preset_encoder", encoder, count))
        self.run(5e-3)

    def break_part(self, fault: str) -> None:
        """Lets the wire of one encoder oscillate ("left fast", "right fast"), or mends it ("")."""
        fast = 400e3
        left, right = (fast if fault == f"{side} fast" else self.edges_hz / 2 for side in ("left", "right"))
        self.machine.turn(left, right)
