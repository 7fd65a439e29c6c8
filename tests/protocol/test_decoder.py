"""Laws of the decoder and the encoder, held by Hypothesis."""

import sys

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
from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.table import BY_CODE, COMMANDS, MAX_ARGUMENTS, MAX_FRAME, MAX_NOISE, Command
from tests.vectors import load

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
        (9, (True, 0), "move_motors_pid: motor_1 is True, expected -100 to 100 %"),
        (9, (0, "1"), "move_motors_pid: motor_3 is '1', expected -100 to 100 %"),
        (True, (), "command is True, expected a whole number"),
        ([1], (), "command is .1., expected a whole number"),
    ],
)
def test_forbidden_request_raises(code, args, message):
    with pytest.raises(FrameError, match=message):
        encode_request(code, *args)


def test_a_reply_without_its_stamp_is_refused():
    with pytest.raises(FrameError, match="is stamped, got no stamp"):
        encode_reply(6, 1, 2, checked=True)


@pytest.mark.parametrize(("speeds", "check"), [((34, -147), b"32767"), ((17, 180), b"-32768")])
def test_a_checksum_is_written_as_int16(speeds, check):
    """The largest and the smallest that there are."""
    assert encode_request(11, *speeds, checked=True) == b"@11,%d,%d," % speeds + check + b"e"


def test_the_argument_that_may_be_absent_is_counted_from_the_last():
    """The period of a stream may be left out, a second one is refused."""
    assert (encode_request(18), encode_request(18, 20)) == (b"@18e", b"@18,20e")
    assert encode_request(18, 20.0, wrapped=True) == b"@65554,20e"
    with pytest.raises(FrameError, match="takes 1 arguments, got 2"):
        encode_request(18, 20, 20)


NUMBERED = encode_reply(8, 1, 2, 3, 4, 5, stamp=Stamp(6, 7), checked=True)


@pytest.mark.parametrize("before", [b"[INFO] ", b"7" * 500, b"@8,1,2,3,"])
def test_a_checked_frame_behind_text_counts(before):
    """A flood of text would keep all of them out."""
    assert FrameDecoder(REPLIES, True).feed(before + NUMBERED)[-1] == Frame(8, (1, 2, 3, 4, 5), Stamp(6, 7))


COUNTS = b"@6,1,20e\r\n"
RUN = COUNTS * 40  # The shortest feed that is taken at once: 400 bytes
STAMPED = encode_reply(6, 1, 2, stamp=Stamp(3, 4), checked=True)


def counted(decoder, data):
    """Return what `data` completes, and the number of function calls that this takes."""
    calls = 0

    def count(frame, event, _):
        nonlocal calls
        calls += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        events = decoder.feed(data)
    finally:
        sys.setprofile(before)
    return events, calls


def test_a_frame_has_as_many_arguments_as_the_longest_of_the_table_and_its_checksum():
    most, beyond = b"@1" + b",7" * MAX_ARGUMENTS + b"e", b"@1" + b",7" * (MAX_ARGUMENTS + 1) + b"e"
    assert FrameDecoder().feed(most + beyond) == [
        Frame(1, (7,) * MAX_ARGUMENTS),
        Garbage(beyond, "argument_count"),
    ]


@pytest.mark.parametrize("wire", [b"@6,-13028e", b"@13e", b"@20e"])
def test_a_checked_reply_needs_a_checksum(wire):
    """That holds for the reply to a stop too, though the request may lack it."""
    assert FrameDecoder(REPLIES, True).feed(wire) == [Garbage(wire, "bad_check")]


@pytest.mark.parametrize("direction", [None, REPLIES])
def test_only_a_request_to_stop_needs_no_checksum(direction):
    assert FrameDecoder(REQUESTS, True).feed(b"@13e") == [Frame(13, ())]
    assert FrameDecoder(direction, True).feed(b"@13e") == [Garbage(b"@13e", "bad_check")]


@pytest.mark.parametrize("body", [b"@6", b"@6,3", b"@6,3,4", b"@6,1,3,4", b"@6,1,2,2,3,4"])
def test_a_stamped_reply_with_too_few_or_too_many_numbers_is_garbage(body):
    """Two counts, two numbers of the stamp, and the checksum."""
    wire = b"%s,%de" % (body, check_value(body))
    assert FrameDecoder(REPLIES, True).feed(wire) == [Garbage(wire, "argument_count")]


@pytest.mark.parametrize(
    ("byte", "reason"), [(b"~", "text"), (b" ", "text"), (b"\x7f", "noise"), (b"\x1f", "noise")]
)
def test_a_line_is_text_while_its_bytes_are_printable(byte, reason):
    decoder = FrameDecoder(REPLIES)
    assert decoder.feed(byte + b"\r\n") == [Garbage(byte, reason)]


def test_a_request_repeated_in_text_is_text():
    request = encode_request(33, 250, checked=True)
    assert FrameDecoder(REPLIES, True).feed(b"received " + request) == [
        Garbage(b"received ", "text"),
        Garbage(request, "text"),
    ]


@pytest.mark.parametrize(
    ("data", "pending"),
    [
        (b"", b""),
        (b"@6,1e", b""),
        (b"@6,1", b"@6,1"),
        (b"\r\n@6,1", b"@6,1"),
        (b"\xff\xfe", b"\xff\xfe"),
        (b"@6,1@", b"@"),
        (b"\xff" * (MAX_NOISE - 1), b"\xff" * (MAX_NOISE - 1)),
        (b"\xff" * MAX_NOISE, b""),
        (b"@" + b"1" * (MAX_FRAME - 2), b"@" + b"1" * (MAX_FRAME - 2)),
        (b"@" + b"1" * (MAX_FRAME - 1), b""),
    ],
)
def test_what_is_not_yet_an_event_is_pending(data, pending):
    decoder = FrameDecoder()
    decoder.feed(data)
    assert decoder.pending == pending


@pytest.mark.parametrize(
    ("direction", "data", "idle"),
    [
        (REPLIES, b"", True),
        (REPLIES, b"@6,1,2e", True),
        (REPLIES, b"@6,1", False),
        (REQUESTS, b"@6,1", False),
        (REPLIES, b"text", False),
        (REPLIES, b"text\r\n", True),
        (REPLIES, b"text" + b"t" * MAX_NOISE, False),
        (REPLIES, b"t" * MAX_NOISE, False),
        (REQUESTS, b"\xff", False),
        (REQUESTS, b"\xff" * MAX_NOISE, True),
    ],
)
def test_a_decoder_is_idle_if_its_next_frame_depends_on_its_own_bytes_alone(direction, data, idle):
    """A line of text on which nothing waits still decides how a reply counts, but not a request."""
    decoder = FrameDecoder(direction)
    decoder.feed(data)
    assert decoder.idle is idle


@pytest.mark.parametrize(
    ("direction", "checked", "wire"),
    [
        (REPLIES, False, b"@6,425,643e\r\n"),
        (REPLIES, False, b"@6,0,-1e\r\n@6,10,-32768e\r\n"),
        (REPLIES, False, b"@6,32767,-20e"),
        (REQUESTS, False, encode_request(9, -100, 100)),
        (REQUESTS, True, encode_request(11, 34, -147, checked=True)),
        (REQUESTS, True, encode_request(11, 17, 180, checked=True)),
        (REPLIES, True, STAMPED),
    ],
)
def test_a_frame_is_not_read_byte_by_byte(direction, checked, wire):
    """Zeros, the limits of a range, the ends of int16 and a checksum of either sign cost no more."""
    data = wire * (200 // len(wire))
    events, calls = counted(FrameDecoder(direction, checked), data)
    assert calls < len(data)
    assert len(events) == data.count(b"e")


def test_a_cut_frame_is_not_read_byte_by_byte():
    decoder, start = FrameDecoder(REPLIES), b"@8,1000,2000"
    assert counted(decoder, start)[1] < len(start)
    data = b",30,40,5e\r\n@8,1001,2001,31,41,6e\r\n"
    events, calls = counted(decoder, data)
    assert calls < len(data)
    assert events == [Frame(8, (1000, 2000, 30, 40, 5)), Frame(8, (1001, 2001, 31, 41, 6))]


def test_many_frames_are_taken_at_once():
    """400 bytes cost less than one call a frame."""
    events, calls = counted(FrameDecoder(REPLIES), RUN)
    assert calls < len(events) == 40


@pytest.mark.parametrize(
    ("number", "wire"),
    [(0, 0), (5, 5), (-1, -1), (32767, 32767), (32768, -32768), (65535, -1), (65536, 0), (-32769, 32767)],
)
def test_a_number_wraps_to_int16(number, wire):
    assert to_int16(number) == wire


NOISE = Garbage(b"\x80\xfe", "noise")


@pytest.mark.parametrize("name, direction", [("requests", REQUESTS), ("replies", REPLIES)])
@pytest.mark.parametrize("amid_noise", [False, True])
def test_golden_vectors(name, direction, amid_noise):
    """Binary noise and line ends around a vector add one noise event in front, and change nothing else."""
    before, behind = (NOISE.data + b"\r\n", b"\r\n@") if amid_noise else (b"", b"")
    for vector in load(name):
        expected = [NOISE, *vector.events_at_line_end] if amid_noise else vector.events
        events = FrameDecoder(direction, vector.checked).feed(before + vector.wire + behind)
        assert (vector.name, events) == (vector.name, expected)
