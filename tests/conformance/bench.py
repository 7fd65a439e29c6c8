"""A board of any engine and motor back end on a bench: requests in, replies out, and what the wheels do."""

from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple, Union

from mrl_driver.geometry import Pose
from mrl_driver.protocol import REPLIES, Event, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME, REASONS
from mrl_driver.robot.chips import ATMEGA2560
from mrl_driver.robot.models import COMMON_BOARD, RobotModel
from sim_arduino.board import PythonBoard, parameter_store
from sim_arduino.board.avr_board import FIRMWARE, AvrEngine
from sim_arduino.hardware.motor import Mode
from sim_arduino.hardware.wiring import Plant
from tests.firmware.pc_board import BRIDGE, BROWN_OUT, ENVIRONMENT, MEGA, SONARS, VIRTUAL, XBEE, PcBoard
from tests.firmware.virtual_chip import driven
from tests.models import model

READY_S = 0.12  # Boot, and the motor board set up
ANSWER_S = 0.03
COUNTED_S = 0.1  # In which counts become a speed
CONTROL_S = 0.6  # Longer than the control takes after the ramp
QUICK: Dict[str, Dict[str, int]] = {"omni3md": {}, **dict.fromkeys(("bridge", "virtual"), {"ramp_time": 300})}
"""Parameters that differ from the models': a quick ramp spares simulated time, which steps of 1 ms make dear."""
STEP_S = 1e-3
"""Resolution of `run_until_released`, and the slices in which the simulated chip drives an H-bridge."""

BLANK = b"\xff" * parameter_store.EEPROM_BYTES

ROBOTS = {
    "omni3md": "traxbot",
    "bridge": "duo",
    "virtual": "duo",
}  # Robot on the bench for each motor back end

CAPABILITIES = {
    "omni3md": 1 + 2 + 4 + 8 + 16 + 128 + 256,
    "bridge": 1 + 2 + 4 + 8 + 16 + 256 + 512 + 1024 + 2048 + 16384,
    "virtual": 1 + 2 + 4 + 8 + 16 + 256 + 512 + 2048 + 16384 - 32768,
}
"""Capabilities of the sonar builds by motor back end; the duo does not measure its battery."""


class Status(NamedTuple):
    uptime_high: int
    uptime: int
    reset_cause: int
    stop_reason: int
    faults: int
    clamped: int
    impossible: int = 0


class Wheels(NamedTuple):
    """True speeds of the wheels [m/s]."""

    left: float
    right: float


def make_python(plant: Plant, eeprom: bytes, environment: bool) -> Any:
    return PythonBoard(plant, environment=environment, eeprom=bytearray(eeprom))


class RadioPcBoard(PcBoard):
    """Whole packets pass between the board and its radio module, at most 1 ms late."""

    def advance(self, to_s: float) -> bytes:
        out, xbee, at_s = b"", self.plant.xbee, self.now_s
        while at_s < to_s:
            at_s = min(to_s, at_s + STEP_S)
            out += super().advance(at_s)
            xbee.receive(self.radio_sent(), at_s)
            for byte in b"".join(xbee.take(at_s)):
                self.native.pc_radio_receive(byte)
        return out


def make_pc(plant: Plant, eeprom: bytes, environment: bool) -> Any:
    if plant.xbee:
        return RadioPcBoard(plant, eeprom, XBEE)
    bridge = MEGA if plant.model.chip == ATMEGA2560.name else BRIDGE
    return PcBoard(plant, eeprom, ENVIRONMENT if environment else bridge if plant.bridge else SONARS)


def make_avr(plant: Plant, eeprom: bytes, environment: bool) -> Any:
    bridge = "_hbridge_mega" if plant.model.chip == ATMEGA2560.name else "_hbridge"
    suffix = "_environment" if environment else bridge if plant.bridge else "_xbee" if plant.xbee else ""
    engine = AvrEngine(plant, FIRMWARE.with_name(f"mrl_firmware{suffix}.elf"))
    engine.machine.write_eeprom(0, eeprom)
    return engine


def ready_eeprom(robot: RobotModel, stored: Dict[str, int]) -> bytes:
    """The EEPROM of a robot of a model with these parameters instead of its own."""
    values = parameter_store.first(robot.ids[0], robot)
    for name, value in stored.items():
        values[PARAMETER_BY_NAME[name].number] = value
    return parameter_store.image(values)


ENGINES: Dict[str, Callable[[Plant, bytes, bool], Any]] = {
    "python": make_python,
    "pc": make_pc,
    "avr": make_avr,
}


class VirtualAvr(AvrEngine):
    """The image of a bare board."""

    def __init__(self, plant: Plant, eeprom: bytes, environment: bool) -> None:
        super().__init__(plant, FIRMWARE.with_name("mrl_firmware_virtual.elf"), bare=True)
        self.machine.write_eeprom(0, eeprom)

    def driven(self) -> List[bool]:
        """Whether each motor is driven."""
        return driven(self.machine)


VIRTUAL_ENGINES: Dict[str, Callable[[Plant, bytes, bool], Any]] = {
    "pc": lambda plant, eeprom, environment: PcBoard(plant, eeprom, VIRTUAL),
    "avr": VirtualAvr,
}
"""Those that run the firmware; the plant of a bare board stands by."""


class Bench:
    """One board with the plant of its motor back end's robot, or of another model, awake and set up.

    Args:
        board: Numbers of the robot's hardware, and of its board, that differ from the model's.
        stored: Parameters in the EEPROM by name that differ from those of a robot that is ready to drive.
        eeprom: What is in it instead of a robot's parameters.

    Attributes:
        text: Everything the board has sent.
        ramped_s: Time after which any speed is reached [s].
    """

    def __init__(
        self,
        engine: str,
        motors: str = "omni3md",
        robot: Union[str, RobotModel] = "",
        environment: bool = False,
        board: Optional[Dict[str, int]] = None,
        stored: Optional[Dict[str, int]] = None,
        eeprom: bytes = b"",
        **plant: Any,
    ) -> None:
        self.motors = motors
        base = robot if isinstance(robot, RobotModel) else model(robot or ROBOTS[motors])
        self.model = base._replace(board={**base.board, **QUICK[motors], **(board or {})})
        self.ramped_s = self.model.board["ramp_time"] / 1000.0 + CONTROL_S
        self.plant = Plant(self.model, sonars=not environment, **plant)
        self.environment = environment
        eeprom = eeprom or ready_eeprom(self.model, stored or {})
        engines = VIRTUAL_ENGINES if motors == "virtual" else ENGINES
        self.board = engines[engine](self.plant, eeprom, environment)
        self.now_s = 0.0
        self.checked = False
        self.text = b""

    def wake(self) -> "Bench":
        self.run(READY_S)
        if not self.plant.bridge:
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
        log = self.plant.motor_board.commands
        new = [(each.code, *each.values) for each in log]
        log.clear()
        return new

    def wheels(self) -> Wheels:
        """True speeds of the wheels [m/s]; of a virtual robot by its counts, which takes a moment."""
        if self.motors == "virtual":
            return self._counted()
        left, right = (self.plant.robot.motors[index].speed for index in (0, 2))
        drive = self.model.drive
        return Wheels(left * drive.left_m_per_count, right * drive.right_m_per_count)

    def _counted(self) -> Wheels:
        first = self._counts()
        self.run(COUNTED_S - ANSWER_S)
        moved = [(now - before + 0x8000) % 0x10000 - 0x8000 for before, now in zip(first, self._counts())]
        right, left = (each * self.model.drive.metres_per_count / COUNTED_S for each in moved)
        return Wheels(left, right)

    def _counts(self) -> Tuple[int, ...]:
        code = BY_NAME["read_encoders"].code
        frames = (event for event in self.ask("read_encoders") if isinstance(event, Frame))
        return next(frame.args for frame in frames if frame.code == code)

    @property
    def true_pose(self) -> Pose:
        """Where the robot is; of a virtual one in whole millimetres from its start."""
        if self.motors != "virtual":
            return self.plant.true_pose
        x, y, heading = self.reply("read_virtual_pose")
        return Pose(x / 1000 - 1.0, y / 1000 - 1.0, heading / 1000)

    def full_speed_m_s(self) -> float:
        """Rim speed of a wheel at 100 %."""
        turn = self.model.board["gearbox"] * self.model.board["encoder_counts"] / 100.0
        per_minute = self.model.board.get("full_speed", COMMON_BOARD["full_speed"])
        return per_minute / 60.0 * turn * self.model.drive.metres_per_count

    def is_driven(self) -> bool:
        """Whether the board drives a motor, or lets a motor board drive it."""
        if self.plant.bridge:
            return any(self.driven())
        motors = (self.plant.robot.motors[0], self.plant.robot.motors[2])
        return any(motor.mode is not Mode.BRAKE for motor in motors)

    def driven(self) -> List[bool]:
        """Which motors an H-bridge drives, in the order of the wiring."""
        if isinstance(self.board, VirtualAvr):
            return self.board.driven()
        bridge = self.plant.bridge
        shares = [bridge.motor(wheel).shares for wheel in range(len(bridge.outputs))]
        return [bool(each.forward or each.backward) for each in shares]

    def run_until_released(self, limit_s: float) -> float:
        """Runs until no motor is driven; the time at which that was seen [s], up to STEP_S late.

        Raises:
            AssertionError: a motor is still driven after `limit_s`.
        """
        last_s = self.now_s + limit_s
        while self.is_driven():
            assert self.now_s < last_s, f"a motor is still driven after {limit_s} s"
            self.run(STEP_S)
        return self.now_s

    def stop_reason(self) -> str:
        return STOP_REASONS[self.status().stop_reason]

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

    def brown_out(self) -> None:
        if isinstance(self.board, PcBoard):
            self.board.reset(BROWN_OUT)
        else:
            self.board.brown_out()

    def close(self) -> None:
        self.board.close()
