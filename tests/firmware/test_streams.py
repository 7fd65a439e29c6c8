"""Streams: order, cadence, fresh counts, check value and stamps."""

import pytest

from mrl_driver.protocol import Frame, Garbage
from mrl_driver.protocol.table import TICK_S

PASS_S = 16e-6
BYTE_S = 85e-6


def test_period_longer_than_the_clock(bench):
    """10 s are more than the 4.19 s of the 16-bit clock."""
    board = bench()
    board.send("start_stream", 10000, wait_s=0.1)
    board.forget()
    board.run(9.8)
    assert not board.frames()
    board.run(0.4)
    assert len(board.frames()) == 1


def test_cadence(bench):
    """The counters are read every 20 ms, within a pass and a tick."""
    board = bench()
    board.send("start_stream", 20, wait_s=0.05)
    board.forget()
    board.run(1.0)
    times = board.write_times(0xD8)
    gaps = [later - earlier for earlier, later in zip(times, times[1:])]
    assert max(gaps) - min(gaps) < 300e-6


def test_a_pause_is_not_made_up_for(bench):
    """The loop stood still for 200 ms: the cadence starts anew, without a burst of late frames."""
    board = bench()
    board.send("start_stream", 20, wait_s=0.05)
    board.board.gap(board.board.now_s + 0.2, b"")
    board.run(0.001)
    board.forget()
    board.run(0.1)
    assert len(board.frames()) <= 6


def test_counters_are_read_when_what_waits_before_their_frame_is_nearly_sent(bench):
    """Four texts of 13 bytes take 4.5 ms; the read begins when 7 bytes are left."""
    board = bench()
    board.send("set_debug", 1)
    board.forget()
    begun_s = board.board.now_s
    board.raw(b"@13e" * 4 + b"@6e")
    (read_s,) = board.write_times(0xD8)
    assert board.heard.index(b"@6,") >= 52 and read_s - begun_s > (52 - 7) * BYTE_S


def test_a_flood_of_questions_does_not_starve_the_stream(bench):
    board = bench()
    board.send("start_stream", 20, wait_s=0.05)
    board.forget()
    board.raw(b"@31e" * 250, wait_s=0.08)
    assert sum(frame.code == 8 for frame in board.frames()) >= 3


def test_failed_reads_leave_no_stream_frame(bench):
    """Not acknowledged reads of the counters: no frame, and the fault shows."""
    board = bench()
    board.send("start_stream", 20, wait_s=0.05)
    board.board.nack = lambda address, data: data[0] == 0xD8
    board.run(0.05)
    board.forget()
    board.run(0.2)
    assert not board.heard
    board.board.nack = lambda address, data: False
    board.run(0.2)
    assert board.faults() & 1 and board.frames()


def test_a_reply_whose_read_fails_stays_unfinished(bench):
    """`@6,` was on the wire before the counters were asked; no digit follows."""
    board = bench()
    board.board.nack = lambda address, data: data[0] == 0xD8
    board.send("read_encoders", wait_s=0.02)
    assert board.heard == b"@6,"


def test_the_frame_after_an_unfinished_one_is_whole(bench):
    board = bench()
    board.board.nack = lambda address, data: data[0] == 0xD8
    board.send("read_encoders", wait_s=0.02)
    board.board.nack = lambda address, data: False
    board.send("read_encoders", wait_s=0.02)
    assert board.events == [Garbage(b"@6,", "restarted"), Frame(6, (0, 0))]


# ---- check value


def test_checked_stream_carries_sequence_without_gap(bench):
    board = bench()
    board.check(True)
    board.send("start_stream", 10, wait_s=0.5)
    sequence = [frame.stamp.sequence for frame in board.frames() if frame.stamp]
    assert sequence == list(range(len(sequence))) and len(sequence) >= 45


def test_board_time_is_that_of_the_read(bench):
    board = bench()
    board.check(True)
    board.forget()
    board.send("start_stream", 100, wait_s=0.05)
    read_s = next(t for t, kind, _, data in board.board.transfers if kind == "read" and len(data) == 6)
    frame = next(frame for frame in board.frames() if frame.stamp)
    assert frame.stamp.time * TICK_S == pytest.approx(read_s, abs=TICK_S + PASS_S)


def test_board_time_wraps(bench):
    board = bench(first_tick=32760)
    board.check(True)
    board.send("start_stream", 10, wait_s=0.1)
    times = [frame.stamp.time for frame in board.frames() if frame.stamp]
    assert len(times) > 5 and all(time < 0 for time in times) and times == sorted(times)


def test_reply_to_set_check_comes_in_the_state_it_reports(bench):
    board = bench()
    board.check(True)
    on = board.heard
    board.forget()
    board.check(False)
    assert (on, board.heard) == (b"@32,1,31085e\r\n", b"@32,0e\r\n")
