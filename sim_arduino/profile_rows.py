"""What the requests of 2013 did on the boards of 2013: each row's arguments, action and time; the streams."""

import struct
from typing import TYPE_CHECKING, Callable, Dict, NamedTuple, Optional, Tuple

from .sensors import COMPASS_ADDRESS, THERMOPILE_ADDRESS
from .sonars import VOLTS_PER_COUNT

if TYPE_CHECKING:
    from .profiles import Board2013

VERSION = 1
COMMAND_S = 0.7e-3
ENCODERS_S, ENCODERS_AND_SONARS_S, INFO_S = 1.17e-3, 2.58e-3, 4.49e-3
"""Time from a request to the first byte of its reply [s]."""
NO_MOTORS_FROM_ID = 6
_NO_COUNTS = (999, 999)
_SONAR_A, _SONAR_B, _SONAR_C = 1.767, 0.94657, -0.3759


class Row(NamedTuple):
    """A request: how many arguments it needs, what it does and maybe answers, and how long that takes [s]."""

    arguments: int
    action: Callable[..., Optional[Tuple[int, ...]]]
    duration_s: float


class Stream(NamedTuple):
    """A stream: the code of its frames, what they tell, and how long a frame takes to make [s]."""

    code: int
    action: Callable[..., Optional[Tuple[int, ...]]]
    duration_s: float


class Rows:
    """The requests of one board, by number, and its streams, by the request that starts them."""

    def __init__(self, board: "Board2013") -> None:
        self._board, self._plant = board, board.plant
        self.requests = self._make_rows()
        self.streams = self._make_streams()

    def _make_rows(self) -> Dict[int, Row]:
        motor = self._plant.motor_board
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
                    motor.move_differential,
                    through_single_precision(linear),
                    through_single_precision(angular),
                ),
            ),
            12: (3, lambda *args: self._drive(motor.move_to_position, *args, True)),
            13: (0, lambda: self._drive(motor.stop)),
            14: (0, self._reset_encoders),
            15: (0, lambda: (int(self._board.debug),)),
            16: (1, self._set_debug),
            17: (0, lambda: (int(self._board.stream != 0),)),
            20: (0, lambda: (1023 - self._adc(0),)),
            21: (0, lambda: (round(self._plant.sensed(self._board.now_s).dust_pcs_l),)),
            22: (0, self._pixels),
        }
        for start, end in ((18, 19), (23, 24), (25, 26), (27, 28)):
            quick[start] = (0, lambda code=start: self._set_stream(code))
            quick[end] = (0, lambda: self._set_stream(0))
        rows = {code: Row(count, action, COMMAND_S) for code, (count, action) in quick.items()}
        rows[5] = Row(0, self._info, INFO_S)
        rows[6] = Row(0, self._encoders, ENCODERS_S)
        rows[7] = Row(0, self._sonars, ENCODERS_AND_SONARS_S - ENCODERS_S)
        rows[8] = Row(0, lambda: self._encoders() + self._sonars(), ENCODERS_AND_SONARS_S)
        return rows

    def _make_streams(self) -> Dict[int, Stream]:
        """By the command that starts them."""
        main = 6 if self._board.january else 8
        return {
            18: Stream(main, self.requests[main].action, self.requests[main].duration_s),
            23: Stream(23, self._sensors, ENCODERS_AND_SONARS_S),
            25: Stream(25, lambda: self._sensors() + (self._adc(2),), ENCODERS_AND_SONARS_S),
            27: Stream(27, self._bearing, ENCODERS_S),
        }

    def _drive(self, method: Callable[..., None], *args: object) -> None:
        if self._board.has_motors():
            method(self._board.now_s, *args)

    def _reset_encoders(self) -> None:
        for encoder in (1, 2, 3):
            self._drive(self._plant.motor_board.preset_encoder, encoder, 0)

    def _set_debug(self, on: int) -> None:
        self._board.debug = on != 0

    def _set_stream(self, code: int) -> None:
        self._board.stream = code

    def _info(self) -> Tuple[int, ...]:
        motor, now = self._plant.motor_board, self._board.now_s
        if not self._board.has_motors():
            return 0, 0, 0, VERSION, self._board.robot_id
        tenths = round(motor.temperature_c(now) * 10.0), round(motor.battery_v(now) * 10.0)
        return tenths[0] * 10, 172, tenths[1] * 10, VERSION, self._board.robot_id

    def _encoders(self) -> Tuple[int, ...]:
        """A read that failed reads 0."""
        if not self._board.has_motors():
            return 0, 0
        motor = self._plant.motor_board
        return motor.encoder(3, self._board.now_s), motor.encoder(1, self._board.now_s)

    def _sonars(self) -> Tuple[int, ...]:
        return tuple(int(_SONAR_A * self._adc(i) ** _SONAR_B + _SONAR_C) for i in range(3))

    def _sensors(self) -> Tuple[int, ...]:
        counts = self._encoders() if self._board.motors_there else _NO_COUNTS
        return counts + (
            1023 - self._adc(0),
            round(self._plant.sensed(self._board.now_s).dust_pcs_l),
            max(self._pixels()),
        )

    def _pixels(self) -> Tuple[int, ...]:
        return tuple(self._registers(THERMOPILE_ADDRESS, 2, 8))

    def _bearing(self) -> Tuple[int, ...]:
        return (int.from_bytes(self._registers(COMPASS_ADDRESS, 2, 2), "big") // 10,)

    def _registers(self, address: int, first: int, count: int) -> bytes:
        slave = self._plant.i2c[address]
        return (
            slave.read(count, self._board.now_s)
            if slave.write(bytes([first]), self._board.now_s)
            else bytes(count)
        )

    def _adc(self, channel: int) -> int:
        return min(1023, int(self._plant.adc_volts(channel, self._board.now_s) / VOLTS_PER_COUNT))


def through_single_precision(wire: int) -> int:
    """A speed as it reaches the motor board: to SI in single precision and back, cut off."""

    def single(value: float) -> float:
        return float(struct.unpack("f", struct.pack("f", value))[0])

    return int(single(single(wire / 1000.0) * 1000.0))
