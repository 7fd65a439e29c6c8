"""Watchdog: periods, interrupt, reset, the two in a row, and what survives."""

import pytest

IN_TIME, TOO_EARLY = 0x5A, 0x5B  # the program stops the watchdog after or before it clears the reset flags
WDRF, EXTRF, PORF = 0x08, 0x02, 0x01
WDE, WDP2 = 0x08, 0x04
RESET_ONLY, INTERRUPT_ONLY, INTERRUPT_THEN_RESET, MASKED, FED, NO_SEQUENCE, REARMED = range(1, 8)


def in_mode(bench, mode):
    """A board whose program has just set its watchdog up, noinit bytes cleared."""
    board = bench("watchdog.c")
    board.set("marker", 0)
    board.set("starts", 0)
    board.set("stay_off", IN_TIME)
    board.set("mode", mode)
    board.machine.run(100e-6)
    return board


def test_reset_comes_after_16_ms(bench):
    """Shortest period: 2048 cycles of 128 kHz."""
    board = in_mode(bench, RESET_ONLY)
    board.machine.run(15.5e-3)
    before = board.get("starts")
    board.machine.run(1e-3)
    assert (before, board.get("starts")) == (0, 1)


def test_a_run_with_a_reset_in_it_ends_in_time(bench):
    board = in_mode(bench, RESET_ONLY)
    end = board.machine.cycle + 20 * 16000
    board.machine.run_until(end)
    assert (board.get("starts"), board.machine.cycle - end < 5) == (1, True)


def test_the_interrupt_alone_repeats_at_its_period(bench):
    board = in_mode(bench, INTERRUPT_ONLY)
    board.machine.run(0.1)
    assert (board.get("interrupts"), board.get("starts")) == (3, 0)


@pytest.mark.parametrize("mode, reset_s, interrupts", [(INTERRUPT_THEN_RESET, 32e-3, 1), (REARMED, 64e-3, 3)])
def test_reset_follows_an_interrupt_that_does_not_rearm_itself_after_another_period(
    bench, mode, reset_s, interrupts
):
    """WDIE falls when the vector is entered; an interrupt that sets it again does not start the count anew."""
    board = in_mode(bench, mode)
    board.machine.run(reset_s - 0.5e-3)
    before = (board.get("interrupts"), board.get("starts"))
    board.machine.run(1e-3)
    assert (before, board.get("starts")) == ((interrupts, 0), 1)


def test_a_masked_interrupt_becomes_a_reset(bench):
    board = in_mode(bench, MASKED)
    board.machine.run(33e-3)
    assert board.get("starts") == 1


def test_a_marker_of_the_interrupt_survives_the_reset(bench):
    board = in_mode(bench, INTERRUPT_THEN_RESET)
    board.machine.run(33e-3)
    assert board.get("marker_at_start") == 0xA5


@pytest.mark.parametrize("hidden, flags", [(False, WDRF), (True, 0)])
def test_a_watchdog_reset_is_flagged_unless_a_bootloader_hides_it(bench, hidden, flags):
    board = in_mode(bench, RESET_ONLY)
    if hidden:
        board.machine.set_reset_flags(0)
    board.machine.run(17e-3)
    assert (board.get("starts"), board.get("flags_at_start")) == (1, flags)


def test_after_its_reset_the_watchdog_runs_on_at_its_shortest_period(bench):
    board = in_mode(bench, RESET_ONLY)
    board.set("stay_off", 0)
    board.machine.run(16.5e-3)
    assert board.get("control_at_start") & WDE
    board.machine.run(32e-3)
    assert board.get("starts") == 3


def test_the_watchdog_cannot_be_stopped_while_its_flag_stands(bench):
    board = in_mode(bench, RESET_ONLY)
    board.set("stay_off", TOO_EARLY)
    board.machine.run(16.5e-3)
    assert board.get("control_cleared") & WDE


def test_the_period_changes_only_behind_the_timed_sequence(bench):
    assert in_mode(bench, NO_SEQUENCE).get("control_now") == WDE | WDP2


@pytest.mark.parametrize("action, flags", [("reset", EXTRF), ("power_cycle", PORF)])
def test_other_resets_have_their_own_flags(bench, action, flags):
    board = bench("watchdog.c")
    getattr(board.machine, action)()
    board.machine.run(100e-6)
    assert board.get("flags_at_start") == flags
