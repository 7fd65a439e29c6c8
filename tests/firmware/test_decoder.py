"""The firmware's decoder says what the Python one says: same frames, same garbage, same reason, same order."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.protocol import REQUESTS, FrameDecoder, check_value, encode_request
from mrl_driver.protocol.table import BY_NAME, COMMANDS, MAX_ARGUMENTS, MAX_FRAME, MAX_NOISE
from tests.firmware.twin import TwinDecoder
from tests.vectors import load


@pytest.mark.parametrize("before, behind", [(b"", b""), (b"\x80\xfe\r\n", b"\r\n@")])
def test_golden_vectors(before, behind):
    """The Python decoder's events are compared with theirs in `protocol/test_decoder.py`."""
    for vector in load("requests"):
        wire = before + vector.wire + behind
        twin = TwinDecoder(vector.checked).feed(wire)
        assert (vector.name, twin) == (vector.name, FrameDecoder(REQUESTS, vector.checked).feed(wire))


def test_every_request_is_understood():
    for row in COMMANDS:
        if row.name != "xbee_text":
            wire = encode_request(row.code, *(field.high for field in row.request))
            assert TwinDecoder().feed(wire) == FrameDecoder(REQUESTS).feed(wire)


@pytest.mark.parametrize("length", [MAX_FRAME - 1, MAX_FRAME, MAX_FRAME + 1, 300])
def test_long_frames(length):
    wire = b"@11," + b"1" * (length - 5) + b"e" + b"@13e"
    assert TwinDecoder().feed(wire) == FrameDecoder(REQUESTS).feed(wire)


@pytest.mark.parametrize("length", [MAX_NOISE - 1, MAX_NOISE, MAX_NOISE + 1, 3 * MAX_NOISE])
def test_long_noise(length):
    wire = b"x" * length + b"\r@13e"
    assert TwinDecoder().feed(wire) == FrameDecoder(REQUESTS).feed(wire)


def test_every_byte_in_a_number():
    for byte in range(256):
        wire = b"@11,1" + bytes([byte]) + b",0e@13e"
        assert TwinDecoder().feed(wire) == FrameDecoder(REQUESTS).feed(wire)


def test_leading_zeros():
    for digits in (b"0", b"00", b"01", b"000", b"001", b"010", b"100", b"-0", b"-00", b"-01", b"-10"):
        wire = b"@11,%b,0e" % digits
        assert TwinDecoder().feed(wire) == FrameDecoder(REQUESTS).feed(wire)


@pytest.mark.parametrize("checked", [False, True])
def test_codes_up_to_the_one_behind_the_last(checked):
    for code in range(-1, len(COMMANDS) + 3):
        wire = b"@%de" % code
        assert TwinDecoder(checked).feed(wire) == FrameDecoder(REQUESTS, checked).feed(wire)


@pytest.mark.parametrize("name", ["send_xbee", "move_differential", "stop", "save_config"])
@pytest.mark.parametrize("checked", [False, True])
def test_every_number_of_arguments(name, checked):
    """Also one and two more than any frame has, with the right check value behind them and with a wrong one."""
    for count in range(MAX_ARGUMENTS + 3):
        body = b"@%d" % BY_NAME[name].code + b",7" * count
        for check in (check_value(body), check_value(body) ^ 1):
            for wire in (body + b"e", body + b",%de" % check):
                assert TwinDecoder(checked).feed(wire) == FrameDecoder(REQUESTS, checked).feed(wire)


@pytest.mark.parametrize("asked, plain_calibrate", [(True, False), (False, True), (True, True)])
def test_a_checksum_is_needed_in_the_same_states(asked, plain_calibrate):
    decoder = FrameDecoder(REQUESTS)
    decoder.asked, decoder.plain_calibrate = asked, plain_calibrate
    for row in COMMANDS:
        body = b",".join([b"@%d" % row.code, *(b"%d" % field.high for field in row.request)])
        for wire in (body + b"e", body + b",%de" % check_value(body), body + b",1e"):
            assert TwinDecoder(False, asked, plain_calibrate).feed(wire) == decoder.feed(wire)


def test_numbers_around_the_ends_of_int16():
    for digits in (*range(32750, 32800), *range(65530, 65540), *range(327670, 327700)):
        for sign in (b"", b"-"):
            wire = b"@11,%b%d,0e" % (sign, digits)
            assert TwinDecoder().feed(wire) == FrameDecoder(REQUESTS).feed(wire)


PIECES = st.one_of(
    st.binary(max_size=8),
    st.sampled_from(
        [b"@", b"e", b",", b"-", b"0", b"13", b"@13e", b"@6e", b"\r\n", b"32768", b"-32769", b"007"]
    ),
    st.builds(
        lambda code, args: b"@%d" % code + b"".join(b",%d" % a for a in args) + b"e",
        st.integers(-2, 300),
        st.lists(st.integers(-40000, 40000), max_size=18),
    ),
)


@settings(max_examples=300, deadline=None)
@given(st.lists(PIECES, max_size=12), st.booleans())
def test_any_bytes(pieces, checked):
    wire = b"".join(pieces)
    assert TwinDecoder(checked).feed(wire) == FrameDecoder(REQUESTS, checked).feed(wire)


@settings(max_examples=150, deadline=None)
@given(st.integers(-32768, 32767), st.integers(-32768, 32767), st.integers(0, 200), st.integers(0, 255))
def test_damaged_checked_frames(linear, angular, place, flip):
    wire = bytearray(encode_request(11, linear, angular, checked=True))
    wire[place % len(wire)] ^= flip
    assert TwinDecoder(True).feed(bytes(wire)) == FrameDecoder(REQUESTS, True).feed(bytes(wire))
