"""The chip's own parts in the images, at their limits: queues, converter, I2C lines, watchdog."""

from pathlib import Path
from typing import Callable, Iterator, List

import pytest

from mrl_driver.protocol import REPLIES, FrameDecoder
from mrl_driver.protocol.table import PARAMETER_BY_NAME
from sim_arduino.avr.machine import UNO_HZ, AvrMachine
from tests.firmware.test_image_hbridge import DRIVEN, ENCODERS, HALF_DUTY, TB6612, Board
from tests.firmware.test_image_xbee import frames, say
from tests.firmware.test_xbee import received
from tests.long.bench.firmware_board import Rig, hang, mend, request

BUILD = Path(__file__).resolve().parents[2] / "build" / "firmware"
READY_S, CONVERTED_S = 0.12, 0.5
SDA, SCL = 18, 19
BYTE_S = 10 / 117647
QUEUE = 64  # Received bytes that wait for the loop
UCSR0C, ADMUX, DDRC, PORTC = 0xC2, 0x7C, 0x27, 0x28
TWSR, TWI_VECTOR = 0xB9, 4 * 24
UCSR0B, ROOM_INTERRUPT, ROOM_VECTOR, GPIOR0 = 0xC1, 0x20, 4 * 19, 0x3E
FORMAT_8N1 = 0x06


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig(BUILD / "mrl_firmware.elf")
    made.run(READY_S)
    yield made
    made.close()


def run_while(machine: AvrMachine, condition: Callable[[], object]) -> int:
    """Runs instruction by instruction while it holds; the cycle.

    Raises:
        TimeoutError: it holds for longer.
    """
    last = machine.cycle + 0.5 * UNO_HZ
    while condition():
        if machine.cycle > last:
            raise TimeoutError("nothing has changed for 0.5 s of simulated time")
        machine.run_until(max(machine.next_event_cycle, machine.cycle + 1))
    return machine.cycle


def register(rig: Rig, address: int) -> int:
    return rig.machine.peek(address)[0]


# ---- the line from the host


@pytest.mark.parametrize("more, lost", [(0, 0), (1, 1), (255, 255), (260, 255)])
def test_bytes_without_a_place_in_the_queue_are_counted(rig, more, lost):
    """At most 255 of them, while the loop stands still for less than the watchdog's patience."""
    hang(rig.machine)
    end = rig.machine.send(bytes(QUEUE + more))
    rig.machine.run_until(end + int(BYTE_S * UNO_HZ))
    mend(rig.machine)
    rig.run(0.01)
    assert rig.refused()["overrun"] == lost


def test_the_line_has_8n1_whatever_a_bootloader_has_left():
    made = Rig(BUILD / "mrl_firmware.elf")
    made.machine.poke(UCSR0C, b"\x3e")
    made.run(READY_S)
    assert register(made, UCSR0C) == FORMAT_8N1
    made.close()


def test_room_in_the_queue_is_news_at_its_end_and_each_eight_bytes(rig):
    """The loop, which stands still here, wakes up when 0, 7 or 15 bytes are waiting, or 8 more."""
    machine = rig.machine
    machine.run_until(machine.send(request("read_counters")))
    machine.run(300e-6)
    hang(machine)
    news: List[bool] = []
    while machine.peek(UCSR0B)[0] & ROOM_INTERRUPT:
        run_while(machine, lambda: machine.pc != ROOM_VECTOR)
        machine.poke(GPIOR0, b"\0")
        run_while(machine, lambda: not machine.interrupts_on)
        news.append(bool(machine.peek(GPIOR0)[0] & 1))
    assert len(news) > 16
    assert [left for left, each in enumerate(reversed(news)) if each] == [0, *range(7, len(news), 8)]


# ---- the converter


def test_the_supply_is_the_converters_reference(rig):
    rig.run(CONVERTED_S)
    assert register(rig, ADMUX) >> 6 == 1


# ---- the I2C lines


def test_a_hanging_bus_gets_nine_clocks_of_at_most_100_khz_and_a_stop(rig):
    """A slave lets go at the fifth clock; SDA then rises while SCL is high.  The slowest slaves bear 5 us a level."""
    rig.machine.watch_pins([SDA, SCL])
    rig.machine.hang_bus("sda", release_clocks=5)
    rig.machine.pin_changes()
    rig.run(20e-3)
    found = rig.machine.pin_changes()
    cycles = [change.cycle for change in found if change.pin == SCL]
    assert min(rig.microseconds(b - a) for a, b in zip(cycles, cycles[1:])) >= 5.0
    changes = [(change.pin, change.level) for change in found]
    clocks = [change for change in changes if change[0] == SCL]
    assert clocks == 10 * [(SCL, 0), (SCL, 1)]
    assert changes[-4:] == [(SCL, 0), (SDA, 0), (SCL, 1), (SDA, 1)]


def test_an_error_on_the_bus_is_a_hanging_bus(rig):
    """A start or stop amid a byte has the status 0."""
    run_while(rig.machine, lambda: rig.machine.pc != TWI_VECTOR)
    rig.machine.watch_pins([SCL])
    rig.machine.pin_changes()
    rig.machine.poke(TWSR, b"\0")
    rig.run(2e-3)
    assert [change.level for change in rig.machine.pin_changes()] == 10 * [0, 1]


@pytest.mark.parametrize("line", [None, "sda"])
def test_both_lines_of_the_bus_are_pulled_up_inputs(rig, line):
    rig.machine.hang_bus(line, release_clocks=8)
    rig.run(0.05)
    lines = 1 << SDA - 14 | 1 << SCL - 14
    assert (register(rig, PORTC) & lines, register(rig, DDRC) & lines) == (lines, 0)


# ---- the encoders' interrupts

FORWARD = {(0, 0): 1, (0, 1): -1, (1, 1): 1, (1, 0): -1}
"""What an edge of channel A counts, by the levels of A and B before it."""


@pytest.mark.parametrize("wheel", [0, 1])
@pytest.mark.parametrize("levels", FORWARD)
def test_the_first_edge_after_power_up_counts(levels, wheel):
    board = Board(DRIVEN)
    pins = ENCODERS[2 * wheel : 2 * wheel + 2]
    for pin, level in zip(pins, levels):
        board.machine.set_pin(pin, level)
    board.machine.power_cycle(1)
    board.boot()
    board.machine.set_pin(pins[0], 1 - levels[0])
    board.run(1e-3)
    assert (board.counts()[wheel], board.status()["impossible"]) == (FORWARD[levels], 0)
    board.close()


SAMPLE_VECTOR, TICK, SAMPLE_TICKS = 4 * 12, 1024, 78
READ_CYCLES = 30  # From the sample's vector to its reading of the clock, at most
PCICR = 0x68


@pytest.fixture
def bridge() -> Iterator[Board]:
    board = Board(DRIVEN)
    yield board
    board.close()


def go_to(machine: AvrMachine, pc: int) -> int:
    """Runs to an address; the cycle."""
    return run_while(machine, lambda: machine.pc != pc)


@pytest.mark.parametrize("late_ticks", [1, 76, 77, 78, 79, 200])
def test_samples_go_on_however_late_one_is(bridge, late_ticks):
    """Without interrupts for so long; the next one comes within a period, and a whole tick ahead at least."""
    machine = bridge.boot().machine
    due = go_to(machine, SAMPLE_VECTOR) + SAMPLE_TICKS * TICK
    for half in (0, 1):
        machine.run_until(due - 2000)
        machine.stall_until(due + late_ticks * TICK + half * TICK // 2)
        late = go_to(machine, SAMPLE_VECTOR)
        machine.run_until(machine.cycle + 1000)
        due = go_to(machine, SAMPLE_VECTOR)
        assert TICK <= due - late <= (SAMPLE_TICKS + 1) * TICK + READ_CYCLES
        due += SAMPLE_TICKS * TICK


@pytest.mark.parametrize("wheel, change", [(0, 4), (1, 1)])
@pytest.mark.parametrize("edges, masked", [(249, False), (255, True)])
def test_more_than_250_edges_between_two_samples_mask_the_encoder(bridge, wheel, change, edges, masked):
    """Some edges come while interrupts are off, and count together."""
    machine = bridge.boot().machine
    begun = go_to(machine, SAMPLE_VECTOR)
    machine.plan_edges(ENCODERS[2 * wheel], [begun + 100 + 300 * edge for edge in range(edges)])
    machine.run_until(begun + 200 + 300 * edges)
    assert bool(machine.peek(PCICR)[0] & change) != masked


NEW_WIRING = request("write_config", PARAMETER_BY_NAME["bridge"].number, TB6612)


@pytest.mark.parametrize("line", [b"@13e", NEW_WIRING], ids=["stop", "new wiring"])
def test_interrupts_are_off_for_a_moment_only(bridge, line):
    """A byte of the host takes 85 us, and the receiver has room for two."""
    machine = bridge.boot().configure().machine
    bridge.say(HALF_DUTY)
    end = machine.send(line)
    off, longest = machine.cycle, 0
    while machine.cycle < end + 50_000:
        on = machine.interrupts_on
        machine.run_until(max(machine.next_event_cycle, machine.cycle + 1))
        if on:
            off = machine.cycle
        longest = max(longest, machine.cycle - off)
    assert longest < 85e-6 * UNO_HZ


# ---- the dust sensor's input

ENVIRONMENT = BUILD / "mrl_firmware_environment.elf"
DUST, HEATER, FAN = 8, 15, 7
TCCR1B, NOISE_CANCELLER = 0x81, 0x80
LITRES = 0.2832


def dusty() -> AvrMachine:
    machine = AvrMachine(ENVIRONMENT)
    machine.set_pin(DUST, 1)
    machine.run(0.1)
    return machine


def test_the_dust_sensors_input_has_its_noise_canceller_on():
    machine = dusty()
    assert machine.peek(TCCR1B)[0] & NOISE_CANCELLER
    machine.close()


def pulses(machine: AvrMachine, low_s: float, period_s: float, count: int) -> None:
    begin = machine.cycle
    for n in range(count):
        machine.set_pin(DUST, 0, begin + int((n + 0.5) * period_s * UNO_HZ))
        machine.set_pin(DUST, 1, begin + int(((n + 0.5) * period_s + low_s) * UNO_HZ))


def answer(machine: AvrMachine, asked: bytes):
    machine.sent()
    machine.send(asked)
    machine.run(0.02)
    return FrameDecoder(REPLIES).feed(bytes(byte.data for byte in machine.sent()))[0].args


def test_a_long_pulse_counts_in_full():
    """100 ms low each second: 10 % of the time; the firmware reads the time several times in a pulse."""
    machine = dusty()
    pulses(machine, 0.1, 1.0, 4)
    machine.run(3.9)
    wanted = (1.1 * 10**3 - 3.8 * 10**2 + 520 * 10) / LITRES
    assert answer(machine, b"@21e")[0] == pytest.approx(wanted, rel=0.03)
    machine.close()


def test_dust_pulses_beside_a_full_stream_of_commands():
    """The capture register holds the edge's time until the interrupt comes."""
    machine = dusty()
    machine.send(b"@30e" * 2500)
    pulses(machine, 1.5e-3, 0.05, 20)
    machine.run(1.2)
    wanted = (1.1 * 15.6 - 3.8 * 6.25 + 520 * 2.5) / LITRES
    assert answer(machine, b"@21e")[0] == pytest.approx(wanted, rel=0.15)
    machine.close()


# ---- the radio's port

XBEE = BUILD / "mrl_firmware_xbee.elf"
RADIO_IN, BIT_S = 2, 52 * 32 / UNO_HZ


@pytest.fixture
def radio() -> Iterator[AvrMachine]:
    machine = AvrMachine(XBEE)
    machine.set_pin(RADIO_IN, 1)
    machine.run(0.05)
    machine.sent()
    yield machine
    machine.close()


def heard(machine: AvrMachine, wait_s: float) -> int:
    """Number of texts that the radio brings in the next time."""
    machine.run(wait_s)
    return sum(frame.code == 39 for frame in frames(machine))


@pytest.mark.parametrize("phase", range(8))
def test_a_text_is_heard_at_any_phase_of_the_bits_clock(radio, phase):
    radio.run(phase / 8 * BIT_S)
    say(radio, received(b"a"))
    assert heard(radio, 0.03) == 1


@pytest.mark.parametrize("more", [0, 1, 30])
def test_texts_that_fill_the_queue_are_heard_after_a_pause_of_the_loop(radio, more):
    """Packets of 21, 21 and 22 bytes; what has no place behind them is dropped."""
    hang(radio)
    say(radio, received(b"hello") * 2 + received(b"hello!") + bytes(more))
    radio.run((QUEUE + more + 2) * 10 * BIT_S)
    mend(radio)
    assert heard(radio, 0.02) == 3
