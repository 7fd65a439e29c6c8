"""The battery's voltage, through a divider on A3: mean of 16 conversions, one in 8 ms."""

from typing import Callable

from ..parameter_store import Config

CHANNEL = 3
PERIOD_S = 8e-3
CONVERSIONS = 16
SUM_SHIFT = 15


class BatteryInput:
    """`adc` returns the count of an analog input now."""

    def __init__(self, config: Config, adc: Callable[[int], int], now_s: float) -> None:
        self.measured = False  # false until the first mean, and without a divider (parameter 24 is 0)
        self._config, self._adc = config, adc
        self._next_s = now_s + PERIOD_S
        self._sum = self._whole_sum = self._conversions = 0

    def run(self, now_s: float) -> None:
        """Makes the conversions that are due."""
        due = 0
        while self._next_s <= now_s:
            self._next_s += PERIOD_S
            due += 1
        if not self._config["battery_divider"]:
            self.measured = False
        else:
            for _ in range(due):
                self._sum += self._adc(CHANNEL)
                self._conversions += 1
                if self._conversions == CONVERSIONS:
                    self._whole_sum, self.measured = self._sum, True
                    self._sum = self._conversions = 0

    @property
    def centivolts(self) -> int:
        """Mean of 128 ms [0.01 V]."""
        return self._whole_sum * self._config["battery_divider"] >> SUM_SHIFT
