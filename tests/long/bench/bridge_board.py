"""The H-bridge image on the simulated chip, with wheels that turn at steady rates, whatever the board does."""

import itertools
import random
from pathlib import Path
from typing import Dict, Iterator, List, Mapping, Sequence, Tuple

from mrl_driver.protocol.table import NOT_CONNECTED, PARAMETER_BY_NAME, WIRING
from mrl_driver.robot import models, wiring, wirings
from mrl_driver.robot.chips import ATMEGA328P, Chip
from sim_arduino.avr.machine import AvrMachine
from sim_arduino.hardware.echo_ranges import AIR_C, PING_S, sound_m_s
from tests.long.bench.firmware_board import LEFT, RIGHT, Rig, request
from tests.models import DUO_PINS, wired_eeprom

ON_TIMER_1 = {
    **DUO_PINS,
    **{"pin_left_pwm_a": 9, "pin_left_pwm_b": 8, "pin_left_logic": 7},
    **{"pin_right_pwm_a": 10, "pin_right_pwm_b": 5, "pin_right_logic": 6},
    **{"pin_left_encoder_b": 3, "pin_right_encoder_a": 18, "pin_right_encoder_b": 19, "i2c": 0},
}
"""PWM on D9 and D10, so that the clock is timer 2; encoders on D2, D3, A4 and A5."""
WITH_SERVOS = {
    **ON_TIMER_1,
    **{"pin_left_pwm_a": 5, "pin_right_pwm_a": 6, "pin_right_pwm_b": 4, "pin_right_logic": 11},
    **{"pin_servo_1": 9, "pin_servo_2": 10},
}
"""PWM on D5 and D6, so that timer 1 makes the pulses of servos."""
WITH_INPUTS = {
    **DUO_PINS,
    **{"pin_sonar_trigger": NOT_CONNECTED, "pin_battery": NOT_CONNECTED},
    **{"pin_bumper_left": 12, "pin_emergency_stop": 17},
}
SIX_RANGES = [(30, 50), (31, 51), (32, 52), (33, 2), (34, 18), (35, 19)]
FOUR_WHEELS = {
    **wirings.load("mega_four_wheels").pins,
    **{"pin_servo_1": 11, "pin_servo_2": 12, "air_temperature": round(AIR_C)},
    **dict(zip(itertools.chain(*wiring.RANGE_PINS), itertools.chain(*SIX_RANGES))),
}
"""Four motors on a Mega, whose encoders share one interrupt, two servos, and six HC-SR04 (`SIX_RANGES`)."""
CHAIN_S = 0.7  # warm-up and first chain of the sonars, which begin again when a wiring is accepted
SERVO_US, SERVO_US_S = (500, 2500), 80  # Servos under load move for 25 s
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
        """Turns the wheels (left, right, then those behind them) forward at these rates [edge/s]."""
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


class Echoes:
    """Answers the triggers of HC-SR04 with echoes of random lengths, at most as long as those of 3.4 m.

    `pins` are triggers and echoes.

    Attributes:
        triggers: Pins that must be watched.
        lengths_s: Lengths of the echoes of each sensor so far [s].
    """

    def __init__(self, machine: AvrMachine, pins: Sequence[Tuple[int, int]], seed: str = "") -> None:
        self._machine, self._echo_of, self._chance = machine, dict(pins), random.Random(seed)
        self.triggers = list(self._echo_of)
        self.lengths_s: Dict[int, List[float]] = {echo: [] for echo in self._echo_of.values()}
        for echo in self.lengths_s:
            machine.set_pin(echo, 0)
        machine.watch_pins(self.triggers)
        machine.on_pin = self._trigger

    def _trigger(self, pin: int, level: int, time_s: float) -> None:
        if level or pin not in self._echo_of:
            return
        echo, length_s = self._echo_of[pin], self._chance.uniform(300e-6, 20e-3)
        self.lengths_s[echo].append(length_s)
        ends_s = time_s + PING_S, time_s + PING_S + length_s
        self._machine.plan_edges(echo, [int(end_s * self._machine.frequency_hz) for end_s in ends_s])

    def errors_us(self, values: Sequence[int]) -> Iterator[float]:
        """Errors of readings [mm], each of which belongs to the last echo or, while that comes, to the one before."""
        for value, lengths_s in zip(values, self.lengths_s.values()):
            yield min(abs(2e3 * value / sound_m_s(AIR_C) - 1e6 * each) for each in lengths_s[-2:])


class BridgeRig(Rig):
    """One H-bridge board on the bench, whose wheels turn."""

    FAULTS = ("left fast", "right fast")
    machine: TurningMachine

    def __init__(
        self,
        elf: Path,
        edges_hz: float = 0.0,
        pins: Mapping[str, int] = DUO_PINS,
        seed: int = 1,
        chip: Chip = ATMEGA328P,
    ) -> None:
        self.pins = pins
        super().__init__(elf, seed, chip)
        self.edges_hz = edges_hz

    def watch(self, pins: Sequence[int]) -> None:
        """Lets the machine report changes of these pins."""
        self.machine.watch_pins(pins)

    @property
    def outputs(self) -> List[int]:
        """Pins of all bridges."""
        return [pin for pins in wiring.output_pins(self.pins) for pin in pins if pin != NOT_CONNECTED]

    def _powered(self, elf: Path, seed: int, chip: Chip) -> AvrMachine:
        machine = TurningMachine(elf, seed=seed, chip=chip)
        machine.encoders = wiring.encoder_pins(self.pins)
        machine.write_eeprom(0, wired_eeprom(pins=self.pins, chip=chip))
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
        wheels = len(self.machine.wheels)
        self.machine.turn(*[self.edges_hz / wheels] * wheels)
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


class FullMega(BridgeRig):
    """A Mega with four wheels, whose HC-SR04 measure and whose servos move while the load runs."""

    def settle(self, **parameters: int) -> "FullMega":
        self.echoes = Echoes(self.machine, SIX_RANGES)
        super().settle(**parameters)
        for servo in (1, 2):
            self.ask(request("set_servo", servo, SERVO_US[0], 0))
            self.ask(request("set_servo", servo, SERVO_US[1], SERVO_US_S))
        return self

    def watch(self, pins: Sequence[int]) -> None:
        super().watch([*pins, *self.echoes.triggers])
