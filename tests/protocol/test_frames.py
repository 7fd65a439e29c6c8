"""Numbers on the wire are int16: what is larger wraps."""

import pytest

from mrl_driver.protocol.frames import to_int16


@pytest.mark.parametrize(
    ("number", "wire"),
    [(0, 0), (5, 5), (-1, -1), (32767, 32767), (32768, -32768), (65535, -1), (65536, 0), (-32769, 32767)],
)
def test_a_number_wraps_to_int16(number, wire):
    assert to_int16(number) == wire
