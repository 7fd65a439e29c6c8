"""Timer 1, against the ATmega328P datasheet: the clock of the firmware and its alarm."""

import pytest

LED = 13
TICK = 1024  # cycles
NORMAL, CTC = 0x05, 0x0D  # TCCR1B: prescaler 1024, normal and CTC mode
OVERFLOW = 0x01
ENTRY_CYCLES = 20  # the interrupt waits for the sketch, which keeps interrupts off for moments


def run(bench, start, compare, control=NORMAL, ticks=20):
    """Starts the sketch; returns it and the cycles from the start to each interrupt of the compare unit."""
    board = bench("compare.c")
    for name, value in {"start": start, "compare": compare, "control": control, "go": 1}.items():
        board.set(name, value)
    board.machine.watch_pins([LED])
    board.machine.run(ticks * TICK / board.machine.frequency_hz)
    first, *rest = [change.cycle for change in board.machine.pin_changes()]
    return board, [cycle - first for cycle in rest]


def ticks(cycles):
    """The prescaler's phase is random, so that the first tick is a part of one: whole ticks begun."""
    return [-(-(each - 30) // TICK) for each in cycles]


@pytest.mark.parametrize("start, compare, wait", [(0, 4, 5), (100, 103, 4), (65534, 1, 4), (7, 7, 1)])
def test_a_compare_match_is_flagged_when_the_counter_leaves_the_value(bench, start, compare, wait):
    """Section "Timer/Counter Timing Diagrams": the flag is set with the next clock of the timer."""
    _, matches = run(bench, start, compare)
    assert ticks(matches) == [wait]


def test_a_value_that_has_passed_matches_a_whole_round_later(bench):
    """4.19 s: the firmware must not wait for it."""
    _, matches = run(bench, 10, 9, ticks=65600)
    assert ticks(matches) == [65536]


def test_an_overflow_is_flagged(bench):
    board, _ = run(bench, 65530, 0x8000, ticks=5)
    before = board.get("flags") & OVERFLOW
    board.machine.run(2 * TICK / board.machine.frequency_hz)
    assert (before, board.get("flags") & OVERFLOW) == (0, OVERFLOW)
