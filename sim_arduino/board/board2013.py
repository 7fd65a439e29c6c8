"""The boards of 2013 with their faults, which a driver for boards in the field must tolerate.

The times were measured with the 2013 firmware on a simulated ATmega328P, without the bootloader's second.  The faults
are those of its released source.
"""

import math
import re
import struct
from functools import partial
from typing import Callable, Iterator, List, NamedTuple, Optional, Set, Tuple

from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.table import BAUD
from sim_arduino.hardware.environment_sensors import COMPASS_ADDRESS, THERMOPILE_ADDRESS
from sim_arduino.hardware.omni3md import BoardGeometry
from sim_arduino.hardware.sonars import VOLTS_PER_COUNT
from sim_arduino.hardware.wiring import SONAR_POWER, SONAR_TRIGGER, Plant

from . import parameter_store
from .engine import Engine
from .parameter_store import Config
from .uart import IN_BYTE_S, OUT_BYTE_S, Outgoing, Ring, through_line

STOP_S = 0.011
"""From a reset to the stop of the motor board [s]; the real board sets it up within 70 ms, this one at once."""
AUGUST_S, JANUARY_S = 3.35, 0.10
"""From a reset to the first request that is read [s]; the August firmware waits 3 s for its environment sensors."""
PASS_S = 60e-6  # duration of one pass of the loop with nothing to do [s]
PRINT_S = 18e-6
"""Time to print a byte into the output buffer [s]: gives 325 stream frames of 27 bytes per second."""
INPUT_BYTES, OUTPUT_BYTES, FRAME_BYTES, DIGITS = 63, 64, 32, 7
MISSING = -1  # the 2013 parser's value for a missing argument; it therefore refuses a real -1
VERSION = 1
COMMAND_S, PRINTED_S = 0.7e-3, 0.07e-3
"""Time to pass a command on to the motor board, and to reply without a sensor reading [s]."""
ENCODERS_S, SONARS_S, INFO_S = 1.17e-3, 1.41e-3, 4.6e-3  # time that each reading takes [s]
THERMOPILE_S, ANALOG_S, COMPASS_S, JANUARY_SONARS_S = 4.3e-3, 0.11e-3, 0.79e-3, 59.2e-3
CALIBRATION_S, POSITION_S = 95e-3, 1e-3  # pauses after these commands [s]
NO_MOTORS_FROM_ID = 6
JANUARY_CODES = range(1, 20)
STREAMS = (18, 23, 27, 25)  # requests that repeat; the earlier ones have priority
_NO_COUNTS = (999, 999)
_NO_VERSION = 25755  # version reported if the motor board does not answer: both of its bytes are read as 255
_SONAR_A, _SONAR_B, _SONAR_C = 1.767, 0.9465, -0.3759
_Action = Callable[..., Optional[Tuple[int, ...]]]


class Hung(Exception):
    """The board waits forever, because a sensor does not answer."""


class Request(NamedTuple):
    """A request: code, number of arguments, action (returns the reply's fields), duration [s], code of the reply."""

    code: int
    arguments: int
    action: _Action
    duration_s: float
    reply: int


class Board2013(Engine):
    """A board with the firmware of August 2013 (its stream repeats reply 8), or of January 2013 (reply 6).

    One pass of its loop reads one byte and, while a stream runs, sends one whole frame.
    """

    def __init__(self, plant: Plant, january: bool = False, robot_id: Optional[int] = None) -> None:
        self.plant = plant
        self.january = january
        first_id = plant.model.ids[0] if robot_id is None else robot_id
        self.eeprom = bytearray(parameter_store.image(parameter_store.defaults(first_id)))
        self.now_s = self._busy_s = 0.0
        self._host_baud = float(BAUD)
        self._line: List[Tuple[float, int]] = []
        self._line_s = 0.0
        self._input = Ring(INPUT_BYTES)
        rows = [*self._commands(), *self._readings(), *self._environment()]
        self._requests = {row.code: row for row in rows if not january or row.code in JANUARY_CODES}
        self._start()

    # ---- the Engine interface

    def receive(self, data: bytes) -> None:
        data, start = through_line(data, self._host_baud, BAUD), max(self.now_s, self._line_s)
        self._line += [(start + (i + 1) * IN_BYTE_S, byte) for i, byte in enumerate(data)]
        self._line_s = start + len(data) * IN_BYTE_S

    def advance(self, to_s: float) -> bytes:
        while True:
            pass_s = self._next_pass_s()
            if pass_s > to_s:
                break
            self.now_s = max(self.now_s, pass_s)
            if self._set_up_s <= self.now_s:
                self._set_up()
            else:
                self._loop()
        self.now_s = max(self.now_s, to_s)
        self._receive_until(self.now_s)
        self.plant.advance(self.now_s)
        return through_line(self._out.take(self.now_s), self._host_baud, BAUD)

    def set_host_baud(self, baud: float) -> None:
        """Set the host's baud rate; if it is not 115200, bytes arrive corrupted."""
        self._host_baud = baud

    @property
    def next_event_s(self) -> float:
        return min(self._out.next_s, self._next_pass_s())

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The loop stood still until `to_s`; the bytes that fit into the input buffer are handled afterwards."""
        self.plant.advance(to_s)
        self.now_s = to_s
        self._busy_s = max(to_s, self._busy_s)
        self._receive_until(to_s)
        self._input.put(waiting)

    def reset(self) -> None:
        """Pull the reset line; the motors keep turning until the set-up stops them."""
        self._start()

    def has_motors(self) -> bool:
        """Whether the board's id has a motor board, and the motor board answers."""
        return self.motors_there and self.plant.motor_board.present

    # ---- the loop

    def _start(self) -> None:
        for pin in (SONAR_TRIGGER, SONAR_POWER):
            self.plant.pin_changed(pin, 0, self.now_s)
        self._set_up_s = self.now_s + STOP_S
        self._busy_s = self.now_s + (JANUARY_S if self.january else AUGUST_S)
        self._line.clear()
        self._line_s = self.now_s
        self._input = Ring(INPUT_BYTES)
        self._out = Outgoing()
        self._out.free_s = self.now_s
        self._frame: Optional[bytes] = None
        self.debug = 0
        self.streams: Set[int] = set()

    def _set_up(self) -> None:
        self._set_up_s = math.inf
        (number,) = struct.unpack_from("<f", self.eeprom, parameter_store.ID_AT)
        self.robot_id = int(number)
        self.motors_there = self.robot_id < NO_MOTORS_FROM_ID
        self.plant.pin_changed(SONAR_POWER, 1, self.now_s)
        if self.has_motors():
            config, motor, now = Config(self.eeprom), self.plant.motor_board, self.now_s
            motor.fed = True
            motor.stop(now)
            motor.set_timeout(now, 0)
            for encoder in (1, 3):
                motor.preset_encoder(now, encoder, 0)
            for encoder in (1, 3):
                motor.set_prescaler(now, encoder, 0)
            motor.set_gains(now, config["kp"], config["ki"], config["kd"])
            motor.set_ramp(now, config["ramp_time"], config["ramp_gain"])
            motor.set_geometry(now, BoardGeometry(*(config[name] for name in BoardGeometry._fields)))

    def _next_pass_s(self) -> float:
        """Time of the next pass that has something to do [s]."""
        due = self._line[0][0] if self._line else math.inf
        if self.streams or self._input:
            due = self._busy_s
        return min(self._set_up_s, max(due, self._busy_s))

    def _loop(self) -> None:
        self._receive_until(self.now_s)
        self._busy_s = self.now_s + PASS_S
        byte = self._input.take()
        acted = byte is not None and self._parse(byte)
        if self.streams and not acted:
            self._run(self._requests[next(code for code in STREAMS if code in self.streams)])
        self._busy_s = max(self._busy_s, self._out.free_s - OUTPUT_BYTES * OUT_BYTE_S)

    def _receive_until(self, to_s: float) -> None:
        """Moves the bytes that have arrived into the input buffer."""
        arrived = 0
        while arrived < len(self._line) and self._line[arrived][0] <= to_s:
            arrived += 1
        self._input.put(bytes(byte for _, byte in self._line[:arrived]))
        del self._line[:arrived]

    # ---- the parser and its faults

    def _parse(self, byte: int) -> bool:
        """Parses one byte; returns whether it completed a request that was carried out.

        A '@' inside a frame discards that frame and the new one.
        """
        if byte == ord("@"):
            if self._frame is not None:
                self._note(b"[ERROR] Got start byte in the middle of a message!")
            self._frame = b"" if self._frame is None else None
        elif self._frame is not None:
            frame, self._frame = self._frame, None
            if len(frame) >= (FRAME_BYTES - 2 if byte == ord("e") else FRAME_BYTES - 1):
                self._note(b"[ERROR] Buffer size exceeded!")
            elif byte == ord("e"):
                return self._execute(frame)
            else:
                self._frame = frame + bytes([byte])
        return False

    def _execute(self, frame: bytes) -> bool:
        values = [_number(token) for token in frame.split(b",")]
        row = self._requests.get(values[0])
        self._note(b"[INFO] Got message: @" + frame + b"e")
        if values[0] == MISSING:
            self._note(b"[ERROR] Could not find an action in the message!")
        if row is None:
            self._note(b"[ERROR] Unknown action: %d" % values[0])
            return False
        args = (values[1:] + [MISSING] * row.arguments)[: row.arguments]
        if MISSING in args:
            self._note(b"[ERROR] Insufficient number of parameters for this action!")
            return False
        self._run(row, *args)
        return True

    def _run(self, row: Request, *args: int) -> None:
        """Carries out a request; its reply is sent when its duration is over."""
        ready_s = self.now_s + row.duration_s
        try:
            fields = row.action(*args)
        except Hung:
            self._busy_s = math.inf
            return
        self._busy_s = ready_s
        if fields is not None:
            answer = b"@" + b",".join(b"%d" % value for value in (row.reply, *fields)) + b"e\r\n"
            self._out.put(answer, ready_s)
            self._busy_s += len(answer) * PRINT_S

    def _note(self, text: bytes) -> None:
        if self.debug:
            self.say(text)

    def say(self, text: bytes) -> None:
        """Sends a line of text."""
        self._out.put(text + b"\r\n", self.now_s)

    # ---- the requests

    def _commands(self) -> Iterator[Request]:
        motor, order = self.plant.motor_board, self._order
        yield order(1, 0, lambda now: motor.calibrate(now, (1, 0, 0)), CALIBRATION_S)
        yield order(2, 3, motor.set_gains)
        yield order(3, 2, motor.set_prescaler)
        yield order(4, 2, motor.preset_encoder)
        yield order(9, 2, lambda now, left, right: motor.move_percent(now, (left, 0, right), True))
        yield order(10, 2, lambda now, left, right: motor.move_percent(now, (left, 0, right), False))
        yield order(
            11, 2, lambda now, *both: motor.move_differential(now, *map(through_single_precision, both))
        )
        yield order(12, 3, partial(motor.move_to_position, hold=True), POSITION_S)
        yield order(13, 0, motor.stop)
        yield order(14, 0, lambda now: None)  # sent to I2C address 0, where no device is

    def _order(self, code: int, count: int, method: Callable[..., None], pause_s: float = 0.0) -> Request:
        """A request that the motor board carries out, if there is one."""

        def drive(*args: int) -> None:
            if self.has_motors():
                method(self.now_s, *args)

        return Request(code, count, drive, COMMAND_S + pause_s, code)

    def _readings(self) -> Iterator[Request]:
        sonars_s = JANUARY_SONARS_S if self.january else SONARS_S
        yield Request(5, 0, self._info, INFO_S, 5)
        yield Request(6, 0, self._encoders, ENCODERS_S, 6)
        yield Request(7, 0, self._sonars, sonars_s, 7)
        yield Request(8, 0, self._both, ENCODERS_S + sonars_s, 8)
        stream = (self._encoders, ENCODERS_S, 6) if self.january else (self._both, ENCODERS_S + sonars_s, 8)
        yield from self._stream(18, *stream)
        yield Request(15, 0, self._report_debug, PRINTED_S, 15)
        yield Request(16, 1, self._set_debug, PRINTED_S, 16)
        yield Request(17, 0, lambda: (int(18 in self.streams),), PRINTED_S, 17)

    def _environment(self) -> Iterator[Request]:
        yield Request(20, 0, lambda: (self._alcohol(),), ANALOG_S, 20)
        yield Request(21, 0, lambda: (self._dust(),), PRINTED_S, 21)
        yield Request(22, 0, self._pixels, THERMOPILE_S, 22)
        sensors_s = THERMOPILE_S + ENCODERS_S + ANALOG_S
        yield from self._stream(23, self._sensors, sensors_s, 23)
        yield from self._stream(25, lambda: (*self._sensors(), self._adc(2)), sensors_s + ANALOG_S, 25)
        yield from self._stream(27, self._bearing, COMPASS_S, 27)

    def _stream(self, start: int, action: _Action, duration_s: float, reply: int) -> Iterator[Request]:
        """The request that starts a stream, which the stream repeats, and the next one, which ends it."""

        def begin() -> Optional[Tuple[int, ...]]:
            self.streams.add(start)
            return action()

        yield Request(start, 0, begin, duration_s, reply)
        yield Request(start + 1, 0, lambda: self.streams.discard(start), 0.0, start + 1)

    def _report_debug(self) -> Tuple[int, ...]:
        self.say(b"[INFO] Debug mode is " + (b"ON!" if self.debug else b"OFF..."))
        return (self.debug,)

    def _set_debug(self, level: int) -> None:
        self.debug = level & 0xFF
        self._report_debug()

    def _info(self) -> Tuple[int, ...]:
        motor, now = self.plant.motor_board, self.now_s
        if not self.has_motors():
            return 0, _NO_VERSION, 0, VERSION, self.robot_id
        tenths = round(motor.temperature_c(now) * 10.0), round(motor.battery_v(now) * 10.0)
        return tenths[0] * 10, 172, tenths[1] * 10, VERSION, self.robot_id

    def _encoders(self) -> Tuple[int, ...]:
        """Right and left count; a failed read gives 0."""
        if not self.has_motors():
            return 0, 0
        motor = self.plant.motor_board
        return motor.encoder(3, self.now_s), motor.encoder(1, self.now_s)

    def _sonars(self) -> Tuple[int, ...]:
        """Ranges [cm].  A reading raises the trigger; August never lowers it, so its sonars never pause."""
        self.plant.pin_changed(SONAR_TRIGGER, 1, self.now_s)
        if self.january:
            self.plant.pin_changed(SONAR_TRIGGER, 0, self.now_s)
        return tuple(int(_SONAR_A * self._adc(i) ** _SONAR_B + _SONAR_C) for i in range(3))

    def _both(self) -> Tuple[int, ...]:
        return self._encoders() + self._sonars()

    def _sensors(self) -> Tuple[int, ...]:
        hottest = max(self._pixels())
        counts = self._encoders() if self.motors_there else _NO_COUNTS
        return counts + (self._alcohol(), self._dust(), hottest)

    def _alcohol(self) -> int:
        return 1023 - self._adc(0)

    def _dust(self) -> int:
        """Particles per litre; the firmware prints its unsigned number as a signed one."""
        return to_int16(round(self.plant.sensed(self.now_s).dust_pcs_l))

    def _pixels(self) -> Tuple[int, ...]:
        """The ambient temperature and the first seven pixels: the real board starts one register too early."""
        return tuple(self._registers(THERMOPILE_ADDRESS, 1, 8))

    def _bearing(self) -> Tuple[int, ...]:
        return (int.from_bytes(self._registers(COMPASS_ADDRESS, 2, 2), "big") // 10,)

    def _registers(self, address: int, first: int, count: int) -> bytes:
        """Registers of a sensor; raises `Hung` if the sensor does not answer."""
        slave = self.plant.i2c[address]
        if not slave.write(bytes([first]), self.now_s):
            raise Hung
        return bytes(slave.read(count, self.now_s))

    def _adc(self, channel: int) -> int:
        return min(1023, int(self.plant.adc_volts(channel, self.now_s) / VOLTS_PER_COUNT))


def _number(token: bytes) -> int:
    """A number as C's atoi reads it (spaces, a sign, digits up to the first other byte, else 0), cut to 16 bits.

    An empty token is `MISSING`.  So is one of more than 7 characters; on the real board it overruns a buffer, and the
    board hangs or restarts.
    """
    if not token or len(token) > DIGITS:
        return MISSING
    found = re.match(rb"[ \t-\r]*([+-]?[0-9]+)", token)
    return to_int16(int(found.group(1))) if found else 0


def through_single_precision(wire: int) -> int:
    """A speed as the motor board gets it: converted to SI units in single precision and back, then truncated.

    The board treats the 16 bits as an unsigned number, so that a negative speed is converted as the value plus 65536.
    """

    def single(value: float) -> float:
        return float(struct.unpack("f", struct.pack("f", value))[0])

    sent = int(single(single((wire & 0xFFFF) / 1000.0) * 1000.0))
    return to_int16(sent)
