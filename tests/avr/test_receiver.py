"""A receiver at the board's speed and at others."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_arduino.avr.bit_serial import received
from sim_arduino.avr.records import SentByte

BIT = 136  # cycles at 117647 baud


def line(data, bit=BIT, gap=0):
    """Bytes one behind the other."""
    length = 10 * bit
    return [
        SentByte(value, at * (length + gap), at * (length + gap) + length) for at, value in enumerate(data)
    ]


@given(st.binary(max_size=40), st.floats(BIT * 0.97, BIT * 1.03))
def test_close_speeds_hear_every_byte(data, bit):
    """3 % apart is close enough."""
    assert received(line(data), bit) == data


@given(st.binary(min_size=1, max_size=10), st.sampled_from([0.95, 1.05]))
def test_sampling_agrees_with_the_short_cut(data, factor):
    """5 % apart, with idle time between: still the same bytes, bit by bit."""
    assert received(line(data, gap=5 * BIT), BIT * factor) == data


@pytest.mark.parametrize("factor", [0.25, 0.5, 2, 12])
def test_other_speeds_hear_something_else(factor):
    assert b"@8," not in received(line(b"@8,1,2,3,4,5e\r\n"), BIT * factor)
