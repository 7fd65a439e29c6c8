"""Servos on the board's pins: their pulses, their moves, and what they do without a host."""

import pytest

from mrl_driver.protocol.table import BRIDGES, PARAMETER_BY_NAME
from mrl_driver.robot import wirings
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560
from sim_arduino.board.python_board import CHECK_SILENCE_S
from tests.models import model

PULSE_US = 1.0
"""The board's clock sets lengths to 0.5 us; the plant measures times in s since power-on."""
STEP_US = 70  # A pulse of 20 ms and a step of 1/64 s at 2000 us/s
FIRST, SECOND = 1, 2
ON_TIMER_0 = {"bridge": BRIDGES.index("cytron"), **wirings.load("pwm_d5_d6_dir_d4_d7").pins, "i2c": 0}
"""Motors on D5 and D6, so that timer 1 is free."""
ON_TIMERS_0_AND_2 = {**ON_TIMER_0, "pin_right_pwm_a": 11}
"""The clock runs next to PWM."""


@pytest.fixture
def servos(make):
    """Makes a bench whose servo 1 is on D9, and servo 2 on D10."""

    def build(pins=ON_TIMER_0, chip=ATMEGA328P.name, **others):
        robot = model("duo")._replace(chip=chip)
        return make(robot=robot, board={**pins, "pin_servo_1": 9, "pin_servo_2": 10, **others})

    return build


def checked(bench):
    bench.ask("set_check", 1)
    return bench


def pulse(bench, servo):
    return bench.plant.servos[servo].pulse_us(bench.now_s)


@pytest.mark.parametrize(
    ("pins", "others"),
    [
        (ON_TIMER_0, {}),
        (ON_TIMERS_0_AND_2, {}),
        (ON_TIMER_0, {"chip": ATMEGA2560.name, "pin_servo_1": 44, "pin_servo_2": 11}),
        (ON_TIMER_0, {"chip": ATMEGA2560.name, "pin_servo_1": 46, "pin_servo_2": 45}),
    ],
    ids=["free clock", "clock next to PWM", "Mega, two timers", "Mega, one timer"],
)
def test_each_servo_gets_the_pulse_that_it_is_asked_for(servos, pins, others):
    bench = checked(servos(pins, **others))
    assert bench.reply("read_wiring")[0] == 0 and pulse(bench, FIRST) == pulse(bench, SECOND) == 0
    assert bench.reply("set_servo", 1, 600, 0) == (1, 600)
    assert bench.reply("set_servo", 2, 2400, 0) == (2, 2400)
    bench.run(0.1)
    assert pulse(bench, FIRST) == pytest.approx(600, abs=PULSE_US)
    assert pulse(bench, SECOND) == pytest.approx(2400, abs=PULSE_US)


def test_a_mega_has_six_servos(servos):
    six = {f"pin_servo_{number}": pin for number, pin in enumerate((46, 45, 44, 8, 11, 12), 1)}
    on_timer_2 = {"pin_left_pwm_a": 9, "pin_right_pwm_a": 10}
    bench = checked(servos(chip=ATMEGA2560.name, **six, **on_timer_2))
    assert bench.reply("read_wiring")[0] == 0 and bench.reply("read_board")[5] == 63
    lengths = {number: 700 + 100 * number for number in range(1, 7)}
    for number, length in lengths.items():
        assert bench.reply("set_servo", number, length, 0) == (number, length)
    bench.run(0.1)
    assert {number: round(pulse(bench, number)) for number in lengths} == lengths


def test_a_servo_moves_at_its_speed_and_says_where_it_is(servos):
    bench = checked(servos())
    assert bench.reply("set_servo", 1, 1000, 2000) == (1, 1000), "at first it has no place to move from"
    bench.run(0.1)
    started_s = bench.now_s
    assert bench.reply("set_servo", 1, 2000, 2000)[1] == pytest.approx(1000, abs=STEP_US)
    bench.run(0.25)
    assert pulse(bench, FIRST) == pytest.approx(1000 + 2000 * (bench.now_s - started_s), abs=STEP_US)
    bench.run(0.4)
    assert bench.reply("set_servo", 1, 2000, 2000) == (1, 2000)


@pytest.mark.parametrize("released", [0, 1])
@pytest.mark.parametrize("checks", [True, False])
def test_without_a_host_a_servo_stays_or_is_released(servos, released, checks):
    """The link watchdog, which guards moves, is too short for it: a robot that stands hears nothing for longer."""
    bench = servos(servo_release=released)
    bench.checked = True  # these requests have a checksum always
    if checks:
        checked(bench)
    bench.ask("set_watchdog", 300)
    bench.ask("set_servo", 1, 1000, 0)
    bench.ask("set_servo", 1, 2000, 200, wait_s=CHECK_SILENCE_S + 0.1)
    at_us = pulse(bench, FIRST)
    assert at_us == 0 if released else at_us == pytest.approx(1000 + 200 * CHECK_SILENCE_S, abs=STEP_US)
    bench.run(0.1)
    assert pulse(bench, FIRST) == pytest.approx(at_us, abs=PULSE_US)


def test_a_servo_that_is_not_connected_is_refused(servos):
    bench = checked(servos(pin_servo_2=-1))
    assert bench.ask("set_servo", 2, 1500, 0) == bench.ask("set_servo", 6, 1500, 0) == []
    assert bench.counters() == {"unavailable": 2}


def test_a_wiring_that_ends_ends_the_pulses(servos):
    bench = checked(servos())
    bench.ask("set_servo", 1, 1500, 0)
    bench.ask("write_config", PARAMETER_BY_NAME["pin_left_pwm_a"].number, 10)
    assert bench.reply("read_wiring")[0] != 0
    bench.run(0.1)
    assert pulse(bench, FIRST) == 0 and bench.ask("set_servo", 1, 1500, 0) == []
