"""A board of any engine on a bench: requests in, replies out, and what reached the motor board."""

from typing import Any, Callable, Dict, List, NamedTuple, Tuple

from mrl_driver.protocol import REPLIES, Event, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME, REASONS
from sim_arduino.board import PythonBoard
from sim_arduino.board.avr_board import FIRMWARE, AvrEngine
from sim_arduino.hardware.wiring import Plant
from tests.firmware.pc_board import ENVIRONMENT, SONARS, PcBoard
from tests.models import eeprom, model

READY_S = 0.12
"""Boot, and the motor board set up."""
ANSWER_S = 0.03


class Status(NamedTuple):
    """The reply to read_status."""

    uptime_high: int
    uptime: int
    reset_cause: int
    stop_reason: int
    faults: int
    clamped: int


def make_python(plant: Plant, eeprom: bytes, environment: bool) -> Any:
    return PythonBoard(plant, environment=environment, eeprom=bytearray(eeprom))


def make_pc(plant: Plant, eeprom: bytes, environment: bool) -> Any:
    return PcBoard(plant, eeprom, ENVIRONMENT if environment else SONARS)


def make_avr(plant: Plant, eeprom: bytes, environment: bool) -> Any:
    image = FIRMWARE.with_name("mrl_firmware_environment.elf") if environment else FIRMWARE
    engine = AvrEngine(plant, image)
    engine.machine.write_eeprom(0, eeprom)
    return engine


ENGINES: Dict[str, Callable[[Plant, bytes, bool], Any]] = {
    "python": make_python,
    "pc": make_pc,
    "avr": make_avr,
}


class Bench:
    """One board with TraxBot's or another model's plant, awake and set up.

    Attributes:
        text: Everything the board has sent.
    """

    def __init__(self, engine: str, robot: str = "traxbot", environment: bool = False, **plant: Any) -> None:
        self.model = model(robot)
        self.plant = Plant(self.model, sonars=not environment, **plant)
        self.environment = environment
        self.board = ENGINES[engine](self.plant, eeprom(self.model.ids[0]), environment)
        self.now_s = 0.0
        self.checked = False
        self.text = b""
        self._seen = 0

    def wake(self) -> "Bench":
        self.run(READY_S)
        self.commands()
        return self

    def run(self, seconds: float) -> bytes:
        self.now_s += seconds
        out = self.board.advance(self.now_s)
        self.text += out
        return out

    def send(self, data: bytes, wait_s: float = ANSWER_S) -> bytes:
        self.board.receive(data)
        return self.run(wait_s)

    def ask(self, name: str, *args: int, wait_s: float = ANSWER_S) -> List[Event]:
        """Sends the row's request; the frames and garbage that came within `wait_s`."""
        out = self.send(encode_request(BY_NAME[name].code, *args, checked=self.checked), wait_s)
        if name == "set_check":
            self.checked = bool(args[0])
        return FrameDecoder(REPLIES, self.checked).feed(out)

    def reply(self, name: str, *args: int, wait_s: float = ANSWER_S) -> Tuple[int, ...]:
        """The arguments of the one reply to a request."""
        events = self.ask(name, *args, wait_s=wait_s)
        assert [type(event) for event in events] == [Frame], events
        assert events[0].code == BY_NAME[name].code
        return events[0].args

    def commands(self) -> List[Tuple[int, ...]]:
        """What has reached the motor board since the last call: register, values."""
        log = list(self.plant.motor_board.commands)
        new, self._seen = log[self._seen :], len(log)
        return [(each.code, *each.values) for each in new]

    def counters(self) -> Dict[str, int]:
        """Refusals by reason, those that happened; a stream or debug text may run beside the reply."""
        frames = [event for event in self.ask("read_counters") if isinstance(event, Frame)]
        values = next(frame.args for frame in frames if frame.code == BY_NAME["read_counters"].code)
        return {reason.name: value for reason, value in zip(REASONS, values) if value}

    def status(self) -> Status:
        return Status(*self.reply("read_status"))

    def write_config(self, name: str, value: int) -> None:
        number = PARAMETER_BY_NAME[name].number
        assert self.reply("write_config", number, value) == (number, value)

    def close(self) -> None:
        self.board.close()
