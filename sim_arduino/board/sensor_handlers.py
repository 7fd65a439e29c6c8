"""Requests that read encoders, sonars and environment sensors, once or as a stream."""

import math
from typing import Callable, Dict, Optional, Tuple

from mrl_driver.protocol.table import (
    BY_NAME,
    COMMANDS,
    SENSOR_BY_NAME,
    SENSORS,
    SONAR_INVALID,
    Command,
    Field,
    Sensor,
)

from .python_board import PythonBoard
from .registry import REPLIES, REQUESTS, Values
from .sonar_chain import SONARS


def _wheels(board: PythonBoard) -> Optional[Tuple[int, int]]:
    """Counters of the right and the left wheel; None if they cannot be read."""
    counts = board.motors.counts(board.now_s)
    return None if counts is None else (counts.right, counts.left)


def _sonars(board: PythonBoard, _: int = 0) -> Tuple[int, ...]:
    return tuple(board.sonars.values(board.now_s)) if board.sonars else (SONAR_INVALID,) * SONARS


def _encoders_and_sonars(board: PythonBoard, _: int) -> Values:
    encoders = _wheels(board)
    return None if encoders is None else encoders + _sonars(board)


def _omni(board: PythonBoard, _: int) -> Values:
    counts = board.motors.counts(board.now_s)
    return None if counts is None else (*counts, *_sonars(board))


# ---- environment sensors


def _values(board: PythonBoard, sensor: Sensor) -> Values:
    """The values of a sensor; None if it does not answer on the bus."""
    where = sensor.i2c
    if where is None:
        return (PINS[sensor.name](board),)
    data = read_registers(board, sensor, where.width * len(sensor.fields))
    if data is None:
        return None
    parts = (data[i * where.width :][: where.width] for i in range(len(sensor.fields)))
    return tuple(_wire(field, part, where.per_unit) for field, part in zip(sensor.fields, parts))


def _wire(field: Field, data: bytes, per_unit: float) -> int:
    count = int.from_bytes(data, "big", signed=field.low < 0)
    return max(field.low, min(field.high, math.floor(count / (per_unit * field.scale) + 1e-9)))


def read_registers(board: PythonBoard, sensor: Sensor, count: int) -> Optional[bytes]:
    """Registers of an I2C sensor, or None if it does not answer.

    A missing sensor is a fault only if the build always has it.
    """
    assert sensor.i2c is not None
    slave = board.plant.i2c[sensor.i2c.address]
    there = slave.write(bytes([sensor.i2c.register]), board.now_s)
    if sensor.capability or there:
        board.health.set_fault("sensor", not there)
    return slave.read(count, board.now_s) if there else None


PINS: Dict[str, Callable[[PythonBoard], int]] = {
    "alcohol": lambda board: 1023 - board.adc(0),
    "light": lambda board: board.adc(2),
    "dust": lambda board: min(32767, round(board.plant.sensed(board.now_s).dust_pcs_l)),
}
"""Values of the sensors on the Uno's own pins."""


_THERMOPILE, _COMPASS = SENSOR_BY_NAME["thermopile"], SENSOR_BY_NAME["compass"]


# ---- streams


def _stop_stream(board: PythonBoard) -> None:
    """Ends the stream of two wheels or of three."""
    board.stop_stream(BY_NAME["start_stream"].code)
    board.stop_stream(BY_NAME["start_omni_stream"].code)


def _stop_imu_stream(board: PythonBoard) -> None:
    board.imu_stream = None


def _counts_or_none_needed(board: PythonBoard) -> Values:
    """Counts, or the value 999 that boards without motors have sent instead since 2013."""
    if board.config["robot_id"] > 5 and not board.motors.ever_found:
        return 999, 999
    return _wheels(board)


def _sensors(board: PythonBoard, _: int) -> Values:
    encoders, pixels = _counts_or_none_needed(board), _values(board, _THERMOPILE)
    if encoders is None or pixels is None:
        return None
    return encoders + (PINS["alcohol"](board), PINS["dust"](board), max(pixels))


def _sensors_and_light(board: PythonBoard, _: int) -> Values:
    sensors = _sensors(board, 0)
    return None if sensors is None else sensors + (PINS["light"](board),)


def _register_sensor(sensor: Sensor) -> None:
    REPLIES[sensor.command.name] = lambda board, _: _values(board, sensor)


def _register_stream(row: Command) -> None:
    REQUESTS[row.name] = lambda board, period=0: board.start_stream(row.code, period)
    ending = row.name.replace("start", "stop")
    if ending in BY_NAME:
        REQUESTS[ending] = lambda board: board.stop_stream(row.code)


for _sensor in SENSORS:
    _register_sensor(_sensor)
for _row in COMMANDS:
    if _row.repeats:
        _register_stream(_row)
REQUESTS.update(
    {
        "stop_stream": _stop_stream,
        "start_imu_stream": lambda board, period: board.start_imu_stream(period),
        "stop_imu_stream": _stop_imu_stream,
    }
)
REPLIES.update(
    {
        "read_encoders": lambda board, _: _wheels(board),
        "read_sonars": _sonars,
        "read_encoders_and_sonars": _encoders_and_sonars,
        "start_omni_stream": _omni,
        "start_sensor_stream": _sensors,
        "start_sensor_ldr_stream": _sensors_and_light,
        "start_compass_stream": lambda board, _: _values(board, _COMPASS),
        "read_imu": lambda board, _: board.imu_reading,
    }
)
