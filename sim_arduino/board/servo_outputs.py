"""The servos of a board: lengths of their pulses, and the pulses themselves; see servo.cpp."""

import math
from typing import Mapping

from mrl_driver.protocol.table import NOT_CONNECTED, TICK_S
from mrl_driver.robot.wiring import SERVOS
from sim_arduino.hardware.wiring import Plant

PERIOD_S = 20e-3  # from pulse to pulse [s]
STEP_S = 244 * TICK_S  # a speed of 4 us/s is a change of a sixteenth of a microsecond in a step


class Output:
    """One servo: lengths of its pulse now and at the end of its move, and the change in a step [us/16]."""

    present = target = change = 0

    def step(self, count: int) -> None:
        """Moves on by this number of steps."""
        most = count * self.change
        self.present += max(-most, min(most, self.target - self.present))


class ServoOutputs:
    """The servos of a wiring, from `start_s` on [s]; first without pulses."""

    def __init__(self, plant: Plant, pins: Mapping[str, int], start_s: float) -> None:
        numbers = {number: pins.get(name, NOT_CONNECTED) for number, name in enumerate(SERVOS, 1)}
        self._plant = plant
        self._pins = {number: pin for number, pin in numbers.items() if pin != NOT_CONNECTED}
        self._outputs = {number: Output() for number in self._pins}
        self._stepped_s, self._pulse_s = start_s, start_s + PERIOD_S

    @property
    def next_s(self) -> float:
        """Time of the next pulse, when `run` must be called [s]; may be infinite."""
        return self._pulse_s if any(output.present for output in self._outputs.values()) else math.inf

    def run(self, now_s: float) -> None:
        """Gives the pulses that are due."""
        while self.next_s <= now_s:
            self._step(self._pulse_s)
            for number, output in self._outputs.items():
                if output.present:
                    pin = self._pins[number]
                    self._plant.pin_changed(pin, 1, self._pulse_s)
                    self._plant.pin_changed(pin, 0, self._pulse_s + (output.present >> 4) * 1e-6)
            self._pulse_s += PERIOD_S

    def _step(self, now_s: float) -> None:
        count = int((now_s - self._stepped_s) / STEP_S)
        self._stepped_s += count * STEP_S
        for output in self._outputs.values():
            output.step(count)

    def move(self, number: int, pulse_us: int, speed_us_s: int, now_s: float) -> bool:
        """Begins a move; false if the servo is not connected."""
        if number not in self._outputs:
            return False
        self._step(now_s)
        while self._pulse_s <= now_s:
            self._pulse_s += PERIOD_S
        output = self._outputs[number]
        output.target, output.change = pulse_us << 4, (speed_us_s + 3) // 4
        if not (speed_us_s and output.present):
            output.present = output.target
        return True

    def pulse_us(self, number: int, now_s: float) -> int:
        """Length of the pulses of a servo now [us]; 0: it has none."""
        self._step(now_s)
        return self._outputs[number].present >> 4 if number in self._outputs else 0

    def lose_host(self, release: bool, now_s: float) -> None:
        """The host is silent: servos lose their pulses, or stay where they are."""
        self._step(now_s)
        for output in self._outputs.values():
            output.present = output.target = 0 if release else output.present
