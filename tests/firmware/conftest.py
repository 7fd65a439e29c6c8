"""Boards that run the firmware's C++ on the PC."""

from typing import Any, Callable, List

import pytest

from mrl_driver.protocol import REPLIES, Event, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BY_NAME
from sim_arduino.hardware.wiring import Plant
from tests import models
from tests.firmware.pc_board import PcBoard

BOOT_S = 0.1  # The motor board's set-up takes 80 ms of EEPROM pauses


class Bench:
    """A PcBoard and the host's end of its line."""

    def __init__(self, model: str = "traxbot", robot_id: int = 1, boot: bool = True, **options) -> None:
        sonars = options.pop("sonars", True)
        self.plant = options.pop("plant", None) or Plant(models.model(model), sonars=sonars)
        if "eeprom" not in options:
            options["eeprom"] = models.eeprom(robot_id)
        self.board = PcBoard(self.plant, **options)
        self.decoder = FrameDecoder(REPLIES)
        self.events: List[Event] = []
        self.heard = b""
        if boot:
            self.run(BOOT_S)
            self.forget()

    def run(self, seconds: float) -> None:
        data = self.board.advance(self.board.now_s + seconds)
        self.heard += data
        self.events += self.decoder.feed(data)

    def forget(self) -> None:
        self.events.clear()
        self.board.transfers.clear()
        self.heard = b""

    def send(self, name: str, *args: int, wait_s: float = 0.02) -> None:
        """Sends a request by its row's name and lets time pass."""
        self.board.receive(encode_request(BY_NAME[name].code, *args, checked=self.decoder.checked))
        self.run(wait_s)

    def raw(self, data: bytes, wait_s: float = 0.02) -> None:
        self.board.receive(data)
        self.run(wait_s)

    def ask(self, name: str, *args: int, reply: str = "", wait_s: float = 0.02) -> Frame:
        """Sends a request; its answer."""
        code = BY_NAME[reply or name].code
        self.events.clear()
        self.send(name, *args, wait_s=wait_s)
        return next(event for event in self.events if isinstance(event, Frame) and event.code == code)

    def check(self, on: bool) -> None:
        self.board.receive(encode_request(BY_NAME["set_check"].code, int(on)))
        self.decoder.checked = on
        self.run(0.02)

    def frames(self) -> List[Frame]:
        return [event for event in self.events if isinstance(event, Frame)]

    def field(self, row: str, name: str, *args: int) -> int:
        names = [field.name for field in BY_NAME[row].reply]
        return self.ask(row, *args).args[names.index(name)]

    def counter(self, name: str) -> int:
        return self.field("read_counters", name)

    def stop_reason(self) -> str:
        return STOP_REASONS[self.field("read_status", "stop_reason")]

    def faults(self) -> int:
        return self.field("read_status", "faults")

    def writes(self, code: int = -1) -> List[bytes]:
        """What was written to the motor board, polls left out."""
        return [
            data
            for _, kind, address, data in self.board.transfers
            if kind == "write" and address == 0x18 and len(data) > 1 and code in (-1, data[0])
        ]

    def write_times(self, code: int) -> List[float]:
        return [t for t, kind, _, data in self.board.transfers if kind == "write" and data[0] == code]


@pytest.fixture
def bench(close_later: Callable[..., Any]) -> Callable[..., Bench]:

    def make(**options) -> Bench:
        made = Bench(**options)
        close_later(made.board)
        return made

    return make
