"""The motor back end of boards with an H-bridge: turns requests into speeds of the wheels, and controls them."""

import math
from functools import lru_cache
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BRIDGES, INT16_MAX, NOT_CONNECTED, TICK_S, WHEELS, WIRING, Command
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import CHIPS, NONE
from sim_arduino.hardware.encoders import EncoderCounter
from sim_arduino.hardware.wiring import Plant

from .board_status import BoardStatus
from .encoder_inputs import SAMPLE_TICKS, EncoderInput
from .input_watch import InputWatch
from .integers import divide, limit, uint16
from .motors import Counts, Motors
from .parameter_store import Config
from .wheel import Wheel
from .wheel_settings import FULL, NO_SETTINGS, settings_of

LEFT, RIGHT = 0, 1
"""The rear wheels of four come behind these, in the same order: an odd wheel is a right one."""
_SIDES = {1: LEFT, 3: RIGHT}  # sides by the numbers that motors and encoders have in the protocol
_ASIDE = (-1, 1, 1, -1)  # directions of mecanum wheels that move the robot to the left
_BITS = {name: 1 << bit for bit, (name, _) in enumerate(WIRING)}
REFUSED_S = 1.0  # moves are refused for this time after the board has stopped a wheel [s]
MISSED_KICK_S = 0.128
"""The chip's watchdog switches the outputs off when the program has not kicked it for this time [s]."""
_PERIOD_S = SAMPLE_TICKS * TICK_S
BATTERY_PERIOD_S, CONVERSIONS, SUM_SHIFT = 8e-3, 16, 15
"""The battery's voltage is the mean of 16 conversions, one in 8 ms."""
LOW, HIGH = 0, 255  # levels of an output pin; all between is the duty of a PWM output
_FAST_PWM = ("vnh5019", "cytron", "bts7960")
_PINS: Dict[str, Tuple[str, str, str, str]] = {
    "vnh5019": ("D10", "D01", "111", "000"),
    "tb6612": ("D10", "D01", "111", "100"),
    "l298n": ("1D0", "1R1", "111", "000"),
    "cytron": ("D00", "D01", "", ""),
    "drv8833": ("1R1", "R11", "111", "000"),
    "bts7960": ("1R1", "R11", "111", "000"),
    "l298n_enable": ("D10", "D01", "111", "000"),
    "l298p": ("D00", "D01", "", ""),
    "l298p_brake": ("D00", "D01", "111", "000"),
}
"""Pins while a motor is driven forward, driven backward, brakes and coasts: low, high, duty D or the rest R to 255.

PWM is on pins where the motor brakes between the pulses if the chip can, so that its speed is proportional to the duty.
An empty entry stands for a drive with duty 0."""


@lru_cache(maxsize=None)
def shares(chip: str, backward: bool, duty: int, coast: bool) -> Tuple[float, ...]:
    """Shares of time for which PWM_A, PWM_B and LOGIC are high; fast PWM has 256 steps, phase-correct PWM 255."""
    steps = HIGH + 1 if chip in _FAST_PWM else HIGH
    return tuple(level / steps if level < HIGH else 1.0 for level in levels(chip, backward, duty, coast))


def levels(chip: str, backward: bool, duty: int, coast: bool) -> Tuple[int, ...]:
    """Levels of PWM_A, PWM_B and LOGIC for a duty of 0 to 255; 0 brakes, or lets the motor coast if the chip can."""
    if chip not in _PINS:
        return LOW, LOW, LOW
    ahead, back, brake, free = _PINS[chip]
    pins = back if backward else ahead
    if not duty:
        pins = (free if coast else brake) or pins
    return tuple({"0": LOW, "1": HIGH, "D": duty, "R": HIGH - duty}[pin] for pin in pins)


class Cables(NamedTuple):
    """How a wheel is connected: indices of its encoder and of its motor, and whether they are reversed."""

    encoder: int
    motor: int
    encoder_reversed: bool
    motor_reversed: bool


class BatteryInput:
    """The battery's voltage, through a divider; `adc` returns the count of an analog input now."""

    def __init__(self, config: Config, adc: Callable[[int], int], now_s: float) -> None:
        self.channel = NONE  # of the converter
        self.measured = False  # false until the first mean, and without a divider (parameter 24 is 0)
        self._config, self._adc = config, adc
        self._next_s = now_s + BATTERY_PERIOD_S
        self._sum = self._whole_sum = self._conversions = 0

    def run(self, now_s: float) -> None:
        """Makes the conversions that are due."""
        has_divider = self.has_divider
        self.measured = self.measured and has_divider
        while self._next_s <= now_s:
            self._next_s += BATTERY_PERIOD_S
            if has_divider:
                self._convert()

    @property
    def has_divider(self) -> bool:
        """Whether the voltage is measured."""
        return self.channel != NONE and self._config["battery_divider"] != 0

    def _convert(self) -> None:
        self._sum += self._adc(self.channel)
        self._conversions += 1
        if self._conversions == CONVERSIONS:
            self._whole_sum, self.measured = self._sum, True
            self._sum = self._conversions = 0

    @property
    def centivolts(self) -> int:
        """Mean of 128 ms [0.01 V]."""
        return self._whole_sum * self._config["battery_divider"] >> SUM_SHIFT


class BridgeControl(Motors):
    """Motors and encoders on the Arduino's pins, which can always be stopped; see motor_bridge.cpp.

    `adc` returns the count of an analog input now; the board's clock started at `start_s` [s].
    """

    def __init__(
        self, plant: Plant, config: Config, health: BoardStatus, adc: Callable[[int], int], start_s: float
    ) -> None:
        assert plant.bridge is not None
        self._plant, self._pins, self._chip = plant, plant.bridge, CHIPS[plant.model.chip]
        self._config, self._health = config, health
        self._start_s = start_s
        self.encoders: List[EncoderInput] = []
        self._levels: Dict[int, float] = {}  # shares of time for which outputs are high, by pin
        self._battery = BatteryInput(config, adc, start_s)
        self._wheels = [Wheel() for _ in WHEELS]
        self._counters = (EncoderCounter(), EncoderCounter())
        self._last_counts, self._kept_counts = [0] * len(WHEELS), [0] * len(WHEELS)
        self._settings = NO_SETTINGS
        self.accepted = self._usable = False  # the chip can do what the wiring asks; and all else is set
        self.inputs = InputWatch()
        self._sample_s = math.inf  # time of the next sample of the encoders [s]
        self._take_wiring(start_s)
        self._refused_since_s = -math.inf
        self._turning = self._undervoltage = False

    # ---- presence

    @property
    def capabilities(self) -> Tuple[str, ...]:
        """The temperature is never measured, and the battery only with a divider."""
        no_battery = () if self._battery.has_divider else ("no_battery",)
        return ("bridge", "wiring", "no_temperature", *no_battery)

    def boot(self, now_s: float) -> None:
        self._pins.take_edges()
        self._sample_s = now_s + _PERIOD_S
        self.refresh(now_s)

    def release(self, now_s: float) -> None:
        """The pins are inputs until the sketch starts; resistors hold the bridge off."""
        self._pins.off(now_s)

    def halt(self, now_s: float, to_s: float) -> None:
        """The outputs stay as they are until the chip's watchdog switches them off."""
        self._sample_until(min(to_s, now_s + MISSED_KICK_S))
        if to_s > now_s + MISSED_KICK_S:
            self._pins.off(now_s + MISSED_KICK_S)
            self._sample_until(to_s)

    def _sample_until(self, to_s: float) -> None:
        """The sampling interrupt goes on although no wheel is served."""
        while self._sample_s <= to_s:
            self._sample()
        self._plant.advance(to_s)

    # ---- parameters

    def refresh(self, now_s: float, parameter: Optional[str] = None) -> None:
        """Takes a changed parameter; if it concerns the wires, the motors stop first."""
        if parameter in (None, "bridge", "wiring", *wiring.NAMES):
            self.stop(now_s, StopReason.HOST)
            self._pins.off(now_s)
            self._take_wiring(now_s)
        settings = settings_of(self._config) if self.accepted and self._wired("set") else None
        self._settings, self._usable = settings or self._settings, settings is not None
        if not self._usable:
            self.stop(now_s, StopReason.HOST)
        self._health.set_fault("wiring", not self._usable)
        self._plan()

    def _plan(self) -> None:
        self.next_s = min(self._sample_s, self.inputs.next_s)

    def _take_wiring(self, now_s: float) -> None:
        """The pins of a wiring that is not accepted stay inputs, and nothing reads them."""
        pins, bridge = self._config.pins, BRIDGES[self._config["bridge"]]
        self._problem = wiring.check(pins, bridge, self._chip)
        self.accepted = self._problem == wiring.SOUND and bridge != BRIDGES[0]
        pins = pins if self.accepted else wiring.EMPTY
        self._levels = {}
        reached = [set(wires) - {NOT_CONNECTED} for wires in self._pins.outputs]
        self._outputs = [
            (outputs, [motor for motor, wires in enumerate(reached) if not wires.isdisjoint(outputs)])
            for outputs in wiring.output_pins(pins)
        ]
        for index, encoder in enumerate(self.encoders):
            self._kept_counts[index] = encoder.count
        self.encoders = [
            EncoderInput(each, self._pins.levels, self._chip) for each in wiring.encoder_pins(pins)
        ]
        for encoder, count in zip(self.encoders, self._kept_counts):
            encoder.count = count
            encoder.single_channel = encoder.single_channel or self._wired("single_channel")
        self._cables = [self._cables_of(wheel) for wheel in range(len(self.encoders))]
        self.inputs.begin(pins, now_s)
        battery = pins["pin_battery"]
        self._battery.channel = NONE if battery == NOT_CONNECTED else self._chip.pins[battery].channel

    def _wired(self, name: str) -> bool:
        return bool(self._config["wiring"] & _BITS[name])

    def _cables_of(self, wheel: int) -> Cables:
        """Motors and encoders at the front may be swapped."""
        parts, front = ("encoder", "motor"), wheel < wiring.FRONT
        encoder, motor = (wheel ^ int(front and self._wired(f"{part}s_swapped")) for part in parts)
        return Cables(encoder, motor, *(self._wired(f"{WHEELS[wheel]}_{part}_reversed") for part in parts))

    # ---- periods

    def run(self, now_s: float) -> None:
        if self.inputs.next_s <= now_s:
            self._take_edges(now_s)
            self.inputs.look(now_s, self._pins.levels)
            if self._turning:
                self._stopped_by_input(now_s)
        if self._sample_s <= now_s:
            self._serve_wheels(now_s)
        self._plan()

    def _serve_wheels(self, now_s: float) -> None:
        tick = self._sample()
        self._battery.run(now_s)
        self._watch_battery(now_s)
        for wheel in range(len(self.encoders)):
            self._serve(now_s, wheel, tick)

    def _sample(self) -> int:
        """Ends a period of the encoders; returns the board's clock [64 us]."""
        time_s = self._sample_s
        self._take_edges(time_s)
        self._sample_s = time_s + _PERIOD_S
        for encoder in self.encoders:
            encoder.sampled()
        return uint16(int((time_s - self._start_s) / TICK_S + 1e-6))

    def _take_edges(self, time_s: float) -> None:
        self._plant.advance(time_s)
        edges = self._pins.take_edges()
        for encoder in self.encoders:
            encoder.take(edges, self._start_s)

    def _serve(self, now_s: float, wheel: int, tick: int) -> None:
        index, moved = self._cables[wheel].encoder, self._moved_by(wheel)
        encoder = self.encoders[index]
        self._last_counts[index] = encoder.count
        reason = self._wheels[wheel].update(self._settings, moved, encoder.edge_tick, tick)
        if self._turning and encoder.masked:
            reason = StopReason.ENCODER
        if reason == StopReason.NONE:
            self._write(now_s, wheel)
        else:
            self.stop(now_s, reason)
            self._refused_since_s = now_s

    def _moved_by(self, wheel: int) -> int:
        """Counts of a wheel since its last period; a single channel counts in the direction of the command."""
        index, _, backward, _ = self._cables[wheel]
        encoder = self.encoders[index]
        if encoder.single_channel:
            backward = self._wheels[wheel].last_direction < 0
        counts = to_int16(encoder.count - self._last_counts[index])
        return -counts if backward else counts

    def _write(self, now_s: float, wheel: int) -> None:
        level, cables = self._wheels[wheel].level(), self._cables[wheel]
        backward = (self._wheels[wheel].last_direction < 0) != cables.motor_reversed
        chip = BRIDGES[self._config["bridge"] if self._usable else 0]
        high = shares(chip, backward, abs(level), bool(self._config["stop_mode"]))
        outputs, motors = self._outputs[cables.motor]
        self._levels.update(zip(outputs, (*high, float(self._usable))))
        for motor in motors:
            wires = self._pins.outputs[motor]
            self._pins.write(now_s, motor, *[self._levels.get(pin, 0.0) for pin in wires])

    def _watch_battery(self, now_s: float) -> None:
        """A battery that has recovered without load must be a sixteenth above the limit."""
        least, volts = self._config["undervoltage"], self._battery.centivolts
        watched = bool(least and self._battery.measured)
        if watched and volts < least and not self._undervoltage:
            self._undervoltage = True
            self.stop(now_s, StopReason.UNDERVOLTAGE)
        if not watched or volts >= least + least // 16:
            self._undervoltage = False

    # ---- readings

    def counts(self, now_s: float) -> Counts:
        left, right = (self._counters[side].read(self._travel(now_s, side)) for side in (LEFT, RIGHT))
        return Counts(right, left, 0)

    def wheel_counts(self, now_s: float) -> Tuple[int, ...]:
        """The counters of all wheels; 0 without one."""
        self._take_edges(now_s)
        counts = [to_int16(self._wheel_travel(wheel)) for wheel in range(len(self.encoders))]
        return (*counts, *[0] * (len(WHEELS) - len(counts)))

    def _travel(self, now_s: float, side: int) -> int:
        """The mean of the wheels on a side."""
        self._take_edges(now_s)
        wheels = self._on(side)
        return sum(map(self._wheel_travel, wheels)) // len(wheels)

    def _wheel_travel(self, wheel: int) -> int:
        return self._wheels[wheel].travel + self._moved_by(wheel)

    def _on(self, side: int) -> Sequence[int]:
        return range(side, len(self.encoders), len(_SIDES))

    def info(self, now_s: float) -> Tuple[int, int, int]:
        """The battery's voltage, or 0 without its divider."""
        return 0, 0, self._battery.centivolts

    def status(self) -> Tuple[int, ...]:
        """The number of impossible transitions."""
        return (min(INT16_MAX, sum(encoder.impossible for encoder in self.encoders)),)

    def wired(self) -> Tuple[int, ...]:
        """The reply to `read_board`."""
        channels = 0 if self._config["no_encoders"] else 1 if self.encoders[0].single_channel else 2
        motors = (len(self.encoders), channels) if self.accepted else (0, 0)
        echoes = [echo for _, echo in wiring.RANGE_PINS]
        chip = int(self._chip.name[len("atmega") :].rstrip("p"))
        masks = [self._connected(names) for names in (echoes, wiring.STOP_INPUTS, wiring.SERVOS)]
        return (chip, *motors, *masks)

    def _connected(self, names: Sequence[str]) -> int:
        """A bit for each of these parameters that has a pin."""
        pins = self._config.pins if self.accepted else wiring.EMPTY
        return sum(1 << bit for bit, name in enumerate(names) if pins[name] != NOT_CONNECTED)

    def wiring_problem(self) -> Tuple[int, int, int]:
        """The reply to `read_wiring`."""
        return self._problem.reply

    # ---- requests

    def stop(self, now_s: float, reason: StopReason) -> None:
        self._health.stopped(reason)
        self._turning = False
        if reason == StopReason.HOST:
            self._refused_since_s = -math.inf
        for wheel in self._wheels:
            wheel.stop()
        for number in range(len(self._outputs)):
            self._write(now_s, number)

    def _begin_move(self, now_s: float, moves: bool) -> bool:
        """Whether a move may begin; a masked encoder gets another chance."""
        if self._health.refuses_move():
            return False
        if not moves:
            self._refused_since_s = -math.inf
        if not self._usable or self._undervoltage or now_s < self._refused_since_s + REFUSED_S:
            return False
        self._take_edges(now_s)
        for encoder in self.encoders:
            if encoder.masked:
                encoder.unmask(self._pins.levels)
        self._health.turned()
        self._turning = True
        return True

    def _stopped_by_input(self, now_s: float) -> bool:
        """Stops if a wheel turns to a side where an input is active."""
        for backward in (False, True):
            reason = self.inputs.against(backward)
            if reason is not StopReason.NONE and any(wheel.turns(backward) for wheel in self._wheels):
                self.stop(now_s, reason)
                return True
        return False

    def carry_out(self, now_s: float, row: Command, *values: int) -> bool:
        """It cannot carry out the requests that have no method here; the host fits the gains."""
        request = getattr(self, f"_{row.name}", None)
        return bool(request and request(now_s, *values))

    def _move_differential(self, now_s: float, linear_mm_s: int, angular_mrad_s: int) -> bool:
        return self._move_twist(now_s, linear_mm_s, 0, angular_mrad_s)

    def _move_twist(self, now_s: float, forward_mm_s: int, left_mm_s: int, angular_mrad_s: int) -> bool:
        """If a wheel would be faster than it can be, all slow down by the same factor, which keeps the arc."""
        moves = bool(forward_mm_s or left_mm_s or angular_mrad_s)
        if (left_mm_s and len(self.encoders) == wiring.FRONT) or not self._begin_move(now_s, moves):
            return False
        ahead, aside = (
            each * self._settings.share_per_mm_s_q8 + 128 >> 8 for each in (forward_mm_s, left_mm_s)
        )
        turn = angular_mrad_s * self._settings.share_per_mrad_s_q12 + 2048 >> 12
        shares: List[int] = [
            ahead + (turn if wheel % 2 else -turn) + sign * aside for wheel, sign in enumerate(_ASIDE)
        ]
        most = max(map(abs, shares))
        if most > FULL:
            factor_q14 = (FULL << 14) // most
            shares = [divide(divide(each, 16) * factor_q14, 1024) for each in shares]
        for wheel, speed in zip(self._wheels, shares):
            wheel.set_speed(speed)
        return not self._stopped_by_input(now_s)

    def _move_motors_pid(self, now_s: float, *percents: int) -> bool:
        return self._turn(now_s, Wheel.set_speed, percents)

    def _move_motors(self, now_s: float, *percents: int) -> bool:
        return self._turn(now_s, Wheel.set_duty, percents)

    def _turn(self, now_s: float, how: Callable[[Wheel, int], None], percents: Sequence[int]) -> bool:
        begun = self._begin_move(now_s, any(percents))
        if begun:
            for number, wheel in enumerate(self._wheels):
                how(wheel, _share_of(percents[number % len(percents)]))
        return begun and not self._stopped_by_input(now_s)

    def _move_wheels(self, now_s: float, *percents: int) -> bool:
        return len(self.encoders) == len(WHEELS) and self._turn(now_s, Wheel.set_duty, percents)

    def _move_to_position(self, now_s: float, motor: int, percent: int, position: int) -> bool:
        if motor not in _SIDES or not self._settings.full_counts_q8 or not self._begin_move(now_s, True):
            return False
        side = _SIDES[motor]
        travel = self._travel(now_s, side)
        way = self._counters[side].travel_at(position, travel) - travel
        for wheel in self._on(side):
            self._wheels[wheel].go_to(self._wheel_travel(wheel) + way, _share_of(percent))
        return not self._stopped_by_input(now_s)

    def set_prescaler(self, now_s: float, encoder: int, value: int) -> bool:
        if encoder in _SIDES:
            self._counters[_SIDES[encoder]].set_prescaler(value, self._travel(now_s, _SIDES[encoder]))
        return encoder in _SIDES

    def _preset_encoder(self, now_s: float, encoder: int, count: int) -> bool:
        if encoder in _SIDES:
            self._counters[_SIDES[encoder]].preset(count, self._travel(now_s, _SIDES[encoder]))
        return encoder in _SIDES

    def _reset_encoders(self, now_s: float) -> bool:
        return all([self._preset_encoder(now_s, encoder, 0) for encoder in _SIDES])


def _share_of(percent: int) -> int:
    return divide(limit(percent, -100, 100) * 10486, 64)
