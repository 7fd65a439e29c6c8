"""Cycle counts of instructions and interrupt entry, against the ATmega328P datasheet."""

import pytest

from sim_arduino.avr.machine import MachineCrashed

IDLE = 1  # SMCR: sleep enable, idle mode
OVERFLOW_S = 256 * 1024 / 16e6


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


def test_a_table_that_looks_like_such_a_skip_is_read_as_it_is(bench):
    assert bench("skips.c").get("from_table") == 0xFC00
