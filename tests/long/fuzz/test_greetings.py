"""A few greetings on a bad line; `make fuzz` tries thousands."""

import pytest

from tests.long.fuzz.greetings import BOARDS, Tally, faults_of, greet, tally_of

RATE = 0.01
SEEDS = (134, 265, 307, 357, 364, 424, 676, 756)  # Each makes a bare `calibrate` of a request to the board


@pytest.mark.parametrize("board", BOARDS)
def test_no_greeting_on_a_bad_line_is_wrong_fails_or_moves_the_robot(board):
    found = {seed: greet(board, faults_of(RATE), seed) for seed in range(5)}
    assert tally_of(board, found) == Tally(5, 0, (), ())


@pytest.mark.parametrize("board", ["python", "pc"])
def test_no_greeting_moves_the_robot_on_lines_that_make_calibrate_of_it(board):
    assert not [seed for seed in SEEDS if greet(board, faults_of(RATE), seed).moved]


@pytest.mark.parametrize("board", ["python", "pc"])
def test_without_the_guard_of_calibrate_such_lines_move_the_robot(board):
    """The control; a change of what is sent moves the faults to other bytes."""
    moved = [seed for seed in SEEDS if greet(board, faults_of(RATE), seed, plain_calibrate=True).moved]
    assert len(moved) > len(SEEDS) // 2
