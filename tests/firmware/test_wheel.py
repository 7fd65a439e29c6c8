"""The firmware's control of a wheel gives, period by period, the numbers of the emulated board's."""

import ctypes
import functools
import math
import random
from typing import Any, Dict, List, Tuple

import pytest

from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BRIDGES, PARAMETERS
from sim_arduino.board import parameter_store
from sim_arduino.board.bridge.bridge_levels import levels
from sim_arduino.board.bridge.speed_estimate import SpeedEstimate
from sim_arduino.board.bridge.wheel import Wheel
from sim_arduino.board.bridge.wheel_settings import FULL, PERIOD_TICKS, WheelSettings, settings_of
from sim_arduino.board.bridge.wheel_watch import WheelWatch
from sim_arduino.hardware.encoder_counter import EncoderCounter
from tests.firmware.pc_board import BRIDGE, load

KIT = {"wiring": 1, "kp": 1600, "ki": 23700, "friction_duty": 53, "ramp_time": 0, "full_speed": 170}
RAMPED = {**KIT, "ramp_time": 1000, "reversal_pause": 100}
WEAK = {**KIT, "kp": 100, "ki": 0, "friction_duty": 0}
DUO = 23


@functools.lru_cache(maxsize=None)
def shared() -> Any:
    """The library of all tests; each begins with `Parts`."""
    return load(BRIDGE)


class Parts:
    """The C++ parts with the settings of a duo and other values for some of its parameters."""

    def __init__(self, **values: int) -> None:
        self.native = shared()
        self.native.pc_wheel_parts_start()
        self.config = parameter_store.Config(bytearray(parameter_store.image(parameter_store.defaults(DUO))))
        for name, value in values.items():
            self.config[name] = value
        found = (ctypes.c_uint32 * len(WheelSettings._fields))()
        parameters = (ctypes.c_int16 * len(PARAMETERS))(*self.config.values)
        good = self.native.pc_settings(parameters, found)
        self.found = WheelSettings(*found) if good else None
        settings = settings_of(self.config)
        self.settings: Any = settings
        self.native.pc_wheel_travel.restype = ctypes.c_int32

    def is_driven_by(self, command: str, *args: int) -> None:
        getattr(self.native, f"pc_wheel_{command}")(*args)


# ---- settings

EDGES: Dict[str, List[int]] = {
    "full_speed": [1, 2, 4, 170, 1000],
    "gearbox": [1, 9, 100, 3000, 30909, 30910, 32767],
    "encoder_counts": [1, 2, 3, 16, 1100, 11333, 11334],
    "wheel_radius": [1, 2, 100, 3250, 32767],
    "axis_radius": [1, 100, 7500, 30000, 32767],
    "kp": [0, 1, 1000, 30000, 32767],
    "ki": [0, 1, 20000, 32767],
    "friction_duty": [0, 1, 53, 500],
    "ramp_time": [0, 1, 999, 32767],
    "reversal_pause": [0, 1, 99, 1000],
}


@pytest.mark.parametrize("name", EDGES)
def test_settings_are_those_of_the_parameters(name):
    for value in EDGES[name]:
        parts = Parts(**{**KIT, name: value})
        assert parts.found == parts.settings, value


def test_settings_of_any_parameters():
    chance = random.Random(1)
    for _ in range(600):
        values = {row.name: int(row.high ** chance.random()) for row in PARAMETERS if row.name in EDGES}
        parts = Parts(**{**KIT, **values})
        assert parts.found == parts.settings, values


# ---- one wheel


def turn(parts: Parts, seed: int, periods: int, sound: float = 1.0) -> None:
    """A wheel with commands at random times, on a motor that follows its output as far as it is sound."""
    chance, wheel = random.Random(seed), Wheel()
    speed, way, edge_tick, tick = 0.0, 0.0, 0, chance.randrange(1 << 16)
    blocked, reversed_ = False, False
    for period in range(periods):
        if chance.random() < 0.02:
            command(parts, wheel, chance)
        if chance.random() < 0.01:
            blocked, reversed_ = chance.random() > sound, chance.random() > sound
        level = wheel.level()
        assert parts.native.pc_wheel_level() == level, period
        speed += (level / 255 * 25 - speed) * 0.15 + chance.gauss(0, 0.05)
        before = int(way // 1)
        way += 0.0 if blocked else speed
        moved = (int(way // 1) - before) * (-1 if reversed_ else 1)
        tick = (tick + PERIOD_TICKS) & 0xFFFF
        if moved or (blocked and chance.random() < 0.3):
            edge_tick = (tick - chance.randrange(PERIOD_TICKS)) & 0xFFFF
        reason = wheel.update(parts.settings, moved, edge_tick, tick)
        assert STOP_REASONS[parts.native.pc_wheel_update(moved, edge_tick, tick)] == reason, period
        assert parts.native.pc_wheel_last_direction() == wheel.last_direction
        assert parts.native.pc_wheel_travel() == wheel.travel
        if reason != "none" and chance.random() < 0.5:
            wheel.stop()
            parts.is_driven_by("stop")


def command(parts: Parts, wheel: Wheel, chance: random.Random) -> None:
    kind = chance.choice(("set_speed", "set_speed", "set_duty", "go_to", "stop"))
    share = int(chance.choice((0, 1, 100, FULL // 8, FULL)) * chance.uniform(-1, 1))
    args: Tuple[int, ...] = () if kind == "stop" else (share,)
    if kind == "go_to":
        args = (wheel.travel + int(chance.choice((5, 300, 8000)) * chance.uniform(-1, 1)), share)
    getattr(wheel, kind)(*args)
    parts.is_driven_by(kind, *args)


@pytest.mark.parametrize("values", [KIT, RAMPED, WEAK], ids=["kit", "ramped", "weak"])
@pytest.mark.parametrize("sound", [1.0, 0.6])
def test_a_wheel_turns_as_the_emulated_one(values, sound):
    """Each level, travel and reason of 2500 periods with speeds, duties, positions, stops and faults."""
    turn(Parts(**values), 7, 2500, sound)


@pytest.mark.parametrize("speed", [1, -1])
def test_a_wheel_that_is_not_served_its_speed_uses_all_its_integral(speed):
    """It stands in the integral's way for 400 periods, then it lets go."""
    parts, wheel = Parts(**{**KIT, "ki": 32767, "kp": 0, "friction_duty": 0, "full_speed": 1000}), Wheel()
    for period in range(600):
        if period in (0, 400):
            share = speed * (FULL // 3 if period == 0 else 60)
            wheel.set_speed(share)
            parts.is_driven_by("set_speed", share)
        moved = speed * (2 if period % 3 else 3) * (period < 450)
        tick = period * PERIOD_TICKS & 0xFFFF
        wheel.update(parts.settings, moved, tick, tick)
        parts.native.pc_wheel_update(moved, tick, tick)
        assert parts.native.pc_wheel_level() == wheel.level(), period


# ---- its supervision


def test_a_wheel_is_watched_as_the_emulated_one():
    """20 000 periods of drives that change, wheels that stand, play, turn in either direction, with edges or none."""
    chance, parts, watch = random.Random(3), Parts(**KIT), WheelWatch()
    direction, duty, drift, edges, controlled, speed = 0, 0, 0.0, 0.0, True, 0
    for period in range(20_000):
        if chance.random() < 0.02:
            direction = chance.choice((-1, 0, 1, 1))
            duty = chance.choice((0, FULL // 2 - 1, FULL // 2, FULL // 16 * 15 - 1, FULL // 16 * 15, FULL))
            drift = chance.choice((0.0, 0.0, 0.02, -0.2, 1.0, 20.0)) * chance.choice((1, 1, -1))
            edges, controlled = chance.choice((0.0, 0.5, 1.0)), chance.random() < 0.7
            speed = chance.choice((-100, -1, 0, 1, 100))
        if chance.random() < 1e-3:
            parts.native.pc_wheel_parts_start()
            watch = WheelWatch()
        moved = round(drift * chance.uniform(0, 2))
        if abs(drift) < 1:
            moved = round(math.copysign(chance.random() < abs(drift), drift))
        seen = bool(moved) or chance.random() < edges
        reason = watch.update(parts.settings, direction, duty, moved, seen, speed, controlled)
        found = parts.native.pc_watch_update(direction, duty, moved, seen, speed, controlled)
        assert STOP_REASONS[found] == reason, period


# ---- its speed


def test_a_speed_is_estimated_as_by_the_emulated_board():
    """20 000 samples of wheels that stand, creep, cruise, race and turn back."""
    chance, parts, estimate = random.Random(5), Parts(**KIT), SpeedEstimate()
    tick = edge_tick = 0
    speed = way = 0.0
    for period in range(20_000):
        if chance.random() < 0.01:
            speed = chance.choice((0.0, 0.01, 0.1, 0.5, 1.0, 4.0, 20.0, 90.0, 300.0)) * chance.choice((1, -1))
        before = int(way // 1)
        way += speed * chance.uniform(0.8, 1.2)
        tick = (tick + PERIOD_TICKS) & 0xFFFF
        if int(way // 1) != before:
            edge_tick = (tick - chance.randrange(PERIOD_TICKS)) & 0xFFFF
        count = int(way // 1) & 0xFFFF
        estimate.update(parts.settings, count, edge_tick, tick)
        assert parts.native.pc_estimate_update(count, edge_tick, tick) == estimate.speed, period


# ---- its counter


def test_a_counter_reads_as_the_emulated_one():
    chance, parts, counter, travel = random.Random(9), Parts(**KIT), EncoderCounter(), 0
    for step in range(4000):
        travel += round(chance.choice((1, 10, 1000)) * chance.gauss(0, 1))
        if chance.random() < 0.02:
            power = chance.randrange(5)
            counter.set_prescaler(power, travel)
            parts.native.pc_counter_prescale(power, travel)
        if chance.random() < 0.02:
            count = chance.randrange(-32768, 32768)
            counter.preset(count, travel)
            parts.native.pc_counter_preset(count, travel)
        assert parts.native.pc_counter_read(travel) == counter.read(travel), step
        goal = chance.randrange(-32768, 32768)
        assert parts.native.pc_counter_travel_at(goal, travel) == counter.travel_at(goal, travel), step


# ---- its pins


def test_pins_are_those_of_the_truth_table():
    parts = Parts(**KIT)
    for number, chip in enumerate(BRIDGES):
        for case in range(4 * 256):
            backward, coast, duty = bool(case & 1), bool(case & 2), case >> 2
            pwm_a, pwm_b, logic = levels(chip, backward, duty, coast)
            found = parts.native.pc_bridge_levels(number, backward, duty, coast)
            assert found == pwm_a << 16 | pwm_b << 8 | logic, (chip, backward, duty, coast)


RATES = {"l298n": 0, "tb6612": 2, "drv8833": 2, "vnh5019": 1, "cytron": 1, "bts7960": 1}


def test_each_chip_gets_the_fastest_pwm_that_it_bears():
    """0 is 3.9 kHz, 1 is 7.8 kHz, 2 is 31.4 kHz; HARDWARE.md has the chips."""
    parts = Parts(**KIT)
    assert {chip: parts.native.pc_bridge_rate(BRIDGES.index(chip)) for chip in RATES} == RATES
