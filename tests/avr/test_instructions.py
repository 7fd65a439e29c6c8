"""Cycle counts of instructions and interrupt entry, against the ATmega328P datasheet."""

from typing import List

import pytest

from sim_arduino.avr.machine import MachineCrashed

MARK_CYCLES = 2  # sbi
IDLE = 1  # SMCR: sleep enable, idle mode
OVERFLOW_S = 256 * 1024 / 16e6
CYCLES = {
    "nop": (1, 1),
    "lds": (2, 2),
    "sts": (3, 2),
    "push": (4, 2),
    "pop": (5, 2),
    "rcall, ret": (6, 7),
    "call, ret": (7, 8),
    "mul": (8, 2),
    "adiw": (9, 2),
    "ld": (10, 2),
    "st": (11, 2),
    "rjmp": (12, 2),
    "lpm": (13, 3),
    "skip of one word": (14, 2),
    "skip of two words": (15, 3),
    "branch not taken": (16, 2),
    "branch taken": (17, 3),
    "ldd": (18, 2),
    "in": (19, 1),
    "icall, ret": (21, 9),
    "jmp": (22, 3),
}


@pytest.fixture
def gaps(bench) -> List[int]:
    """Cycles between the marks of cycles.S, the marks' own taken off."""
    machine = bench("cycles.S").machine
    machine.watch_pins([13])
    machine.reset()
    machine.pin_changes()
    machine.run(100e-6)
    cycles = [change.cycle for change in machine.pin_changes()][1:]
    return [later - earlier - MARK_CYCLES for earlier, later in zip(cycles, cycles[1:])]


def test_instructions_take_the_cycles_of_the_datasheet(gaps):
    """Section "Instruction Set Summary"; call, ret and reti with a 16-bit program counter."""
    assert {name: gaps[index] for name, (index, _) in CYCLES.items()} == {
        name: cycles for name, (_, cycles) in CYCLES.items()
    }


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
    """Those that stop the clocks of timers and serial port."""
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
