"""The board's side of the sonars: power, triggers, and conversion of ADC counts to wire values."""

import math
from typing import Callable, List

from mrl_driver.protocol.table import SONAR_INVALID, SONAR_NOTHING
from sim_arduino.hardware.sonars import READING_S, START_S
from sim_arduino.hardware.wiring import Plant, SonarPins

from .parameter_store import Config

WARM_UP_S = START_S + 0.014
ROUND_S = 0.312  # time from one trigger of the chain to the next [s]: three readings and a margin
SONARS = 3
LOWEST_COUNT, NOTHING_FROM, HIGHEST_COUNT = 10, 640, 700
"""ADC counts: below the lowest nothing is connected, above the highest the input is saturated."""


class SonarTask:
    """Powers the sonars on its `pins` at `start_s` [s] and triggers their chain again and again."""

    def __init__(
        self, plant: Plant, pins: SonarPins, config: Config, adc: Callable[[int], int], start_s: float
    ) -> None:
        self._plant, self._pins, self._config, self._adc = plant, pins, config, adc
        self._first_s = math.inf
        plant.pin_changed(pins.power, 0, start_s)
        plant.pin_changed(pins.power, 1, start_s)
        self.next_s = start_s + WARM_UP_S  # time of the next trigger, when `run` must be called [s]

    def run(self, now_s: float) -> None:
        """Triggers the chain if the trigger is due."""
        if self.next_s <= now_s:
            self._plant.pin_changed(self._pins.trigger, 1, now_s)
            self._plant.pin_changed(self._pins.trigger, 0, now_s)
            self._first_s = min(self._first_s, now_s)
            self.next_s = now_s + ROUND_S

    def values(self, now_s: float) -> List[int]:
        """Wire values of front, left, right [cm]; -1 until a sensor has made its first reading."""
        return [
            self._value(channel) if now_s >= self._first_s + READING_S * (turn + 1) else SONAR_INVALID
            for turn, channel in enumerate(self._pins.channels)
        ]

    def _value(self, channel: int) -> int:
        count = self._adc(channel) if channel >= 0 else 0
        if not LOWEST_COUNT <= count <= HIGHEST_COUNT:
            return SONAR_INVALID
        return SONAR_NOTHING if count >= NOTHING_FROM else self._config.sonar_cm(count)
