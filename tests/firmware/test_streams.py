"""Streams: order, cadence, fresh counts, check value and stamps, also where the transmitter's 64 bytes are full."""

import pytest

from mrl_driver.protocol import Frame, Garbage
from mrl_driver.protocol.table import BY_NAME, TICK_S
from tests.firmware.imu_chip import ImuChip
from tests.firmware.pc_board import XBEE
from tests.firmware.test_xbee import packet

PASS_S = 16e-6
BYTE_S = 85e-6


def test_period_longer_than_the_clock(bench):
    """10 s are more than the 4.19 s of the 16-bit clock."""
    board = bench()
    board.send("start_stream", 10000, wait_s=0.1)
    board.forget()
    board.run(9.88)
    assert not board.frames()
    board.run(0.04)
    assert len(board.frames()) == 1


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


def test_the_frame_after_an_unfinished_one_is_whole(bench):
    board = bench()
    board.board.nack = lambda address, data: data[0] == 0xD8
    board.send("read_encoders", wait_s=0.02)
    board.board.nack = lambda address, data: False
    board.send("read_encoders", wait_s=0.02)
    assert board.events == [Garbage(b"@6,", "restarted"), Frame(6, (0, 0))]


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


LOWEST = -32768
READ_IMU, STREAM = BY_NAME["read_imu"].code, BY_NAME["read_encoders_and_sonars"].code


@pytest.fixture
def wide(bench):
    board = bench(boot=False)
    chip = board.plant.i2c[0x68] = ImuChip()
    chip.gyro = chip.accel = (LOWEST,) * 3
    board.run(0.2)
    for encoder in (1, 3):
        board.send("preset_encoder", encoder, LOWEST)
    board.forget()
    return board


@pytest.mark.parametrize("checked", [False, True])
def test_frames_of_the_widest_numbers_are_whole(wide, checked):
    """Stamps and check values make them longer than the transmitter's queue; two streams give it each fill level."""
    if checked:
        wide.check(True)
    wide.send("start_imu_stream", 10)
    wide.send("start_stream")
    wide.forget()
    wide.run(0.3)
    assert {type(event) for event in wide.events} == {Frame}
    assert {frame.args[:2] for frame in wide.frames()} == {(LOWEST, LOWEST)}
    assert {frame.code for frame in wide.frames()} == {READ_IMU, STREAM}


def test_answers_of_the_widest_numbers_behind_each_other_are_whole(wide):
    wide.check(True)
    for _ in range(4):
        wide.forget()
        for name in ("read_encoders", "read_imu", "read_encoders", "read_counters", "read_imu"):
            wide.send(name, wait_s=0.0)
        wide.run(0.05)
        assert [frame.code for frame in wide.frames()] == [6, READ_IMU, 6, 31, READ_IMU]
        assert len(wide.events) == 5


@pytest.mark.parametrize("fill", range(16))
def test_texts_that_leave_no_room_for_a_frame_do_not_cut_it(bench, fill):
    """Texts of 13 bytes and one of 25 wait in the transmitter when a frame is to begin."""
    board = bench()
    board.send("set_debug", 1)
    board.forget()
    board.board.gap(board.board.now_s + 0.02, b"@13e" * (fill % 8) + b"@99e" * (fill // 8) + b"@31e@5e")
    board.run(0.1)
    assert [event.code for event in board.events if isinstance(event, Frame)] == [31, 5]
    texts = board.heard.replace(b"[INFO] stop\r\n", b"").replace(b"[ERROR] unknown_command\r\n", b"")
    assert b"[INFO] s" not in texts and b"[ERROR] u" not in texts


LOW_ADDRESS, LOW_TEXT = b"\x80\0" * 4, b"\x80\0" * 7


@pytest.mark.parametrize("checked", [False, True])
def test_the_longest_frame_is_whole_whatever_waits_before_it(bench, checked):
    """A text by radio with the widest numbers takes about 90 bytes; its check value differs each time."""
    board = bench(library=XBEE, sonars=False)
    if checked:
        board.check(True)
    for last in range(24):
        text = LOW_TEXT + bytes([0x80, last])
        board.forget()
        for _ in range(last % 4):
            board.send("get_stream", wait_s=0.0)
        for byte in packet(b"\x90" + LOW_ADDRESS + b"\xff\xfe\x01" + text):
            board.board.native.pc_radio_receive(byte)
        board.run(0.02)
        (frame,) = [each for each in board.frames() if each.code == BY_NAME["xbee_text"].code]
        assert frame.args == (*[LOWEST] * 4, 16, *[LOWEST] * 7, LOWEST + last)
        assert all(isinstance(event, Frame) for event in board.events)


def test_texts_fill_the_transmitter_to_its_last_byte(bench):
    """Three of 13 bytes and one of 25 are 64."""
    board = bench()
    board.send("set_debug", 1)
    board.forget()
    board.board.gap(board.board.now_s + 0.02, b"@13e" * 3 + b"@99e")
    board.run(0.02)
    assert board.heard == b"[INFO] stop\r\n" * 3 + b"[ERROR] unknown_command\r\n"


def test_a_text_that_has_no_room_for_its_end_is_left_out(bench):
    """13 bytes each: of ten in one pass, four fit into 64 bytes."""
    board = bench()
    board.send("set_debug", 1)
    board.forget()
    board.board.gap(board.board.now_s + 0.01, b"@13e" * 10)
    board.run(0.05)
    assert board.heard == b"[INFO] stop\r\n" * board.heard.count(b"[INFO] stop\r\n")


SIZES = [
    0,
    1,
    *(n + d for n in (10, 100, 1000, 10000) for d in (-1, 0, 1)),
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
