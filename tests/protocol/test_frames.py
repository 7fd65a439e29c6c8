"""Numbers on the wire are int16: what is larger wraps."""

import pytest

from mrl_driver.protocol import Frame, check_value
from mrl_driver.protocol.frames import to_int16


@pytest.mark.parametrize(
    ("number", "wire"),
    [(0, 0), (5, 5), (-1, -1), (32767, 32767), (32768, -32768), (65535, -1), (65536, 0), (-32769, 32767)],
)
def test_a_number_wraps_to_int16(number, wire):
    assert to_int16(number) == wire


@pytest.mark.parametrize(("body", "check"), [(b"\xf3\x20", 32767), (b"@10926", -32768)])
def test_the_largest_and_the_smallest_checksum(body, check):
    assert check_value(body) == check


def test_a_frame_has_no_stamp_unless_it_is_given_one():
    assert Frame(6, (1, 2)).stamp is None
