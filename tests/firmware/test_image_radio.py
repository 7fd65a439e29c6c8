"""Two robots with the radio build's image: from host to host through chip, module and air, in simulated time."""

from pathlib import Path
from typing import List, Optional, Tuple

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.robot import models
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.hardware.xbee import RadioFit
from sim_arduino.world.world import World
from tests.firmware.test_xbee import words

IMAGE = Path(__file__).resolve().parent.parent.parent / "build" / "firmware" / "mrl_firmware_xbee.elf"
STEP_S = 2e-3
BYTES_S = 10 / 9600
SENT_BYTES, RECEIVED_BYTES = 18 + 5, 16 + 5
"""Packets with a text of five characters, to a module and from one."""
REST_S = 17e-3
"""Two frames on USB 8 ms, the packet in the air 4 ms with the longest wait before it, slices and steps 4 ms [s]."""


class Pair:
    """Two boards; times in simulated seconds."""

    def __init__(self) -> None:
        world, model = World(), models.load("traxbot")
        self.plants = [Plant(model, world, (n, 0, 0), name=f"robot{n}", radio=RadioFit()) for n in (0, 1)]
        self.boards = [AvrEngine(plant, IMAGE) for plant in self.plants]
        self._decoders = [FrameDecoder(REPLIES) for _ in self.boards]
        self.now_s = 0.0
        self.run(0.1)

    def words(self, number: int) -> Tuple[int, ...]:
        return words(self.plants[number].xbee.station.address.to_bytes(8, "big"))[1:]

    def send(self, number: int, to: Tuple[int, ...], text: bytes) -> None:
        self.boards[number].receive(encode_request(38, *to, *words(text)))

    def run(self, seconds: float, step_s: float = STEP_S) -> List[Tuple[float, int, Frame]]:
        """Frames to the hosts: time [s], number of the board, frame."""
        found, end_s = [], self.now_s + seconds
        while self.now_s < end_s:
            self.now_s += step_s
            for number, board in enumerate(self.boards):
                frames = self._decoders[number].feed(board.advance(self.now_s))
                found += [(self.now_s, number, frame) for frame in frames]
        return found

    def next_frame(self, within_s: float = 0.2, step_s: float = STEP_S) -> Optional[Tuple[float, int, Frame]]:
        end_s = self.now_s + within_s
        while self.now_s < end_s:
            found = self.run(step_s, step_s)
            if found:
                return found[0]
        return None


@pytest.fixture(scope="module")
def pair():
    made = Pair()
    yield made
    for board in made.boards:
        board.close()


def test_text_goes_from_host_to_host(pair):
    pair.send(0, pair.words(1), b"hello")
    _, number, frame = pair.next_frame()
    assert (number, frame) == (1, Frame(39, (*pair.words(0), *words(b"hello"))))


def test_text_takes_the_time_of_two_lines_and_the_air(pair):
    pair.run(0.1)
    start_s = pair.now_s
    pair.send(1, pair.words(0), b"hello")
    lines_s = (SENT_BYTES + RECEIVED_BYTES) * BYTES_S
    took_s = pair.next_frame()[0] - start_s
    assert lines_s < took_s < lines_s + REST_S
