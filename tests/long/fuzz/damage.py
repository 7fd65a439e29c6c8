"""Damaged frames, and how many of them a decoder takes for good.

`wrong` counts accepted frames that carry a value which was not sent.  A bare stop that comes out of damage is not
counted: it needs no check value by design, and stops.
"""

import random
from typing import Callable, Iterator, List, NamedTuple

from mrl_driver.protocol import (
    REPLIES,
    REQUESTS,
    Direction,
    Event,
    Frame,
    FrameDecoder,
    Stamp,
    encode_reply,
    encode_request,
)
from mrl_driver.protocol.table import COMMANDS, STOP_CODE

STOP = Frame(STOP_CODE, ())
USES = 10
"""A frame of the pool is damaged so often, each time anew: to make one costs as much as to damage three."""
Damage = Callable[[bytes, random.Random], bytes]


class Tally(NamedTuple):
    """How many damaged frames were tried, and how many values that nobody sent were accepted."""

    tried: int
    wrong: int


def flip_bit(wire: bytes, rng: random.Random) -> bytes:
    i = rng.randrange(len(wire))
    return wire[:i] + bytes([wire[i] ^ 1 << rng.randrange(8)]) + wire[i + 1 :]


def change_byte(wire: bytes, rng: random.Random) -> bytes:
    i = rng.randrange(len(wire))
    return wire[:i] + bytes([wire[i] ^ rng.randrange(1, 256)]) + wire[i + 1 :]


def lose_byte(wire: bytes, rng: random.Random) -> bytes:
    i = rng.randrange(len(wire))
    return wire[:i] + wire[i + 1 :]


def lose_burst(wire: bytes, rng: random.Random) -> bytes:
    """2 to 64 bytes missing: frames merge."""
    i = rng.randrange(len(wire))
    return wire[:i] + wire[i + rng.randrange(2, 65) :]


def swap_bytes(wire: bytes, rng: random.Random) -> bytes:
    i = rng.randrange(len(wire) - 1)
    return wire[:i] + wire[i + 1 : i + 2] + wire[i : i + 1] + wire[i + 2 :]


def random_stream_frame(rng: random.Random, checked: bool) -> bytes:
    counts = (rng.randrange(-32768, 32768), rng.randrange(-32768, 32768))
    sonars = [rng.randrange(15, 646) for _ in range(3)]
    stamp = Stamp(rng.randrange(-32768, 32768), rng.randrange(-32768, 32768))
    return encode_reply(8, *counts, *sonars, stamp=stamp, checked=checked)


def random_request(rng: random.Random, checked: bool) -> bytes:
    """A move, or now and then any other row of the table."""
    row = COMMANDS[10] if rng.random() < 0.5 else rng.choice([r for r in COMMANDS if r.name != "xbee_text"])
    return encode_request(row.code, *(rng.randint(f.low, f.high) for f in row.request), checked=checked)


def try_random(direction: Direction, damage: Damage, count: int, seed: int, checked: bool = True) -> Tally:
    """Damages one of three frames in a row, `count` times, and decodes all three; frames are drawn from a pool."""
    rng = random.Random(seed)
    make = random_stream_frame if direction is REPLIES else random_request
    pool = [make(rng, checked) for _ in range(count // USES + 3)]
    good = [FrameDecoder(direction, checked).feed(wire) for wire in pool]
    wrong = 0
    for i in range(count):
        at = i // USES
        received = pool[at] + damage(pool[at + 1] + pool[at + 2], rng)
        sent = good[at] + good[at + 1] + good[at + 2]
        wrong += count_wrong(direction, checked, sent, received)
    return Tally(count, wrong)


def try_every_fault(direction: Direction, wire: bytes) -> Tally:
    """Every bit flipped, every byte changed to every other, lost, and swapped with its neighbour, once each."""
    tried = wrong = 0
    sent = FrameDecoder(direction, True).feed(wire)
    for damaged in every_fault(wire):
        tried += 1
        wrong += count_wrong(direction, True, sent, damaged + b"\r\n" + wire)
    return Tally(tried, wrong)


def every_fault(wire: bytes) -> Iterator[bytes]:
    """All single faults of one frame; flipped bits are among the changed bytes."""
    for i in range(len(wire)):
        yield wire[:i] + wire[i + 1 :]
        if i + 1 < len(wire) and wire[i] != wire[i + 1]:
            yield wire[:i] + wire[i + 1 : i + 2] + wire[i : i + 1] + wire[i + 2 :]
        for byte in range(256):
            if byte != wire[i]:
                yield wire[:i] + bytes([byte]) + wire[i + 1 :]


def count_wrong(direction: Direction, checked: bool, sent: List[Event], received: bytes) -> int:
    found = FrameDecoder(direction, checked).feed(received)
    return sum(type(event) is Frame and event not in sent and event != STOP for event in found)


DIRECTIONS = {"requests": REQUESTS, "replies": REPLIES}
EXACT = (flip_bit, change_byte)  # Damage that the check value catches always
LOSSY = (lose_byte, lose_burst, swap_bytes)  # Damage that it catches at the rate of its 16 bits
