"""The boards of 2013, with their faults: what a driver for boards in the field has to live with.

Times are those measured of the 2013 firmware on a simulated ATmega328P; faults those known from its released source.
"""

import math
import struct
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple

from . import config_store
from .config_store import Config
from .omni3md import Geometry
from .plant import SONAR_POWER, SONAR_TRIGGER, Plant
from .sensors import COMPASS_ADDRESS, THERMOPILE_ADDRESS
from .sonars import READING_S, START_S, VOLTS_PER_COUNT
from .wire import IN_BYTE_S, OUT_BYTE_S, Outgoing, Ring

VERSION = 1
BOOT_S = 2.5
PASS_S = 60e-6
"""One pass of the loop with nothing to do [s]."""
COMMAND_S = 0.7e-3
ENCODERS_S, ENCODERS_AND_SONARS_S, INFO_S = 1.17e-3, 2.58e-3, 4.49e-3
"""Time from a request to the first byte of its reply [s]."""
STREAM_EXTRA_S = 0.49e-3
"""What the loop adds to a reply's time while it streams: 325 frames of 27 bytes a second."""
INPUT_BYTES, OUTPUT_BYTES, FRAME_BYTES, DIGITS = 63, 64, 32, 7
MISSING = -1
"""What the 2013 parser has for an argument that is not there, and so refuses when it is."""
NO_MOTORS_FROM_ID = 6
_NO_COUNTS = (999, 999)
_SONAR_A, _SONAR_B, _SONAR_C = 1.767, 0.94657, -0.3759


class _Row(NamedTuple):
    arguments: int
    action: Callable[..., Optional[Tuple[int, ...]]]
    duration_s: float


class _Stream(NamedTuple):
    code: int
    action: Callable[..., Optional[Tuple[int, ...]]]
    duration_s: float


class Board2013:
    """A board with the firmware of August 2013 (its stream repeats 8), or of January (its stream repeats 6).

    One pass of its loop reads one byte and, while it streams, sends one whole frame.
    """

    def __init__(self, plant: Plant, january: bool = False, robot_id: Optional[int] = None) -> None:
        self.plant = plant
        self.january = january
        first_id = plant.model.ids[0] if robot_id is None else robot_id
        self.eeprom = bytearray(config_store.image(config_store.defaults(first_id)))
        self.now_s = 0.0
        self._line: List[Tuple[float, int]] = []
        self._line_s = 0.0
        self._input = Ring(INPUT_BYTES)
        self._rows = self._make_rows()
        self._streamed = self._make_streams()
        self._start()

    # ---- the Engine interface

    def receive(self, data: bytes) -> None:
        """Bytes from the host, the first of them on the wire from now on."""
        start = max(self.now_s, self._line_s)
        self._line += [(start + (i + 1) * IN_BYTE_S, byte) for i, byte in enumerate(data)]
        self._line_s = start + len(data) * IN_BYTE_S

    def advance(self, to_s: float) -> bytes:
        """Runs the loop to `to_s` [s]; the bytes that left the board until then."""
        while True:
            pass_s = self._next_pass_s()
            if pass_s > to_s:
                break
            self.now_s = max(self.now_s, pass_s)
            self._loop()
        self.now_s = max(self.now_s, to_s)
        self._hear(self.now_s)
        self.plant.advance(self.now_s)
        return self._out.take(self.now_s)

    @property
    def next_event_s(self) -> float:
        """When something happens, or has left, if no bytes come [s]."""
        return min(self._out.next_s, self._next_pass_s())

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The loop stood still until `to_s`; the input buffer kept what it has room for, and it is carried out."""
        self.plant.advance(to_s)
        self.now_s = self._busy_s = to_s
        self._hear(to_s)
        self._input.put(waiting)

    def reset(self) -> None:
        """The reset line; the motor board keeps going until the set-up stops it."""
        self._start()

    def close(self) -> None:
        """Nothing to free."""

    # ---- the loop

    def _start(self) -> None:
        self._busy_s = self.now_s + BOOT_S
        self._booted = False
        self._line.clear()
        self._line_s = self.now_s
        self._input = Ring(INPUT_BYTES)
        self._out = Outgoing()
        self._out.free_s = self.now_s
        self._frame: Optional[bytearray] = None
        self._debug = False
        self._stream = 0
        self._trigger_s = math.inf

    def _set_up(self) -> None:
        self._booted = True
        (number,) = struct.unpack_from("<f", self.eeprom, config_store.ID_AT)
        self.robot_id = int(number)
        self.motors_there = self.robot_id < NO_MOTORS_FROM_ID
        self.plant.pin_changed(SONAR_POWER, 1, self.now_s)
        self._trigger_s = self.now_s + START_S
        if self._motors():
            config, motor, now = Config(self.eeprom), self.plant.motor_board, self.now_s
            motor.fed = True
            motor.stop(now)
            motor.set_geometry(now, Geometry(*(config[name] for name in Geometry._fields)))
            motor.set_gains(now, config["kp"], config["ki"], config["kd"])
            motor.set_ramp(now, config["ramp_time"], config["ramp_gain"])
            motor.set_timeout(now, 0)

    def _next_pass_s(self) -> float:
        """The next pass that has something to do."""
        due = self._trigger_s
        if not self._booted or self._stream or self._input:
            due = self._busy_s
        elif self._line:
            due = min(due, self._line[0][0])
        return max(due, self._busy_s)

    def _loop(self) -> None:
        if not self._booted:
            self._set_up()
        self._hear(self.now_s)
        if self._trigger_s <= self.now_s:
            self._trigger()
        self._busy_s = self.now_s + PASS_S
        byte = self._input.take()
        if byte is not None:
            self._parse(byte)
        if self._stream:
            self._send_stream()
        self._busy_s = max(self._busy_s, self._out.free_s - OUTPUT_BYTES * OUT_BYTE_S)

    def _hear(self, to_s: float) -> None:
        """Moves what has arrived into the input buffer."""
        arrived = 0
        while arrived < len(self._line) and self._line[arrived][0] <= to_s:
            arrived += 1
        self._input.put(bytes(byte for _, byte in self._line[:arrived]))
        del self._line[:arrived]

    def _trigger(self) -> None:
        self.plant.pin_changed(SONAR_TRIGGER, 1, self.now_s)
        self.plant.pin_changed(SONAR_TRIGGER, 0, self.now_s)
        self._trigger_s = self.now_s + 3.2 * READING_S

    # ---- the parser and its faults

    def _parse(self, byte: int) -> None:
        """One byte.  A '@' inside a frame throws away that frame, and the new one with it."""
        if byte == ord("@"):
            self._frame = bytearray() if self._frame is None else None
        elif self._frame is not None:
            self._frame.append(byte)
            if byte == ord("e"):
                frame, self._frame = bytes(self._frame[:-1]), None
                self._execute(frame)
            elif len(self._frame) >= FRAME_BYTES - 1:
                self._frame = None

    def _execute(self, frame: bytes) -> None:
        values = [_number(token) for token in frame.split(b",")]
        row = self._rows.get(values[0])
        self._say(b"[INFO] received @" + frame + b"e ")
        if row is None:
            self._say(b"[ERROR] unknown command ")
            return
        args = (values[1:] + [MISSING] * row.arguments)[: row.arguments]
        if MISSING in args:
            self._say(b"[ERROR] missing argument ")
            return
        self._busy_s = self.now_s + row.duration_s
        self._send(values[0], row.action(*args), self._busy_s)

    def _send_stream(self) -> None:
        code, action, duration_s = self._streamed[self._stream]
        ready_s = self._busy_s + duration_s
        self._send(code, action(), ready_s)
        self._busy_s = ready_s + STREAM_EXTRA_S - PASS_S

    def _send(self, code: int, fields: Optional[Tuple[int, ...]], at_s: float) -> None:
        if fields is not None:
            self._out.put(b"@" + b",".join(b"%d" % value for value in (code, *fields)) + b"e\r\n", at_s)

    def _say(self, text: bytes) -> None:
        """Debug text, which stands on the line of whatever comes next."""
        if self._debug:
            self._out.put(text, self.now_s)

    # ---- the commands

    def _make_rows(self) -> Dict[int, _Row]:
        motor = self.plant.motor_board
        quick: Dict[int, Tuple[int, Callable[..., Optional[Tuple[int, ...]]]]] = {
            1: (0, lambda: self._drive(motor.calibrate)),
            2: (3, lambda *gains: self._drive(motor.set_gains, *gains)),
            3: (2, lambda *args: self._drive(motor.set_prescaler, *args)),
            4: (2, lambda *args: self._drive(motor.preset_encoder, *args)),
            9: (2, lambda left, right: self._drive(motor.move_percent, (left, 0, right), True)),
            10: (2, lambda left, right: self._drive(motor.move_percent, (left, 0, right), False)),
            11: (
                2,
                lambda linear, angular: self._drive(
                    motor.move_differential, _scaled(linear), _scaled(angular)
                ),
            ),
            12: (3, lambda *args: self._drive(motor.move_to_position, *args, True)),
            13: (0, lambda: self._drive(motor.stop)),
            14: (0, self._reset_encoders),
            15: (0, lambda: (int(self._debug),)),
            16: (1, self._set_debug),
            17: (0, lambda: (int(self._stream != 0),)),
            20: (0, lambda: (1023 - self._adc(0),)),
            21: (0, lambda: (round(self.plant.sensed(self.now_s).dust_pcs_l),)),
            22: (0, self._pixels),
        }
        for start, end in ((18, 19), (23, 24), (25, 26), (27, 28)):
            quick[start] = (0, lambda code=start: self._set_stream(code))
            quick[end] = (0, lambda: self._set_stream(0))
        rows = {code: _Row(count, action, COMMAND_S) for code, (count, action) in quick.items()}
        rows[5] = _Row(0, self._info, INFO_S)
        rows[6] = _Row(0, self._encoders, ENCODERS_S)
        rows[7] = _Row(0, self._sonars, ENCODERS_AND_SONARS_S - ENCODERS_S)
        rows[8] = _Row(0, lambda: self._encoders() + self._sonars(), ENCODERS_AND_SONARS_S)
        return rows

    def _make_streams(self) -> Dict[int, _Stream]:
        """By the command that starts them."""
        main = 6 if self.january else 8
        return {
            18: _Stream(main, self._rows[main].action, self._rows[main].duration_s),
            23: _Stream(23, self._sensors, ENCODERS_AND_SONARS_S),
            25: _Stream(25, lambda: self._sensors() + (self._adc(2),), ENCODERS_AND_SONARS_S),
            27: _Stream(27, self._bearing, ENCODERS_S),
        }

    def _motors(self) -> bool:
        return self.motors_there and self.plant.motor_board.present

    def _drive(self, method: Callable[..., None], *args: object) -> None:
        if self._motors():
            method(self.now_s, *args)

    def _reset_encoders(self) -> None:
        for encoder in (1, 2, 3):
            self._drive(self.plant.motor_board.preset_encoder, encoder, 0)

    def _set_debug(self, on: int) -> None:
        self._debug = on != 0

    def _set_stream(self, code: int) -> None:
        self._stream = code

    def _info(self) -> Tuple[int, ...]:
        motor, now = self.plant.motor_board, self.now_s
        if not self._motors():
            return 0, 0, 0, VERSION, self.robot_id
        tenths = round(motor.temperature_c(now) * 10.0), round(motor.battery_v(now) * 10.0)
        return tenths[0] * 10, 172, tenths[1] * 10, VERSION, self.robot_id

    def _encoders(self) -> Tuple[int, ...]:
        """A read that failed reads 0."""
        if not self._motors():
            return 0, 0
        motor = self.plant.motor_board
        return motor.encoder(3, self.now_s), motor.encoder(1, self.now_s)

    def _sonars(self) -> Tuple[int, ...]:
        return tuple(int(_SONAR_A * self._adc(i) ** _SONAR_B + _SONAR_C) for i in range(3))

    def _sensors(self) -> Tuple[int, ...]:
        counts = self._encoders() if self.motors_there else _NO_COUNTS
        return counts + (
            1023 - self._adc(0),
            round(self.plant.sensed(self.now_s).dust_pcs_l),
            max(self._pixels()),
        )

    def _pixels(self) -> Tuple[int, ...]:
        return tuple(self._registers(THERMOPILE_ADDRESS, 2, 8))

    def _bearing(self) -> Tuple[int, ...]:
        return (int.from_bytes(self._registers(COMPASS_ADDRESS, 2, 2), "big") // 10,)

    def _registers(self, address: int, first: int, count: int) -> bytes:
        slave = self.plant.i2c[address]
        return slave.read(count, self.now_s) if slave.write(bytes([first]), self.now_s) else bytes(count)

    def _adc(self, channel: int) -> int:
        return min(1023, int(self.plant.adc_volts(channel, self.now_s) / VOLTS_PER_COUNT))


def _number(token: bytes) -> int:
    """A number as the 2013 parser reads it: what is no digit is skipped, 16 bits are kept, nothing at all is -1."""
    digits = bytes(byte for byte in token if chr(byte).isdigit())
    if not digits or len(digits) > DIGITS:
        return MISSING
    value = -int(digits) if token[:1] == b"-" else int(digits)
    return (value + 0x8000 & 0xFFFF) - 0x8000


def _scaled(wire: int) -> int:
    """A speed as it reaches the motor board: to SI in single precision and back, cut off."""

    def single(value: float) -> float:
        return float(struct.unpack("f", struct.pack("f", value))[0])

    return int(single(single(wire / 1000.0) * 1000.0))


class Board2013August(Board2013):
    """The board whose stream repeats the reply of 8."""

    def __init__(self, plant: Plant, robot_id: Optional[int] = None) -> None:
        super().__init__(plant, False, robot_id)


class Board2013January(Board2013):
    """The board whose stream repeats the reply of 6."""

    def __init__(self, plant: Plant, robot_id: Optional[int] = None) -> None:
        super().__init__(plant, True, robot_id)
