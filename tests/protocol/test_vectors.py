"""The golden vectors through the Python decoder: whole, byte by byte, and amid noise."""

from typing import Callable, List

import pytest

from mrl_driver.protocol import REPLIES, REQUESTS, Frame, FrameDecoder, Garbage, Stamp
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
def test_names_differ(direction: str):
    assert len({vector.name for vector in VECTORS[direction]}) == len(VECTORS[direction]) > 10


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


def test_frames_of_the_grammar_need_no_table():
    """A cut frame is garbage; the newer frame survives."""
    assert FrameDecoder().feed(b"@6,425@6,4250,6430e") == [
        Garbage(b"@6,425", "restarted"),
        Frame(6, (4250, 6430)),
    ]


def test_stamp_is_compared():
    assert Frame(6, (1, 2), Stamp(1, 2)) != Frame(6, (1, 2))
