"""The golden vectors through the Python decoder: whole, byte by byte, and amid noise."""

import pytest

from mrl_driver.protocol import REPLIES, REQUESTS, Frame, FrameDecoder, Garbage, Stamp
from tests.vectors import Vector, load

DIRECTIONS = {"requests": REQUESTS, "replies": REPLIES}
VECTORS = [
    pytest.param(name, vector, id=f"{name}: {vector.name}") for name in DIRECTIONS for vector in load(name)
]


def decode(direction: str, checked: bool, *pieces: bytes):
    decoder = FrameDecoder(DIRECTIONS[direction], checked)
    return [event for piece in pieces for event in decoder.feed(piece)]


@pytest.mark.parametrize("direction, vector", VECTORS)
def test_whole(direction: str, vector: Vector):
    assert decode(direction, vector.checked, vector.wire) == vector.events


@pytest.mark.parametrize("direction, vector", VECTORS)
def test_byte_by_byte(direction: str, vector: Vector):
    assert decode(direction, vector.checked, *(bytes([b]) for b in vector.wire)) == vector.events


@pytest.mark.parametrize("direction, vector", VECTORS)
def test_amid_noise(direction: str, vector: Vector):
    """Binary noise and line ends around the vector add one noise event in front, and change nothing else."""
    events = decode(direction, vector.checked, b"\x80\xfe\r\n" + vector.wire + b"\r\n@")
    assert events == [Garbage(b"\x80\xfe", "noise")] + vector.events_at_line_end


def test_frames_of_the_grammar_need_no_table():
    """A cut frame is garbage; the newer frame survives."""
    assert FrameDecoder().feed(b"@6,425@6,4250,6430e") == [
        Garbage(b"@6,425", "restarted"),
        Frame(6, (4250, 6430)),
    ]


def test_stamp_is_compared():
    assert Frame(6, (1, 2), Stamp(1, 2)) != Frame(6, (1, 2))
