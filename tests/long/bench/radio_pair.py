"""Two emulated robots with radios, and the host of each, in simulated time."""

from typing import Any, Callable, Set

from mrl_driver.host.firmware_images import image_path
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot import models
from mrl_driver.robot.radio import text_of, text_request
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.hardware.xbee import RadioFit
from sim_arduino.world.world import World


def radio_image(plant: Plant) -> AvrEngine:
    """The firmware's image with a radio, on the simulated chip."""
    return AvrEngine(plant, image_path("xbee"))


class Pair:
    """Attributes: `arrived` has the texts that the second host got."""

    def __init__(
        self, board: Callable[[Plant], Any], step_s: float, loss: float = 0.0, seed: int = 0
    ) -> None:
        world, model, fit = World(), models.load("traxbot"), RadioFit(loss=loss)
        self.plants = [Plant(model, world, (n, 0, 0), name=f"robot{n}", seed=seed, radio=fit) for n in (0, 1)]
        self.boards = [board(plant) for plant in self.plants]
        self.address = self.plants[1].xbee.station.address
        self.arrived: Set[bytes] = set()
        self.now_s, self._step_s, self._decoder = 0.0, step_s, FrameDecoder(REPLIES)

    def tell(self, board: int, name: str, *args: int) -> None:
        self.boards[board].receive(encode_request(BY_NAME[name].code, *args))

    def say(self, to: int, text: bytes) -> None:
        """The first host writes a text."""
        code, *fields = text_request(to, text)
        self.boards[0].receive(encode_request(code, *fields))

    def step(self) -> None:
        self.now_s += self._step_s
        self.boards[0].advance(self.now_s)
        for event in self._decoder.feed(self.boards[1].advance(self.now_s)):
            received = text_of(event) if isinstance(event, Frame) else None
            if received:
                self.arrived.add(received.data)

    def run_until(self, end_s: float) -> None:
        while self.now_s < end_s:
            self.step()

    def close(self) -> None:
        for board in self.boards:
            board.close()
