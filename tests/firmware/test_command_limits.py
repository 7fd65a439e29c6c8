"""How many bytes the board takes at a time, and what a stop may overtake."""

import pytest

from mrl_driver.protocol.table import BY_NAME
from tests.firmware.test_failsafe import STOP

PRESET_WIRE, STOP_WIRE = b"@4,1,5e", b"@13e"
PRESET = b"\xef\x01\x00\x05\xaa\x55"
AT_ONCE = 16
"""Bytes that are taken before the motor board is served [byte]."""


@pytest.mark.parametrize("size, first", [(AT_ONCE, STOP), (AT_ONCE + 1, PRESET)])
def test_a_stop_within_the_first_16_bytes_overtakes_a_command(bench, size, first):
    """One more byte has to wait until the bus has been served once."""
    board = bench()
    fill = b"\r" * (size - len(PRESET_WIRE + STOP_WIRE))
    board.board.gap(board.board.now_s + 0.01, PRESET_WIRE + fill + STOP_WIRE)
    board.run(0.01)
    assert sorted(board.writes()) == sorted([PRESET, STOP]) and board.writes()[0] == first


@pytest.mark.parametrize("waiting", [3, 4, 17, 33, 49, 64])
def test_a_stop_behind_any_number_of_waiting_bytes_is_carried_out_within_two_passes(bench, waiting):
    """64 bytes at most wait for the loop; a pass takes them in four parts."""
    board = bench()
    board.board.gap(board.board.now_s + 0.02, b"\r" * (waiting - len(STOP_WIRE)) + STOP_WIRE[-waiting:])
    begun_s = board.board.now_s
    board.run(0.001)
    assert bool(board.writes()) == (waiting >= len(STOP_WIRE))
    assert all(t - begun_s < 0.2e-3 for t in board.write_times(STOP[0]))


@pytest.mark.parametrize("byte", [0x00, 0x01, 0x7F, 0x80, 0xFF])
def test_no_byte_within_a_frame_is_left_out(bench, byte):
    """A frame without it would be a stop."""
    board = bench()
    board.raw(b"@1" + bytes([byte]) + b"3e")
    assert board.writes() == [] and board.counter("not_integer") == 1


@pytest.mark.parametrize("waiting", [20, 36, 52, 64])
def test_a_stream_that_is_started_late_in_a_pass_begins_at_once(bench, waiting):
    """The loop does not sleep before it has asked all tasks again; its first frame takes less than 1 ms to begin."""
    for phase in range(4):
        board = bench(sonars=False)
        board.run(0.01 * phase)
        board.forget()
        wire = b"@%d,100e" % BY_NAME["start_stream"].code
        board.board.gap(board.board.now_s + 0.02, b"\r" * (waiting - len(wire)) + wire)
        board.run(1e-3)
        assert board.heard[:1] == b"@"
