"""The chip's own parts in the images, at their limits: queues, converter, I2C lines, watchdog."""

from pathlib import Path
from typing import Dict, Iterator, List, Tuple

import pytest

from mrl_driver.protocol import REPLIES, FrameDecoder
from mrl_driver.protocol.table import REASONS
from sim_arduino.avr.machine import UNO_HZ, AvrMachine
from tests.avr.test_image import ENDLESS_LOOP, lock_up
from tests.bench.firmware_board import Rig, request

BUILD = Path(__file__).resolve().parents[2] / "build" / "firmware"
READY_S, CONVERTED_S = 0.12, 0.5
SDA, SCL = 18, 19
BYTE_S = 10 / 117647
QUEUE = 64
"""Received bytes that wait for the loop."""
TCCR0B, TIMSK0, TCCR2B = 0x45, 0x6E, 0xB1
UCSR0C, ADCSRA, ADMUX, DDRC, PORTC = 0xC2, 0x7A, 0x7C, 0x27, 0x28
CONVERTS = 0x40
FORMAT_8N1 = 0x06


@pytest.fixture
def rig() -> Iterator[Rig]:
    """The sonar image, booted, with a motor board and sonars."""
    made = Rig(BUILD / "mrl_firmware.elf")
    made.run(READY_S)
    yield made
    made.close()


def hang(rig: Rig) -> None:
    """Makes the program loop where it can be interrupted next."""
    while not rig.machine.interrupts_on:
        rig.run(1e-6)
    rig.machine.patch(rig.machine.pc, ENDLESS_LOOP)


def mend(rig: Rig) -> None:
    for address, data in rig.machine.image_flash:
        rig.machine.patch(address, data)


def register(rig: Rig, address: int) -> int:
    return rig.machine.peek(address)[0]


def refused(rig: Rig) -> Dict[str, int]:
    """How much was refused so far, by reason."""
    rig.replies()
    rig.machine.run_until(rig.machine.send(request("read_counters")))
    rig.run(0.02)
    received = b"".join(reply.line for reply in rig.replies())
    (frame,) = FrameDecoder(REPLIES).feed(received)
    return {row.name: count for row, count in zip(REASONS, frame.args)}


# ---- the line from the host


@pytest.mark.parametrize("more, lost", [(0, 0), (1, 1), (255, 255), (260, 255)])
def test_bytes_without_a_place_in_the_queue_are_counted(rig, more, lost):
    """At most 255 of them, while the loop stands still for less than the watchdog's patience."""
    hang(rig)
    end = rig.machine.send(bytes(QUEUE + more))
    rig.machine.run_until(end + int(BYTE_S * UNO_HZ))
    mend(rig)
    rig.run(0.01)
    assert refused(rig)["overrun"] == lost


def test_the_line_has_8n1_whatever_a_bootloader_has_left():
    made = Rig(BUILD / "mrl_firmware.elf")
    made.machine.poke(UCSR0C, b"\x3e")
    made.run(READY_S)
    assert register(made, UCSR0C) == FORMAT_8N1
    made.close()


# ---- timers


def test_timers_without_a_task_stand_still(rig):
    """The Arduino core has started timers 0 and 2, with an interrupt."""
    assert [register(rig, each) for each in (TCCR0B, TIMSK0, TCCR2B)] == [0, 0, 0]


# ---- the converter


def test_a_conversion_takes_104_us(rig):
    """13 clocks of 125 kHz, at most 200 kHz for ten bits; the first one takes longer."""
    rig.run(CONVERTED_S)
    begun: List[int] = []
    rig.machine.adc_volts = lambda channel, time_s: begun.append(rig.machine.cycle) or 1.0
    while not begun:
        rig.run(10e-6)
    while register(rig, ADCSRA) & CONVERTS:
        rig.machine.run_until(rig.machine.cycle + 1)
    assert rig.microseconds(rig.machine.cycle - begun[0]) == pytest.approx(104, abs=1)


def test_the_supply_is_the_converters_reference(rig):
    """The pin AREF of an Uno is open."""
    rig.run(CONVERTED_S)
    assert register(rig, ADMUX) >> 6 == 1


# ---- the I2C lines


def line_changes(rig: Rig) -> List[Tuple[int, int]]:
    return [(change.pin, change.level) for change in rig.machine.pin_changes()]


def test_a_hanging_bus_gets_nine_clocks_and_a_stop(rig):
    """SDA rises while SCL is high."""
    rig.machine.watch_pins([SCL])
    rig.machine.hang_bus("sda")
    rig.machine.pin_changes()
    falls: List[int] = []
    while len(falls) < 10:
        rig.run(100e-6)
        falls += [change.cycle for change in rig.machine.pin_changes() if not change.level]
    rig.run(200e-6)
    assert not [change for change in rig.machine.pin_changes() if not change.level]
    assert len(falls) == 10


def test_both_lines_of_the_bus_are_pulled_up_inputs(rig):
    """A recovery leaves them so."""
    rig.machine.hang_bus("sda", release_clocks=8)
    rig.run(0.3)
    lines = 1 << SDA - 14 | 1 << SCL - 14
    assert (register(rig, PORTC) & lines, register(rig, DDRC) & lines) == (lines, 0)


# ---- the watchdog


def test_a_loop_that_hangs_is_reset_at_the_third_missed_kick(rig):
    """384 ms after the last kick, which is at most 64 ms old; the watchdog's oscillator is exact here."""
    assert 0.384 - 0.064 <= lock_up(rig) <= 0.386
