"""A few greetings on a bad line; `make fuzz` tries thousands."""

import pytest

from tests.fuzz.greetings import BOARDS, try_many


@pytest.mark.parametrize("board", BOARDS)
def test_no_greeting_on_a_bad_line_is_wrong_or_fails(board):
    tally = try_many((board, "loss:rate=0.01", range(5)))
    assert (tally.greetings, tally.wrong, tally.errors) == (5, 0, ())
