"""The engine around the chip: time, bytes, and the wires to a plant; cycle counts against the ATmega328P datasheet."""

from types import SimpleNamespace

import pytest

from mrl_driver.errors import SimulatorError
from sim_arduino.avr.machine import MachineCrashed
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.hardware.wiring import SonarPins
from tests.models import model

BYTE_S = 85e-6
FAN = 7
IDLE = 1  # SMCR: sleep enable, idle mode
OVERFLOW_S = 256 * 1024 / 16e6


class Plant:
    """Remembers what it is told."""

    model, bridge, xbee, sonar_pins, servo_pins = model("traxbot"), None, None, SonarPins(), ()
    ranges = SimpleNamespace(wires={})

    def __init__(self):
        self.i2c, self.times, self.pins = {}, [], []

    def advance(self, time_s):
        self.times.append(time_s)

    def dust_edges(self, to_s):
        return []

    def adc_volts(self, channel, time_s):
        return 2.5

    def pin_changed(self, pin, level, time_s):
        self.pins.append((pin, level))


@pytest.fixture
def engine(sketch, close_later):
    """Makes an engine on a program of tests/avr/sketches, 200 us after power-up."""

    def start(name):
        made = close_later(AvrEngine(Plant(), sketch(name)))
        made.advance(200e-6)
        return made

    return start


def poke(engine, name, value):
    engine.machine.poke(engine.machine.symbol(name).address, bytes([value]))


def peek(engine, name):
    symbol = engine.machine.symbol(name)
    return engine.machine.peek(symbol.address, symbol.size)


def test_bytes_come_out_when_their_stop_bit_has_left(engine):
    board = engine("uart.c")
    poke(board, "outgoing_count", 3)
    assert board.advance(200e-6 + 2.5 * BYTE_S) == b"ab"
    assert board.advance(1e-3) == b"c"


def test_the_next_event_of_a_sleeping_chip_is_when_it_can_wake(engine):
    """The overflow of timer 2, 16.4 ms after the program started it."""
    board = engine("sleep.c")
    poke(board, "mode", IDLE)
    board.advance(1e-3)
    assert board.next_event_s == pytest.approx(200e-6 + OVERFLOW_S, abs=20e-6)


def test_a_bootloader_hides_the_reset_flags(engine):
    board = engine("watchdog.c")
    board.advance(200e-6)
    assert peek(board, "flags_at_start") == bytes([0])


def test_an_image_that_saves_no_id_is_refused(sketch):
    with pytest.raises(SimulatorError, match="did not save its robot id"):
        AvrEngine(Plant(), sketch("uart.c"), robot_id=4)


def test_after_a_gap_the_line_has_run_full(engine):
    """Of ten bytes that came meanwhile three are left, the last of them in the shift register."""
    board = engine("uart.c")
    board.gap(0.1, b"0123456789")
    board.advance(0.101)
    assert peek(board, "incoming")[: peek(board, "incoming_count")[0]] == b"019"


def test_a_gap_lets_the_watchdog_bite(engine):
    board = engine("watchdog.c")
    poke(board, "starts", 0)
    poke(board, "stay_off", 0x5A)
    poke(board, "mode", 1)
    board.advance(1e-3)
    board.gap(0.5, b"")
    board.advance(0.501)
    assert peek(board, "starts") == b"\1"


def answer_cycle(board, at: int) -> int:
    """When the pin-change interrupt toggled D13 after D8 changed at cycle `at`."""
    machine = board.machine
    board.set("go", 1)
    machine.run(100e-6)
    machine.watch_pins([13])
    machine.set_pin(8, 0, at)
    machine.run_until(at + 1000)
    return machine.pin_changes()[-1].cycle


def test_interrupt_entry_takes_four_cycles_and_the_jump_three(bench):
    """4 cycles to the vector, 3 for its jmp; an instruction under way ends first (at most 2 cycles here)."""
    board = bench("interrupts.c")
    at = board.machine.cycle + 2001
    assert 7 <= answer_cycle(board, at) - at <= 9


def test_waiting_interrupts_are_served_by_vector_number(bench):
    """Timer 2 compare (7), timer 2 overflow (9), timer 1 compare (11), whatever came first."""
    board = bench("interrupts.c")
    board.set("hold", 1)
    board.set("go", 1)
    board.machine.run(200e-6)
    assert board.bytes("order")[:3] == b"co1"


@pytest.mark.parametrize("mode", [0x03, 0x05, 0x07, 0x0D, 0x0F])
def test_a_sleep_mode_that_is_not_simulated_is_refused(bench, mode):
    board = bench("sleep.c")
    board.set("mode", mode)
    with pytest.raises(MachineCrashed, match=f"SMCR is 0x{mode:02x}, but only idle mode"):
        board.machine.run(100e-6)


def test_an_interrupt_that_waits_at_sleep_wakes_the_chip(bench):
    """SEI lets SLEEP follow before any interrupt: the chip sleeps and wakes at once, with no other event."""
    board = bench("sleep.c")
    board.set("pending", 1)
    board.set("mode", IDLE)
    board.machine.run(100e-6)
    assert board.get("wakes") == 1


def test_a_skip_jumps_over_an_adiw_of_any_number(bench):
    """First the five skips that are taken, then those that are not; one cycle more for a skip, two for `adiw`."""
    board = bench("skips.c")
    assert list(board.bytes("sums")) == [1] * 5 + [32] * 5
    cycles = board.bytes("cycles")
    assert [cycles[5 + i] - cycles[i] for i in range(5)] == [1] * 5


@pytest.mark.parametrize(("place", "word"), [("from_table", 0xFC00), ("from_call", 0x117D)])
def test_what_looks_like_such_a_skip_is_read_as_it_is(bench, place, word):
    """Tables, and the targets of calls."""
    assert bench("skips.c").get(place) == word
