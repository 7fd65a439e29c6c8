"""The board's side of HC-SR04 and analog range sensors: turns, echoes, and wire values."""

import math
from typing import Callable, Mapping, Tuple

from mrl_driver.protocol.table import NOT_CONNECTED, RANGE_HELD, RANGE_INVALID, RANGE_NOTHING, RANGES, TICK_S
from mrl_driver.robot.models import ECHO_INPUTS
from mrl_driver.robot.wiring import RANGE_PINS
from sim_arduino.hardware.wiring import Plant, analog_ranges_of

TURN_S = 938 * TICK_S
SAMPLE_S = 40e-3  # from one conversion of an analog sensor to the next
TRIGGER_S = 10e-6
LONGEST_S = 30.72e-3  # longer echoes mean that nothing is in range
HELD_FOR = 5  # turns of all since a sensor has fired, after which a high echo counts as held
FARTHEST_MM = 4000


class RangeTask:
    """Fires the sensors of a wiring in turn, and reads the analog ones, from `start_s` [s] on.

    `adc` returns the count of an analog input now.
    """

    def __init__(
        self, plant: Plant, pins: Mapping[str, int], air_c: int, start_s: float, adc: Callable[[int], int]
    ) -> None:
        self._plant, self._adc = plant, adc
        wires = [tuple(pins.get(name, NOT_CONNECTED) for name in names) for names in RANGE_PINS]
        self._wires = [(i, *pair) for i, pair in enumerate(wires) if pair[0] != NOT_CONNECTED]
        self._way = 43424 + (1271 * air_c >> 4)  # half that of the sound in half a microsecond [2^-19 mm]
        self._values, self._fired_before = [RANGE_INVALID] * RANGES, [0] * RANGES
        self._turn = -1
        self._awaiting, self._ends_s = False, math.inf
        self._turn_s = start_s + TURN_S if self._wires else math.inf
        inputs = analog_ranges_of(plant.model, pins)
        self._channels = {ECHO_INPUTS.index(name): channel for channel, name in inputs.items()}
        self._sample_s = start_s + SAMPLE_S if self._channels else math.inf

    @property
    def next_s(self) -> float:
        """When `run` must be called [s]."""
        return min(self._turn_s, self._ends_s, self._sample_s)

    @property
    def values(self) -> Tuple[int, ...]:
        """Wire values of all inputs."""
        return tuple(self._values)

    @property
    def held(self) -> bool:
        """An echo is held high."""
        return RANGE_HELD in self._values

    def run(self, now_s: float) -> None:
        """Takes an echo that has ended, and begins the next turn and the conversions when they are due."""
        if self._sample_s <= now_s:
            self._sample_s = now_s + SAMPLE_S
            for index, channel in self._channels.items():
                self._values[index] = self._adc(channel)
        if self._ends_s <= now_s:
            self._values[self._index] = self._millimetres(*self._echo())
            self._awaiting, self._ends_s = False, math.inf
        if self._turn_s > now_s:
            return
        if self._awaiting:
            self._values[self._index] = RANGE_NOTHING if self._is_high(now_s) else RANGE_INVALID
        self._turn_s = now_s + TURN_S
        self._turn = (self._turn + 1) % len(self._wires)
        self._begin(now_s)

    def _begin(self, now_s: float) -> None:
        index, trigger, _ = self._wires[self._turn]
        self._awaiting, self._ends_s = not self._is_high(now_s), math.inf
        self._fired_before = [turns + 1 for turns in self._fired_before]
        if self._awaiting:
            self._fired_before[index] = 0
            self._plant.pin_changed(trigger, 1, now_s)
            self._plant.pin_changed(trigger, 0, now_s + TRIGGER_S)
            begin_s, end_s = self._echo()
            self._ends_s = end_s if begin_s >= now_s else math.inf
        elif self._fired_before[index] >= HELD_FOR:
            self._values[index] = RANGE_HELD

    @property
    def _index(self) -> int:
        return self._wires[self._turn][0]

    def _echo(self) -> Tuple[float, float]:
        return self._plant.ranges.echo(self._wires[self._turn][2]) or (-math.inf, -math.inf)

    def _is_high(self, now_s: float) -> bool:
        begin_s, end_s = self._echo()
        return begin_s <= now_s < end_s

    def _millimetres(self, begin_s: float, end_s: float) -> int:
        if end_s - begin_s > LONGEST_S:
            return RANGE_NOTHING
        found = (round(2e6 * (end_s - begin_s)) * self._way + (1 << 18)) >> 19
        return RANGE_NOTHING if found > FARTHEST_MM else found
