"""Laws of the decoder and the encoder, held by Hypothesis."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import FrameError
from mrl_driver.protocol import (
    REPLIES,
    REQUESTS,
    Frame,
    FrameDecoder,
    Garbage,
    Stamp,
    check_value,
    encode_reply,
    encode_request,
)
from mrl_driver.protocol.table import BY_CODE, COMMANDS, MAX_FRAME, MAX_NOISE, Command

INT16 = st.integers(-32768, 32767)


def arguments(fields):
    return st.tuples(*(st.integers(field.low, field.high) for field in fields))


@st.composite
def requests(draw):
    row: Command = draw(st.sampled_from([row for row in COMMANDS if row.name != "xbee_text"]))
    args = draw(arguments(row.request))
    return row.code, args[: len(args) - draw(st.integers(0, row.optional))]


@st.composite
def replies(draw):
    row: Command = draw(st.sampled_from([row for row in COMMANDS if row.reply]))
    args = draw(arguments(row.reply))
    return row.code, args[: len(args) - draw(st.integers(0, row.optional_reply))], row.stamped


@given(requests(), st.booleans())
def test_a_request_comes_back(request, checked):
    code, args = request
    assert FrameDecoder(REQUESTS, checked).feed(encode_request(code, *args, checked=checked)) == [
        Frame(code, args)
    ]


@given(replies(), INT16, INT16, st.booleans())
def test_a_reply_comes_back(reply, sequence, time, checked):
    code, args, stamped = reply
    stamp = Stamp(sequence, time)
    wire = encode_reply(code, *args, stamp=stamp, checked=checked)
    assert FrameDecoder(REPLIES, checked).feed(wire) == [
        Frame(code, args, stamp if checked and stamped else None)
    ]


@given(st.binary(max_size=400))
def test_no_byte_but_line_ends_is_lost_silently(data):
    """What frames and garbage hold, and what is still waiting, add up to the input."""
    wire = data + b"\r\n@"
    events = FrameDecoder().feed(wire)
    assert all(isinstance(event, Frame) or event.data for event in events)
    garbage = b"".join(event.data for event in events if isinstance(event, Garbage))
    frames = b"".join(
        b"@" + b",".join(b"%d" % n for n in (e.code, *e.args)) + b"e" for e in events if isinstance(e, Frame)
    )
    assert len(garbage) + len(frames) >= len(wire.rstrip(b"@")) - wire.count(b"\r") - wire.count(b"\n")


def test_frame_without_end_is_bounded():
    assert FrameDecoder(REQUESTS).feed(b"@" + b"1" * (MAX_FRAME - 1)) == [
        Garbage(b"@" + b"1" * (MAX_FRAME - 1), "too_long")
    ]


def test_noise_is_bounded():
    assert FrameDecoder(REQUESTS).feed(b"\x00" * MAX_NOISE) == [Garbage(b"\x00" * MAX_NOISE, "noise")]


def test_check_value_is_crc_16_ibm_3740():
    """The catalogued check of that CRC over `123456789` is 0x29B1."""
    assert check_value(b"123456789") == 0x29B1


@pytest.mark.parametrize(
    "code, args, message",
    [
        (99, (), f"command 99 is not in the table, expected 1 to {max(BY_CODE)}"),
        (11, (1,), r"command 11 \(move_differential\) takes 2 arguments, got 1"),
        (11, (40000, 0), "move_differential: linear is 40000, expected -32768 to 32767 mm/s"),
        (33, (250.5,), "set_watchdog: period is 250.5, expected 0 to 10000 ms"),
        (9, (101, 0), "move_motors_pid: motor_1 is 101, expected -100 to 100 %"),
    ],
)
def test_forbidden_request_raises(code, args, message):
    with pytest.raises(FrameError, match=message):
        encode_request(code, *args)


@pytest.mark.parametrize(("speeds", "check"), [((34, -147), b"32767"), ((17, 180), b"-32768")])
def test_a_checksum_is_written_as_int16(speeds, check):
    """The largest and the smallest that there are."""
    assert encode_request(11, *speeds, checked=True) == b"@11,%d,%d," % speeds + check + b"e"


def test_the_argument_that_may_be_absent_is_counted_from_the_last():
    """The period of a stream may be left out, a second one is refused."""
    assert (encode_request(18), encode_request(18, 20)) == (b"@18e", b"@18,20e")
    with pytest.raises(FrameError, match="takes 1 arguments, got 2"):
        encode_request(18, 20, 20)


def test_reply_without_its_stamp_raises():
    with pytest.raises(FrameError, match="stamped"):
        encode_reply(6, 1, 2, checked=True)


NUMBERED = encode_reply(8, 1, 2, 3, 4, 5, stamp=Stamp(6, 7), checked=True)


@pytest.mark.parametrize("before", [b"[INFO] ", b"7" * 500, b"@8,1,2,3,"])
def test_a_checked_frame_behind_text_counts(before):
    """A flood of text would keep all of them out."""
    assert FrameDecoder(REPLIES, True).feed(before + NUMBERED)[-1] == Frame(8, (1, 2, 3, 4, 5), Stamp(6, 7))
