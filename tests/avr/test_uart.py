"""USART0 at 115200 baud: frame time, buffers, flags and overrun."""

import pytest

BYTE_CYCLES = 1360  # 10 bits x 8 x (16 + 1): 85.0 us at 16 MHz
HOST_BYTE_S = 10 / 115200
DATA_OVERRUN = 0x08
FRAME_ERROR = 0x10
RXC, TXC = 0x80, 0x40


def send_from_board(board, count):
    """The bytes a program sends one after the other."""
    board.set("outgoing_count", count)
    board.machine.run((count + 2) * 85e-6)
    return board.machine.sent()


def test_bytes_take_85_us_each_and_leave_in_order_without_a_gap(bench):
    sent = send_from_board(bench("uart.c"), 10)
    assert bytes(one.data for one in sent) == b"abcdefghij"
    assert {one.end_cycle - one.start_cycle for one in sent} == {BYTE_CYCLES}
    assert [later.start_cycle - one.end_cycle for one, later in zip(sent, sent[1:])] == [0] * 9


def test_transmit_complete_waits_for_the_last_stop_bit(bench):
    board = bench("uart.c")
    board.set("outgoing_count", 1)
    board.machine.run(80e-6)
    during = board.get("status_seen") & TXC
    board.machine.run(20e-6)
    assert (during, board.get("status_seen") & TXC) == (0, TXC)


def test_a_byte_is_there_in_the_middle_of_its_stop_bit(bench):
    """Ready 9.5 of the receiver's bits after the falling edge, not before."""
    board = bench("uart.c")
    start = board.machine.cycle + 1000
    board.machine.send(b"x", start)
    board.machine.run_until(start + 1292 - 1)
    before = board.get("incoming_count")
    board.machine.run_until(start + 1292 + 60)
    assert (before, board.get("incoming_count")) == (0, 1)


def not_listening(bench, data):
    """A board that got `data` without reading, then reads."""
    board = bench("uart.c")
    board.set("listen", 0)
    board.machine.send(data)
    board.machine.run((len(data) + 2) * HOST_BYTE_S)
    board.set("listen", 1)
    board.machine.run(100e-6)
    return board


def test_a_low_stop_bit_is_a_frame_error(bench):
    """A byte at half the rate is still low where the stop bit should be."""
    board = bench("uart.c")
    board.machine.set_host_baud(57600)
    board.machine.send(b"\0")
    board.machine.run(500e-6)
    assert board.bytes("statuses")[0] & FRAME_ERROR


@pytest.mark.parametrize(
    "data, kept, lost, overrun", [(b"abc", b"abc", 0, [0, 0, 0]), (b"abcd", b"abd", 1, [DATA_OVERRUN, 0, 0])]
)
def test_two_bytes_and_one_in_the_shift_register_survive(bench, data, kept, lost, overrun):
    """A fourth one overwrites the third; DOR stands from the lost byte to the next read of UDR."""
    board = not_listening(bench, data)
    assert (board.bytes("incoming")[:3], board.machine.bytes_lost) == (kept, lost)
    assert [status & DATA_OVERRUN for status in board.bytes("statuses")[:3]] == overrun
