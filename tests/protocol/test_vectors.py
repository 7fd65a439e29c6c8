"""The golden vectors through the Python decoder: whole, byte by byte, and amid noise."""

from typing import Callable, List

import pytest

from mrl_driver.protocol import REPLIES, REQUESTS, FrameDecoder, Garbage
from tests.vectors import Vector, load

DIRECTIONS = {"requests": REQUESTS, "replies": REPLIES}
VECTORS = {name: load(name) for name in DIRECTIONS}
each_direction = pytest.mark.parametrize("direction", DIRECTIONS)


def decoded(direction: str, pieces_of: Callable[[Vector], List[bytes]]):
    """Events of each vector by its name."""
    found = {}
    for vector in VECTORS[direction]:
        decoder = FrameDecoder(DIRECTIONS[direction], vector.checked)
        found[vector.name] = [event for piece in pieces_of(vector) for event in decoder.feed(piece)]
    return found


@each_direction
def test_whole(direction: str):
    events = decoded(direction, lambda vector: [vector.wire])
    assert events == {vector.name: vector.events for vector in VECTORS[direction]}


@each_direction
def test_byte_by_byte(direction: str):
    events = decoded(direction, lambda vector: [bytes([byte]) for byte in vector.wire])
    assert events == {vector.name: vector.events for vector in VECTORS[direction]}


@each_direction
def test_amid_noise(direction: str):
    """Binary noise and line ends around the vector add one noise event in front, and change nothing else."""
    noise = Garbage(b"\x80\xfe", "noise")
    events = decoded(direction, lambda vector: [b"\x80\xfe\r\n" + vector.wire + b"\r\n@"])
    assert events == {vector.name: [noise, *vector.events_at_line_end] for vector in VECTORS[direction]}
