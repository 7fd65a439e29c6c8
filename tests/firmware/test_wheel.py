"""The firmware's control of a wheel gives, period by period, the numbers of the emulated board's, at all limits."""

import ctypes
import functools
import math
import random
from typing import Any, Dict, List, Tuple

import pytest

from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BRIDGES, PARAMETERS, PINS, SETTINGS
from sim_arduino.board import parameter_store
from sim_arduino.board.bridge_control import levels
from sim_arduino.board.wheel import SpeedEstimate, Wheel, WheelWatch
from sim_arduino.board.wheel_settings import FULL, PERIOD_TICKS, WheelSettings, settings_of
from sim_arduino.hardware.encoders import EncoderCounter
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
        eeprom = bytearray(parameter_store.image(parameter_store.defaults(DUO)))
        self.config = parameter_store.Config(eeprom, PINS)
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


EDGES: Dict[str, List[int]] = {
    "full_speed": [1, 2, 4, 170, 1000],
    "gearbox": [1, 9, 100, 3000, 30909, 30910, 32767],
    "encoder_counts": [1, 2, 3, 16, 1100, 11333, 11334],
    "wheel_radius": [1, 2, 100, 3250, 32767],
    "axis_radius": [1, 100, 6249, 6250, 7500, 7813, 30000, 32767],
    "no_encoders": [0, 1],
    "kp": [0, 1, 354, 396, 479, 521, 992, 993, 994, 1000, 30000, 32767],
    "ki": [0, 1, 81, 243, 350, 457, 512, 1536, 20000, 32767],
    "friction_duty": [0, 1, 53, 319, 431, 444, 500],
    "ramp_time": [0, 1, 2, 3, 6, 7, 37, 999, 32767],
    "reversal_pause": [0, 1, 99, 302, 307, 317, 322, 1000],
}
"""Ends, and values at which one unit of a factor, or of the rounding, gives another number."""
EXACT = [(8, 31438, 193), (2, 24085, 196), (4, 26195, 8)]
"""Full speed, gearbox and encoder counts: periods whose counts divide their constants, or one more, without a rest."""


@pytest.mark.parametrize("name", EDGES)
def test_settings_are_those_of_the_parameters(name):
    for value in EDGES[name]:
        parts = Parts(**{**KIT, name: value})
        assert parts.found == parts.settings, value


def test_settings_of_any_parameters():
    chance = random.Random(1)
    names, wide = ("full_speed", "gearbox", "encoder_counts"), {"wheel_radius": 32767, "axis_radius": 1}
    exact = [{**dict(zip(names, each)), **wide} for each in EXACT]
    rows = [row for row in SETTINGS if row.name in EDGES]
    drawn = [{row.name: int(row.high ** chance.random()) for row in rows} for _ in range(600)]
    for values in exact + drawn:
        parts = Parts(**{**KIT, **values})
        assert parts.found == parts.settings, values


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


def test_a_wheel_that_runs_down_slowly_after_a_reversal_does_not_count_in_the_wrong_direction():
    """In two of three periods it has no count."""
    parts = Parts(**KIT)
    for period in range(60):
        moved = -1 if period % 3 == 0 else 0
        assert not parts.native.pc_watch_update(1, 0, moved, bool(moved), -100, True), period


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


def test_pins_are_those_of_the_truth_table():
    parts = Parts(**KIT)
    for number, chip in enumerate(BRIDGES):
        for case in range(4 * 256):
            backward, coast, duty = bool(case & 1), bool(case & 2), case >> 2
            pwm_a, pwm_b, logic = levels(chip, backward, duty, coast)
            found = parts.native.pc_bridge_levels(number, backward, duty, coast)
            assert found == pwm_a << 16 | pwm_b << 8 | logic, (chip, backward, duty, coast)


RATES = {"l298n": 0, "l298p": 0, "tb6612": 2, "drv8833": 2, "vnh5019": 1, "cytron": 1, "bts7960": 1}


def test_each_chip_gets_the_fastest_pwm_that_it_bears():
    """0 is 3.9 kHz, 1 is 7.8 kHz, 2 is 31.4 kHz; HARDWARE.md has the chips."""
    parts = Parts(**KIT)
    assert {chip: parts.native.pc_bridge_rate(BRIDGES.index(chip)) for chip in RATES} == RATES


SLOWEST_COUNTS = {
    "full_speed": 4,
    "gearbox": 9319,
    "encoder_counts": 8,
    "wheel_radius": 32767,
    "axis_radius": 1,
}
"""50 counts a second at full speed: 64/256 of a count in a period."""
FASTEST_COUNTS = {"full_speed": 25, "gearbox": 12823, "encoder_counts": 480}
"""25 600 counts a second at full speed: 32767/256 counts in a period."""
SLOWEST_RIM = {
    "full_speed": 4,
    "wheel_radius": 15279,
    "gearbox": 2000,
    "encoder_counts": 17000,
    "axis_radius": 6250,
}
"""64 mm/s at full speed: 65535/256 of a share for each mm/s, and 65535/4096 for each mrad/s; 340 000 counts a turn."""


@pytest.mark.parametrize(
    "good, bad",
    [
        (SLOWEST_COUNTS, {"gearbox": 9318}),
        (FASTEST_COUNTS, {"gearbox": 32395, "encoder_counts": 190}),
        (SLOWEST_RIM, {"full_speed": 5, "wheel_radius": 12223, "axis_radius": 1}),
        (SLOWEST_RIM, {"axis_radius": 6251}),
        (SLOWEST_RIM, {"gearbox": 2125, "encoder_counts": 16001}),
    ],
    ids=["slowest counts", "fastest counts", "slowest rim", "slowest turn", "most counts a turn"],
)
def test_settings_end_at_the_last_number_that_can_be_controlled(good, bad):
    parts = Parts(**{**KIT, **good})
    assert parts.found is not None and parts.found == parts.settings
    assert Parts(**{**KIT, **good, **bad}).found is None


class Watched:
    """The watch of a wheel, and its twin, which must say the same."""

    def __init__(self, counted: int = 16, **values: int) -> None:
        """`counted`: periods in which the encoder has counted before."""
        self.parts, self.twin = Parts(**{**KIT, **values}), WheelWatch()
        self.run(counted, direction=0, moved=1)

    def run(
        self,
        periods: int,
        moved: int = 0,
        direction: int = 1,
        duty: int = FULL,
        speed: int = 0,
        edges: bool = False,
        controlled: bool = True,
    ) -> List[str]:
        """The reason of each period."""
        reasons = []
        for _ in range(periods):
            args = (direction, duty, moved, edges or moved != 0, speed, controlled)
            reasons.append(STOP_REASONS[self.parts.native.pc_watch_update(*args)])
            assert reasons[-1] == self.twin.update(self.parts.settings, *args)
        return reasons


@pytest.mark.parametrize("counted, reason, periods", [(15, "encoder", 20), (16, "wheel_blocked", 40)])
def test_an_encoder_that_has_counted_16_times_is_not_silent(counted, reason, periods):
    """A silent one stops the motors after 20 periods at full duty, a blocked wheel after 40."""
    assert Watched(counted).run(periods) == ["none"] * (periods - 1) + [reason]


def test_a_wheel_stays_blocked_as_long_as_it_stands():
    """Also after 256 periods."""
    assert Watched().run(300)[39:] == ["wheel_blocked"] * 261


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("speed, wrong_after", [(0, 17), (1, 117)])
def test_a_wheel_that_still_turns_back_gets_half_a_second_before_its_counts_are_wrong(
    direction, speed, wrong_after
):
    """The slightest measured speed decides.  Counts are wrong after 16 periods, patience is 100."""
    against = -direction
    reasons = Watched().run(wrong_after, moved=against, direction=direction, duty=0, speed=against * speed)
    assert reasons == ["none"] * (wrong_after - 1) + ["encoder"]


def test_a_count_to_and_fro_is_forgotten():
    """The 16 periods begin with the next wrong count."""
    watched = Watched()
    for moved in (-1, 1, 0, 0, 0, 0, 0, 0, -1):
        assert watched.run(1, moved=moved, duty=0) == ["none"]
    watched.run(1, moved=-1, duty=0)
    assert watched.run(15, duty=0) == ["none"] * 14 + ["encoder"]


@pytest.mark.parametrize("last_duty, periods", [(FULL, 128), (FULL // 64 * 63, 129)])
def test_a_slow_wheel_is_blocked_when_it_should_have_counted_32(last_duty, periods):
    """At full duty it counts 64/256 in a period; 1/256 of a count less needs another period."""
    watched = Watched(**SLOWEST_COUNTS)
    watched.run(50)
    watched.run(1, moved=3)  # begins again
    assert watched.run(127) == ["none"] * 127
    reasons = watched.run(1, duty=last_duty) + watched.run(1)
    assert reasons.index("wheel_blocked") == periods - 128


class Turned:
    """A wheel, and its twin, which must have the same output in each period."""

    def __init__(self, **values: int) -> None:
        self.parts, self.twin = Parts(**{**KIT, **values}), Wheel()
        self.tick = self.edge_tick = 0

    def give(self, command: str, *args: int) -> None:
        getattr(self.twin, command)(*args)
        self.parts.is_driven_by(command, *args)

    def run(self, periods: int, moved: int = 0) -> List[int]:
        """The level of each period; the last edge of a period is at its end."""
        levels = []
        for _ in range(periods):
            self.tick = self.tick + PERIOD_TICKS & 0xFFFF
            self.edge_tick = self.tick if moved else self.edge_tick
            self.reason = STOP_REASONS[self.parts.native.pc_wheel_update(moved, self.edge_tick, self.tick)]
            assert self.reason == self.twin.update(self.parts.settings, moved, self.edge_tick, self.tick)
            levels.append(self.parts.native.pc_wheel_level())
            assert levels[-1] == self.twin.level()
            assert self.direction == self.twin.last_direction
        return levels

    @property
    def direction(self) -> int:
        return int(self.parts.native.pc_wheel_last_direction())

    def speed_of(self, counts: int) -> int:
        """The measured speed while the wheel counts this much in each period."""
        return int(self.parts.settings.share_per_count_tick * counts // PERIOD_TICKS)


OPEN = {"kp": 0, "ki": 0, "friction_duty": 0}  # No control: the duty is the setpoint
SLOW_INTEGRAL = {**OPEN, "ki": 3}  # An error of 1 changes the integral by the least that it has
FAST_INTEGRAL = {**OPEN, "ki": 32767}
RAMP_TIME = 919
"""[ms]; the setpoint, which has eight more bits, is one below a whole share after the first period."""


def test_a_new_wheel_turns_backward_without_a_pause():
    wheel = Turned(reversal_pause=1000)
    wheel.run(1)
    wheel.give("set_speed", -1000)
    assert wheel.run(1)[0] < 0


@pytest.mark.parametrize("share", [1, -1])
def test_the_least_duty_drives_in_its_direction(share):
    """1/16384 of 255 levels: one in 65 periods."""
    wheel = Turned()
    wheel.give("set_duty", share)
    assert sum(wheel.run(65)) == share and wheel.direction == share


@pytest.mark.parametrize("speed", [1, -1])
def test_the_sign_of_the_speed_to_a_position_does_not_matter(speed):
    wheel = Turned(**OPEN)
    wheel.give("go_to", 100, speed)
    assert sum(wheel.run(65)) == 1


def test_the_speed_to_a_position_grows_no_more_beyond_5000_counts():
    wheel = Turned(**OPEN, **FASTEST_COUNTS)
    wheel.give("go_to", 5000, FULL)
    near = wheel.run(50)
    wheel.give("go_to", 50_000, FULL)
    assert abs(sum(wheel.run(50)) - sum(near)) <= 1 and near[0] < 255


@pytest.mark.parametrize("end", ["a new mode", "a stop", "a rest"])
def test_the_integral_begins_at_zero_after(end):
    wheel = Turned(**SLOW_INTEGRAL)
    wheel.give(*(("set_duty", 5000) if end == "a new mode" else ("set_speed", wheel.speed_of(10) + 100)))
    wheel.run(5, moved=10)
    if end == "a stop":
        wheel.give("stop")
    elif end == "a rest":
        wheel.give("set_speed", 0)
        wheel.run(1, moved=10)
    watch_the_least_error(wheel)


def watch_the_least_error(wheel: Turned) -> None:
    """An error of -1 in one period makes an integral of zero negative: the duty is one less from then on."""
    speed = wheel.speed_of(10)
    wheel.give("set_speed", speed - 1)
    wheel.run(1, moved=10)
    wheel.give("set_speed", speed)
    levels = wheel.run(128, moved=10)
    assert sum(levels) == pytest.approx(128 * 255 * (speed - 1) / FULL, abs=1)


def test_the_ramp_begins_at_zero_after_a_stop():
    wheel = Turned(ramp_time=RAMP_TIME)
    wheel.give("set_duty", FULL)
    wheel.run(50)
    wheel.give("stop")
    wheel.give("set_duty", FULL)
    assert max(wheel.run(RAMP_TIME // 5)) < 255


def test_a_stop_between_ramp_and_control_leaves_the_motor_off():
    """Of a wheel that stands, so that nothing but friction is to be overcome."""
    wheel = Turned()
    wheel.give("set_speed", FULL // 4)
    assert wheel.run(1, moved=0)[-1] > 0
    for step in ("stop", "control"):
        wheel.parts.is_driven_by(step)
    assert wheel.parts.native.pc_wheel_level() == 0


def test_a_wheel_is_supervised_to_the_end_of_the_period_of_its_stop():
    wheel = Turned()
    wheel.give("set_speed", FULL // 4)
    wheel.run(2)
    wheel.run(16, moved=-5)
    assert wheel.reason == "none"
    wheel.give("stop")
    wheel.run(1, moved=-5)
    assert wheel.reason == "encoder"


def test_the_least_error_does_not_wind_the_integral_up_at_full_duty():
    wheel = Turned(**FAST_INTEGRAL)
    wheel.give("set_speed", wheel.speed_of(10) + 1)
    assert wheel.run(100)[-1] == 255
    wheel.run(40, moved=10)
    wheel.give("set_speed", 3000)
    assert wheel.run(60, moved=10)[-1] == 0


@pytest.mark.parametrize("speed, before, after", [(1, -45, 1000), (FULL, 45, -1000)])
def test_the_integral_ends_at_full_duty(speed, before, after):
    """The wheel winds it up, then jumps, so that the proportional part shows it in one period.

    The rest of that period's output comes with the next ones.
    """
    wheel = Turned(**{**FAST_INTEGRAL, "kp": 1})
    wheel.give("set_speed", speed)
    wheel.run(30, moved=before)
    wheel.run(1, moved=after)
    wheel.give("set_duty", 100)
    wheel.run(128)
