"""The firmware's times, to half a millisecond on both sides."""

import pytest

from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import BY_NAME, TICK_S
from tests.firmware.test_failsafe import STOP, stop_reason

HALF_MS = 0.5e-3
STALL_TICKS = 3906
BYTE_S = 10 / 115200
READ_BATTERY, READ_TEMPERATURE = 0xD5, 0xD4


@pytest.mark.parametrize("gap_s, dropped", [(0.25 - HALF_MS, False), (0.25 + HALF_MS, True)])
def test_a_stall_is_a_gap_of_250_ms(bench, gap_s, dropped):
    board = bench()
    board.forget()
    board.board.gap(board.board.now_s + gap_s, b"@11,100,0e")
    board.run(0.05)
    assert (not board.writes(0xEB)) == dropped


def test_check_mode_ends_2_s_after_the_last_frame(bench):
    board = bench()
    board.check(True)
    board.send("move_differential", 100, 0, wait_s=0.1)
    board.forget()
    begun_s = board.board.now_s
    board.send("get_stream", wait_s=2.1)
    heard_s = begun_s + len(encode_request(BY_NAME["get_stream"].code, checked=True)) * BYTE_S
    assert board.write_times(STOP[0])[0] - heard_s == pytest.approx(2.0, abs=HALF_MS)
    board.decoder.checked = False
    assert stop_reason(board) == "check_ended"


@pytest.mark.parametrize("begun, period_s", [(b"", 0.040), (b"@11,1", 0.064)])
def test_the_motor_board_is_polled_in_time(bench, begun, period_s):
    """Every 40 ms; while a request arrives, every 64 ms."""
    board = bench()
    board.raw(begun, wait_s=0.2)
    board.forget()
    board.run(1.0)
    polls = sorted(board.write_times(READ_BATTERY) + board.write_times(READ_TEMPERATURE))
    gaps = [after - before for before, after in zip(polls, polls[1:])]
    assert gaps == pytest.approx([period_s] * len(gaps), abs=HALF_MS)


def test_a_stall_is_longer_than_250_ms(bench):
    """A gap of exactly as many ticks is none; in one phase of four a tick more passes."""
    dropped = []
    for phase in range(4):
        board = bench()
        board.run(phase * TICK_S / 4)
        board.forget()
        board.board.gap(board.board.now_s + STALL_TICKS * TICK_S, b"@11,100,0e")
        board.run(0.05)
        dropped.append(not board.writes(0xEB))
    assert sum(dropped) <= 1


@pytest.mark.parametrize("after_s, baud", [(1.0 - HALF_MS, 500000), (1.0 + HALF_MS, 115200)])
def test_the_line_is_slow_again_1_s_after_the_last_frame(bench, after_s, baud):
    board = bench()
    wire = encode_request(BY_NAME["set_baud"].code, 2)
    board.raw(wire, wait_s=len(wire) * BYTE_S + after_s)
    board.board.set_host_baud(baud)
    assert board.ask("get_stream").args == (0,)
