"""The decoder at its limits: what a frame may hold, what stands around it, and what a frame costs.

Cost is counted in function calls, those of the library included, so that no clock is needed.
"""

import sys

import pytest

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
from mrl_driver.protocol.table import MAX_ARGUMENTS, MAX_FRAME, MAX_NOISE

COUNTS = b"@6,1,20e\r\n"
RUN = COUNTS * 40
"""The shortest feed that is taken at once: 400 bytes."""
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


# ---- numbers


@pytest.mark.parametrize(
    ("token", "reason"),
    [
        (b"-0", "not_integer"),
        (b"+5", "not_integer"),
        (b"1_0", "not_integer"),
        (b"007", "not_integer"),
        (b"32768", "beyond_int16"),
        (b"-32769", "beyond_int16"),
        (b"100000", "beyond_int16"),
        (b"7" * 40, "beyond_int16"),
    ],
)
@pytest.mark.parametrize("end", [b"", b"\r\n"])
@pytest.mark.parametrize("direction", [None, REPLIES])
def test_a_number_that_is_not_a_canonical_int16_makes_its_frame_garbage(direction, end, token, reason):
    wire = b"@6," + token + b",1e"
    assert FrameDecoder(direction).feed(wire + end) == [Garbage(wire, reason)]


@pytest.mark.parametrize("checked", [False, True])
def test_numbers_are_int16_to_their_ends(checked):
    wire = encode_request(11, -32768, 32767, checked=checked)
    assert FrameDecoder(REQUESTS, checked).feed(wire) == [Frame(11, (-32768, 32767))]


def test_a_frame_has_as_many_arguments_as_the_longest_of_the_table_and_its_checksum():
    most, beyond = b"@1" + b",7" * MAX_ARGUMENTS + b"e", b"@1" + b",7" * (MAX_ARGUMENTS + 1) + b"e"
    assert FrameDecoder().feed(most + beyond) == [
        Frame(1, (7,) * MAX_ARGUMENTS),
        Garbage(beyond, "argument_count"),
    ]


# ---- checksums and stamps


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


# ---- around frames


@pytest.mark.parametrize(
    ("byte", "reason"), [(b"~", "text"), (b" ", "text"), (b"\x7f", "noise"), (b"\x1f", "noise")]
)
def test_a_line_is_text_while_its_bytes_are_printable(byte, reason):
    decoder = FrameDecoder(REPLIES)
    assert decoder.feed(byte + b"\r\n") == [Garbage(byte, reason)]


@pytest.mark.parametrize("start", [b"?", b"\r\n?", b"\xff"])
def test_a_byte_in_front_of_a_cut_frame_is_garbage_at_once(start):
    decoder = FrameDecoder(REPLIES, True)
    assert decoder.feed(start + b"@6,1") == [Garbage(start.lstrip(), "noise" if start == b"\xff" else "text")]


def test_text_in_front_of_many_frames_hides_the_first_one_alone():
    events = FrameDecoder(REPLIES).feed(b"?" + RUN)
    assert events == [Garbage(b"?" + COUNTS[:-2], "text"), *[Frame(6, (1, 20))] * 39]


def test_a_request_repeated_in_text_is_text():
    request = encode_request(33, 250, checked=True)
    assert FrameDecoder(REPLIES, True).feed(b"received " + request) == [
        Garbage(b"received ", "text"),
        Garbage(request, "text"),
    ]


# ---- what waits for more bytes


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


# ---- what a frame costs


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


def test_the_rest_of_a_cut_frame_is_not_read_byte_by_byte():
    decoder = FrameDecoder(REPLIES)
    decoder.feed(b"@8,1000,2000")
    data = b",30,40,5e\r\n@8,1001,2001,31,41,6e\r\n"
    events, calls = counted(decoder, data)
    assert calls < len(data)
    assert events == [Frame(8, (1000, 2000, 30, 40, 5)), Frame(8, (1001, 2001, 31, 41, 6))]


def test_many_frames_are_taken_at_once():
    """400 bytes cost less than one call a frame."""
    events, calls = counted(FrameDecoder(REPLIES), RUN)
    assert calls < len(events) == 40
