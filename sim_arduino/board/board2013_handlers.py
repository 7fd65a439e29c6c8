"""The requests of the 2013 boards: arguments, action and duration of each, and the streams."""

import struct
from functools import partial
from typing import TYPE_CHECKING, Callable, Iterator, NamedTuple, Optional, Tuple

from sim_arduino.hardware.environment_sensors import COMPASS_ADDRESS, THERMOPILE_ADDRESS
from sim_arduino.hardware.sonars import VOLTS_PER_COUNT
from sim_arduino.hardware.wiring import SONAR_TRIGGER

if TYPE_CHECKING:
    from .board2013 import Board2013

VERSION = 1
COMMAND_S, PRINTED_S = 0.7e-3, 0.07e-3
"""Time to pass a command on to the motor board, and to reply without a sensor reading [s]."""
ENCODERS_S, SONARS_S, INFO_S, THERMOPILE_S, ANALOG_S, COMPASS_S = (
    1.17e-3,
    1.41e-3,
    4.6e-3,
    4.3e-3,
    0.11e-3,
    0.79e-3,
)
"""Time that each reading takes [s]."""
JANUARY_SONARS_S = 59.2e-3
CALIBRATION_S, POSITION_S = 95e-3, 1e-3
"""Pauses after these commands [s]."""
NO_MOTORS_FROM_ID = 6
JANUARY_CODES = range(1, 20)
_NO_COUNTS = (999, 999)
_NO_VERSION = 25755
"""Version reported if the motor board does not answer: both of its bytes are read as 255."""
_SONAR_A, _SONAR_B, _SONAR_C = 1.767, 0.9465, -0.3759
_Action = Callable[..., Optional[Tuple[int, ...]]]


class Hung(Exception):
    """The board waits forever, because a sensor does not answer."""


class Row(NamedTuple):
    """A request: code, number of arguments, action (returns the reply's fields), duration [s], code of the reply."""

    code: int
    arguments: int
    action: _Action
    duration_s: float
    reply: int


class Rows:
    """The requests of one board.

    Attributes:
        requests: All requests by number.
        streams: The requests that repeat; the earlier ones have priority.
    """

    def __init__(self, board: "Board2013") -> None:
        self._board, self._plant = board, board.plant
        rows = [*self._commands(), *self._readings(), *self._settings(), *self._environment()]
        self.requests = {row.code: row for row in rows if not board.january or row.code in JANUARY_CODES}
        self.streams = [self.requests[code] for code in (18, 23, 27, 25) if code in self.requests]

    def _commands(self) -> Iterator[Row]:
        motor = self._plant.motor_board
        table: Tuple[Tuple[int, int, Callable[..., None], float], ...] = (
            (1, 0, lambda now: motor.calibrate(now, (1, 0, 0)), CALIBRATION_S),
            (2, 3, motor.set_gains, 0.0),
            (3, 2, motor.set_prescaler, 0.0),
            (4, 2, motor.preset_encoder, 0.0),
            (9, 2, lambda now, left, right: motor.move_percent(now, (left, 0, right), True), 0.0),
            (10, 2, lambda now, left, right: motor.move_percent(now, (left, 0, right), False), 0.0),
            (
                11,
                2,
                lambda now, *speeds: motor.move_differential(now, *map(through_single_precision, speeds)),
                0.0,
            ),
            (12, 3, partial(motor.move_to_position, hold=True), POSITION_S),
            (13, 0, motor.stop, 0.0),
            (14, 0, lambda now: None, 0.0),  # sent to I2C address 0, where no device is
        )
        for code, count, method, pause_s in table:
            yield Row(code, count, partial(self._drive, method), COMMAND_S + pause_s, code)

    def _readings(self) -> Iterator[Row]:
        sonars_s = JANUARY_SONARS_S if self._board.january else SONARS_S
        yield Row(5, 0, self._info, INFO_S, 5)
        yield Row(6, 0, self._encoders, ENCODERS_S, 6)
        yield Row(7, 0, self._sonars, sonars_s, 7)
        yield Row(8, 0, self._both, ENCODERS_S + sonars_s, 8)
        if self._board.january:
            yield from self._stream(18, 19, self._encoders, ENCODERS_S, 6)
        else:
            yield from self._stream(18, 19, self._both, ENCODERS_S + sonars_s, 8)

    def _settings(self) -> Iterator[Row]:
        yield Row(15, 0, self._tell_debug, PRINTED_S, 15)
        yield Row(16, 1, self._set_debug, PRINTED_S, 16)
        yield Row(17, 0, lambda: (int(18 in self._board.streams),), PRINTED_S, 17)

    def _environment(self) -> Iterator[Row]:
        yield Row(20, 0, lambda: (self._alcohol(),), ANALOG_S, 20)
        yield Row(21, 0, lambda: (self._dust(),), PRINTED_S, 21)
        yield Row(22, 0, self._pixels, THERMOPILE_S, 22)
        sensors_s = THERMOPILE_S + ENCODERS_S + ANALOG_S
        yield from self._stream(23, 24, self._sensors, sensors_s, 23)
        yield from self._stream(25, 26, lambda: (*self._sensors(), self._adc(2)), sensors_s + ANALOG_S, 25)
        yield from self._stream(27, 28, self._bearing, COMPASS_S, 27)

    def _stream(self, start: int, end: int, action: _Action, duration_s: float, reply: int) -> Iterator[Row]:
        """The request that starts a stream, which the stream repeats, and the request that ends it."""

        def begin() -> Optional[Tuple[int, ...]]:
            self._board.streams.add(start)
            return action()

        yield Row(start, 0, begin, duration_s, reply)
        yield Row(end, 0, lambda: self._board.streams.discard(start), 0.0, end)

    def _drive(self, method: Callable[..., None], *args: int) -> None:
        if self._board.has_motors():
            method(self._board.now_s, *args)

    def _tell_debug(self) -> Tuple[int, ...]:
        self._board.say(b"[INFO] Debug mode is " + (b"ON!" if self._board.debug else b"OFF..."))
        return (self._board.debug,)

    def _set_debug(self, level: int) -> None:
        self._board.debug = level & 0xFF
        self._tell_debug()

    def _info(self) -> Tuple[int, ...]:
        motor, now = self._plant.motor_board, self._board.now_s
        if not self._board.has_motors():
            return 0, _NO_VERSION, 0, VERSION, self._board.robot_id
        tenths = round(motor.temperature_c(now) * 10.0), round(motor.battery_v(now) * 10.0)
        return tenths[0] * 10, 172, tenths[1] * 10, VERSION, self._board.robot_id

    def _encoders(self) -> Tuple[int, ...]:
        """Right and left count; a failed read gives 0."""
        if not self._board.has_motors():
            return 0, 0
        motor = self._plant.motor_board
        return motor.encoder(3, self._board.now_s), motor.encoder(1, self._board.now_s)

    def _sonars(self) -> Tuple[int, ...]:
        """Ranges [cm].  A reading raises the trigger; August never lowers it, so its sonars never pause."""
        self._plant.pin_changed(SONAR_TRIGGER, 1, self._board.now_s)
        if self._board.january:
            self._plant.pin_changed(SONAR_TRIGGER, 0, self._board.now_s)
        return tuple(int(_SONAR_A * self._adc(i) ** _SONAR_B + _SONAR_C) for i in range(3))

    def _both(self) -> Tuple[int, ...]:
        return self._encoders() + self._sonars()

    def _sensors(self) -> Tuple[int, ...]:
        hottest = max(self._pixels())
        counts = self._encoders() if self._board.motors_there else _NO_COUNTS
        return counts + (self._alcohol(), self._dust(), hottest)

    def _alcohol(self) -> int:
        return 1023 - self._adc(0)

    def _dust(self) -> int:
        return round(self._plant.sensed(self._board.now_s).dust_pcs_l)

    def _pixels(self) -> Tuple[int, ...]:
        """The ambient temperature and the first seven pixels: the real board starts one register too early."""
        return tuple(self._registers(THERMOPILE_ADDRESS, 1, 8))

    def _bearing(self) -> Tuple[int, ...]:
        return (int.from_bytes(self._registers(COMPASS_ADDRESS, 2, 2), "big") // 10,)

    def _registers(self, address: int, first: int, count: int) -> bytes:
        """Registers of a sensor; raises `Hung` if the sensor does not answer."""
        slave = self._plant.i2c[address]
        if not slave.write(bytes([first]), self._board.now_s):
            raise Hung
        return bytes(slave.read(count, self._board.now_s))

    def _adc(self, channel: int) -> int:
        return min(1023, int(self._plant.adc_volts(channel, self._board.now_s) / VOLTS_PER_COUNT))


def through_single_precision(wire: int) -> int:
    """A speed as the motor board gets it: converted to SI units in single precision and back, then truncated.

    The board treats the 16 bits as an unsigned number, so that a negative speed is converted as the value plus 65536.
    """

    def single(value: float) -> float:
        return float(struct.unpack("f", struct.pack("f", value))[0])

    sent = int(single(single((wire & 0xFFFF) / 1000.0) * 1000.0))
    return (sent + 0x8000 & 0xFFFF) - 0x8000
