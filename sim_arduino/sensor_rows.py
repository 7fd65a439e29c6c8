"""Rows of the table that read encoders, sonars and environment sensors, once or as a stream."""

from typing import TYPE_CHECKING, Optional, Tuple

from mrl_driver.table import BY_NAME, SONAR_INVALID

from .rows import Values, asks, reply, request
from .sensors import COMPASS_ADDRESS, THERMOPILE_ADDRESS
from .sonar_task import SONARS

if TYPE_CHECKING:
    from .board import PythonBoard

asks("read_encoders")


@reply("read_encoders")
def _encoders(board: "PythonBoard", _: int) -> Values:
    return board.encoders()


asks("read_sonars", "read_encoders_and_sonars")


def _sensor_row(board: "PythonBoard", name: str, there: bool) -> None:
    if there:
        board.ask(BY_NAME[name].code)
    else:
        board.refuse("unavailable")


def _sonar_values(board: "PythonBoard") -> Tuple[int, ...]:
    return tuple(board.sonars.values(board.now_s)) if board.sonars else (SONAR_INVALID,) * SONARS


@reply("read_sonars")
def _sonars(board: "PythonBoard", _: int) -> Values:
    return _sonar_values(board)


@reply("read_encoders_and_sonars")
def _encoders_and_sonars(board: "PythonBoard", _: int) -> Values:
    encoders = board.encoders()
    return None if encoders is None else encoders + _sonar_values(board)


@request
def start_stream(board: "PythonBoard", period: int = 0) -> None:
    """18."""
    board.start_stream(BY_NAME["start_stream"].code, period)


@request
def stop_stream(board: "PythonBoard") -> None:
    """19."""
    board.stop_stream(BY_NAME["start_stream"].code)


def _start(board: "PythonBoard", name: str, period: int, there: bool) -> None:
    if there:
        board.start_stream(BY_NAME[name].code, period)
    else:
        board.refuse("unavailable")


# ---- environment sensors


@request
def read_alcohol(board: "PythonBoard") -> None:
    """20."""
    _sensor_row(board, "read_alcohol", board.environment)


@request
def read_dust(board: "PythonBoard") -> None:
    """21."""
    _sensor_row(board, "read_dust", board.environment)


@request
def read_thermopile(board: "PythonBoard") -> None:
    """22."""
    _sensor_row(board, "read_thermopile", board.environment)


@request
def start_sensor_stream(board: "PythonBoard", period: int = 0) -> None:
    """23."""
    _start(board, "start_sensor_stream", period, board.environment)


@request
def stop_sensor_stream(board: "PythonBoard") -> None:
    """24."""
    board.stop_stream(BY_NAME["start_sensor_stream"].code)


@request
def start_sensor_ldr_stream(board: "PythonBoard", period: int = 0) -> None:
    """25."""
    _start(board, "start_sensor_ldr_stream", period, board.environment)


@request
def stop_sensor_ldr_stream(board: "PythonBoard") -> None:
    """26."""
    board.stop_stream(BY_NAME["start_sensor_ldr_stream"].code)


@request
def start_compass_stream(board: "PythonBoard", period: int = 0) -> None:
    """27."""
    _start(board, "start_compass_stream", period, board.environment)


@request
def stop_compass_stream(board: "PythonBoard") -> None:
    """28."""
    board.stop_stream(BY_NAME["start_compass_stream"].code)


def read_registers(board: "PythonBoard", address: int, first: int, count: int) -> Optional[bytes]:
    """Registers of an I2C sensor, or None if it does not answer."""
    slave = board.plant.i2c[address]
    there = slave.write(bytes([first]), board.now_s)
    board.health.set_fault("sensor", not there)
    return slave.read(count, board.now_s) if there else None


def _dust_value(board: "PythonBoard") -> int:
    return min(32767, round(board.plant.sensed(board.now_s).dust_pcs_l))


@reply("read_alcohol")
def _alcohol(board: "PythonBoard", _: int) -> Values:
    return (1023 - board.adc(0),)


@reply("read_dust")
def _dust(board: "PythonBoard", _: int) -> Values:
    return (_dust_value(board),)


@reply("read_thermopile")
def _thermopile(board: "PythonBoard", _: int) -> Values:
    pixels = read_registers(board, THERMOPILE_ADDRESS, 2, 8)
    return None if pixels is None else tuple(pixels)


def _counts_or_none_needed(board: "PythonBoard") -> Values:
    """Counts, or what sensor boards without motors have sent since 2013 in their place."""
    if board.config["robot_id"] > 5 and not board.motors_ever_found:
        return 999, 999
    return board.encoders()


@reply("start_sensor_stream")
def _sensors(board: "PythonBoard", _: int) -> Values:
    encoders, pixels = _counts_or_none_needed(board), read_registers(board, THERMOPILE_ADDRESS, 2, 8)
    if encoders is None or pixels is None:
        return None
    return encoders + (1023 - board.adc(0), _dust_value(board), max(pixels))


@reply("start_sensor_ldr_stream")
def _sensors_and_light(board: "PythonBoard", value: int) -> Values:
    sensors = _sensors(board, value)
    return None if sensors is None else sensors + (board.adc(2),)


@reply("start_compass_stream")
def _compass(board: "PythonBoard", _: int) -> Values:
    bearing = read_registers(board, COMPASS_ADDRESS, 2, 2)
    return None if bearing is None else (int.from_bytes(bearing, "big") // 10 % 360,)
