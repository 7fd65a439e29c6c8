"""Frames as the board writes them."""

import pytest

from mrl_driver.protocol import Frame
from tests.firmware.conftest import Bench

SIZES = [
    0,
    1,
    9,
    10,
    11,
    99,
    100,
    101,
    999,
    1000,
    1001,
    9999,
    10000,
    10001,
    19999,
    20000,
    29999,
    30000,
    32767,
]


@pytest.mark.parametrize("sign", [1, -1])
def test_numbers_of_every_length_are_written_exactly(bench, sign):
    board = bench()
    for size in [*SIZES, 32767 + (sign < 0)]:
        board.send("preset_encoder", 1, sign * size)
        board.forget()
        board.send("read_encoders")
        assert board.heard == b"@6,0,%de\r\n" % (sign * size)


def test_answers_behind_texts_are_whole(bench):
    """The transmitter takes 64 bytes, and up to 12 texts of 13 bytes go first."""
    for waiting in range(12):
        board = bench()
        board.send("set_debug", 1)
        board.forget()
        board.raw(b"@13e" * waiting + b"@5e@8e@31e", wait_s=0.05)
        assert [event.code for event in board.events if isinstance(event, Frame)] == [5, 8, 31]


def texts(board: Bench) -> int:
    return board.heard.count(b"[INFO] stop\r\n")
