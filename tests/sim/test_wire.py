"""The serial line in time."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_arduino.board.uart import IN_BYTE_S, OUT_BYTE_S, Incoming, Outgoing, Ring


def test_a_frame_waits_for_the_one_before():
    line = Outgoing()
    line.put(b"abc", 1.0)
    line.put(b"d", 1.0)
    assert [line.take(1.0 + count * OUT_BYTE_S) for count in (2, 3.5)] == [b"ab", b"c"]


@given(frames=st.lists(st.binary(min_size=1, max_size=40), max_size=8), times=st.lists(st.floats(0, 0.05)))
def test_no_byte_is_lost_or_doubled_however_often_one_asks(frames, times):
    line, out = Outgoing(), b""
    for frame in frames:
        line.put(frame, 0.0)
    for time_s in sorted(times):
        out += line.take(time_s)
    assert out + line.take(1e3) == b"".join(frames)


def test_a_request_is_there_when_its_last_byte_is():
    line = Incoming()
    line.put(b"@6e@8e", 1.0)
    assert line.next_s == pytest.approx(1.0 + 3 * IN_BYTE_S)
    assert line.take() == b"@6e"
    assert line.next_s == pytest.approx(1.0 + 6 * IN_BYTE_S)


def test_the_line_is_busy_with_what_came_before():
    line = Incoming()
    line.put(b"xxxxxxxxxe", 1.0)
    line.put(b"e", 1.0)
    line.take()
    assert line.next_s == pytest.approx(1.0 + 11 * IN_BYTE_S)


def test_a_full_ring_loses_what_comes():
    ring = Ring(3)
    ring.put(b"abcd")
    assert [ring.take(), ring.take(), ring.take(), ring.take()] == [97, 98, 99, None]
