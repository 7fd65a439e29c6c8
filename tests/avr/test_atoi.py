"""avr-libc's atoi, with which boards of 2013 read their numbers: requests to them rely on its 16 bits."""

import pytest

from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.table import WRAP

LAST_2013 = 28


@pytest.fixture
def atoi(bench):
    board = bench("atoi.c")

    def read(text):
        board.machine.poke(board.machine.symbol("text").address, text.ljust(8, b"\0"))
        board.machine.run(1e-3)
        return to_int16(board.get("number"))

    return read


def test_each_wrapped_code_is_the_usual_one(atoi):
    codes = range(1, LAST_2013 + 1)
    assert [atoi(b"%d" % (code + WRAP)) for code in codes] == list(codes)


@pytest.mark.parametrize(
    "text, number",
    [(b"1x", 1), (b"01", 1), (b"+1", 1), (b" 1", 1), (b"-1", -1), (b"x1", 0), (b"9999999", -27009)],
)
def test_other_texts_are_read_as_the_emulated_board_reads_them(atoi, text, number):
    assert atoi(text) == number
