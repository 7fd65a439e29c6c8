"""The check value: what it catches always, and what at the rate of its 16 bits."""

import random

import pytest

from mrl_driver.protocol import (
    REPLIES,
    REQUESTS,
    Frame,
    FrameDecoder,
    Stamp,
    encode_reply,
    encode_request,
)
from mrl_driver.protocol.table import BY_CODE
from tests.long.fuzz import damage

STREAM = encode_reply(8, -12345, 23456, 120, 45, 300, stamp=Stamp(7, -1234), checked=True)
UNCHECKED_STREAM = encode_reply(8, -12345, 23456, 120, 45, 300)
MOST_PER_MILLION = 30
MOST_UNCHECKED_PERCENT = 22


@pytest.mark.parametrize("wire", [STREAM, encode_reply(6, 1, -1, stamp=Stamp(0, 0), checked=True)])
def test_every_single_fault_of_a_checked_reply_is_caught(wire):
    """Changed and lost bytes and swaps; the long run counts how rarely a lost byte passes."""
    assert damage.try_every_fault(damage.REPLIES, wire).wrong == 0


@pytest.mark.parametrize("request_", [(11, 500, -800), (13,), (9, -1, 100), (35, 10, 650)])
def test_every_single_fault_of_a_checked_request_is_caught(request_):
    assert damage.try_every_fault(damage.REQUESTS, encode_request(*request_, checked=True)).wrong == 0


@pytest.mark.parametrize(
    "request_", [(2, 700, 400, 200), (5,), (6,), (34, 10), (32, 1), (33, 250), (35, 10, 650), (37,)]
)
def test_no_single_fault_makes_a_guarded_request_in_plain_mode(request_):
    """Guarded rows carry their check value always, so nothing is configured by one wrong byte."""
    wire, sent = encode_request(*request_), Frame(request_[0], request_[1:])
    found = {event for damaged in damage.every_fault(wire) for event in FrameDecoder(REQUESTS).feed(damaged)}
    assert not [
        event for event in found if isinstance(event, Frame) and BY_CODE[event.code].guarded and event != sent
    ]


@pytest.mark.parametrize("direction", damage.DIRECTIONS)
@pytest.mark.parametrize("kind", damage.EXACT, ids=lambda kind: kind.__name__)
def test_one_changed_byte_never_passes(direction, kind):
    assert damage.try_random(damage.DIRECTIONS[direction], kind, 4000, seed=1).wrong == 0


@pytest.mark.parametrize("kind", damage.LOSSY, ids=lambda kind: kind.__name__)
def test_lost_and_swapped_bytes_pass_at_the_rate_of_16_bits_at_most(kind):
    tally = damage.try_random(REPLIES, kind, 20000, seed=2)
    assert tally.wrong <= max(1, MOST_PER_MILLION * tally.tried / 1e6) + 1


def test_strict_parsing_alone_lets_a_fifth_of_flipped_bits_pass():
    rng, sent = random.Random(3), FrameDecoder(REPLIES).feed(UNCHECKED_STREAM)
    wrong = sum(
        damage.count_wrong(REPLIES, False, sent, damage.flip_bit(UNCHECKED_STREAM, rng)) for _ in range(5000)
    )
    assert 10 < 100 * wrong / 5000 <= MOST_UNCHECKED_PERCENT
