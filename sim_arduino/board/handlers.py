"""What a request does on the Python board, and what a reply holds: `REQUESTS` and `REPLIES`, by the row's name."""

import math
import struct
from functools import partial
from typing import Any, Callable, Dict, Optional, Tuple

from mrl_driver.protocol import table
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.chips import ATMEGA2560

from .integers import divide
from .parameter_store import EEPROM_BYTE_S, EEPROM_LOOK_S, Config
from .sonar_chain import SONARS

Board = Any  # a PythonBoard, whose module imports this one

Values = Optional[Tuple[int, ...]]
_CAPABILITY = {name: 1 << bit for bit, (name, _) in enumerate(table.CAPABILITIES)}
_PER_MM_S = 95492
"""6e5 / (2 pi): ceiling [mm/s] * this / (full_speed [1/min] * wheel_radius [0.01 mm]) is the ceiling in %."""
_LIMITED = ("move_differential", "move_twist", "move_omni")  # moves to which the speed ceilings apply


# ---- the board


def _protocol(board: Board, _: int) -> Values:
    return table.PROTOCOL_VERSION, sum(_CAPABILITY[name] for name in board.capabilities)


def _info(board: Board, _: int) -> Values:
    return (*board.motors.info(board.now_s), table.PROTOCOL_VERSION, board.config["robot_id"])


def _status(board: Board, _: int) -> Values:
    uptime = int(board.now_s - board.started_s)
    return (uptime >> 15, uptime & 0x7FFF) + board.health.read() + board.motors.status()


def _counters(board: Board, _: int) -> Values:
    known = table.REASONS if board.radio and board.radio.hold.on else table.REASONS[:-1]
    return tuple(board.health.counters[reason.name] for reason in known)


def _set_debug(board: Board, on: int) -> None:
    board.debug = bool(on)


def _set_check(board: Board, on: int) -> None:
    board.ask_for_checks(bool(on))
    for encoder in (1, 2, 3):  # not that of another host
        board.motors.set_prescaler(board.now_s, encoder, 0)
    board.ask("set_check", on)


def _set_watchdog(board: Board, period: int) -> None:
    board.watchdog_ms = period
    board.health.stops_are_final = period > 0
    board.ask("set_watchdog")


def _set_baud(board: Board, rate: int) -> None:
    """The baud rate changes after the reply has left."""
    board.ask("set_baud", rate)
    board.wanted_baud = rate


def _read_config(board: Board, index: int) -> None:
    if index < len(board.config.values):
        board.ask("read_config", index)
    else:
        board.refuse("argument_range")


def _write_config(board: Board, index: int, value: int) -> None:
    row = table.PARAMETERS[index]
    if index >= len(board.config.values) or not row.low <= value <= row.high:
        board.refuse("argument_range")
        return
    board.config[row.name] = value
    board.health.set_fault("id_unset", board.config["robot_id"] == 0)
    board.motors.refresh(board.now_s, row.name)
    if row.name == "bridge" or index >= len(table.SETTINGS):
        board.connect()
    board.ask("write_config", index)


def _save_config(board: Board) -> None:
    """The reply comes after the last byte is written."""
    changed = board.config.save()
    board.health.set_fault("eeprom", False)
    board.ask("save_config", 1, after_s=EEPROM_LOOK_S + changed * EEPROM_BYTE_S)


def _saved(board: Board, saved: int) -> Values:
    """What has changed meanwhile is saved too."""
    board.config.save()
    return (saved,)


def _default_config(board: Board) -> None:
    board.config.set_defaults()
    board.motors.refresh(board.now_s)
    if board.config.pins:
        board.connect()
    board.ask("default_config", 1)


def _release_emergency(board: Board) -> None:
    board.motors.inputs.release()
    board.ask("release_emergency", int(board.motors.inputs.latched))


def _config(board: Board, index: int) -> Values:
    return index, board.config.values[index]


# ---- motors


def _set_pid_gains(board: Board, kp: int, ki: int, kd: int) -> None:
    """Unchanged gains are not set again, because a motor board would write them to its EEPROM."""
    config = board.config
    if board.require_motors() and (kp, ki, kd) != (config["kp"], config["ki"], config["kd"]):
        config["kp"], config["ki"], config["kd"] = kp, ki, kd
        board.motors.refresh(board.now_s, "kp")


def _set_encoder_prescaler(board: Board, encoder: int, value: int) -> None:
    if board.require_motors() and not board.motors.set_prescaler(board.now_s, encoder, value):
        board.refuse("unavailable")


def _stop(board: Board) -> None:
    board.stop_motors(StopReason.HOST)
    board.health.host_stopped()
    board.require_motors()


def _order_motors(row: table.Command, board: Board, *values: int) -> None:
    if row.name == "move_twist":
        if values[1] and board.plant.model.chip != ATMEGA2560.name:
            board.refuse("unavailable")  # two wheels cannot move sideways, however slowly
            return
        values = _limited_twist(row, board, *values)
    elif row.name in _LIMITED:
        values = _limited(row, board, *values)
    if row.turns and board.refuses_move():
        return
    if not board.motors.carry_out(board.now_s, row, *values):
        board.refuse("unavailable")


def _limited(row: table.Command, board: Board, linear: int, angular: int, *direction: int) -> Tuple[int, ...]:
    """If a speed is beyond its ceiling, both speeds shrink by the same factor, which keeps the curvature."""
    most_linear, most_angular = _ceilings(row, board.config)
    fast, turning = _beyond(linear, most_linear), _beyond(angular, most_angular)
    if not (fast or turning):
        return (linear, angular, *direction)
    board.health.count_clamped()
    by_linear = not turning or (fast and abs(linear) * most_angular > abs(angular) * most_linear)
    top, by = (most_linear, abs(linear)) if by_linear else (most_angular, abs(angular))
    return (divide(linear * top, by), divide(angular * top, by), *direction)


def _limited_twist(
    row: table.Command, board: Board, forward: int, left: int, angular: int
) -> Tuple[int, ...]:
    """The ceiling is that of the speed in its own direction; one that does not fit into a field is lowered to it."""
    speed = math.isqrt(forward * forward + left * left)
    most = min(table.INT16_MAX, speed)
    if most != speed:
        angular = divide(angular * most, speed)
    limited, angular = _limited(row, board, most, angular)
    if limited != speed:
        forward, left = (divide(each * limited, speed) for each in (forward, left))
    return forward, left, angular


def _ceilings(row: table.Command, config: Config) -> Tuple[int, int]:
    """Ceilings of both speeds in the units of the move: those of `move_omni` are percent of full speed."""
    linear, angular = config["linear_ceiling"], config["angular_ceiling"]
    if row.name == "move_omni":
        full = config["full_speed"] * config["wheel_radius"]
        turning = angular * config["axis_radius"] // 355 * 339  # 3 / pi
        linear = table.INT16_MAX if linear == table.INT16_MAX else min(100, linear * _PER_MM_S // full)
        angular = table.INT16_MAX if angular == table.INT16_MAX else min(100, turning // full)
    return linear, angular


def _beyond(value: int, ceiling: int) -> bool:
    """Whether a value is beyond its ceiling; the largest ceiling means no limit, so that -32768 passes unchanged."""
    return ceiling != table.INT16_MAX and abs(value) > ceiling


# ---- servos, encoders and sonars


def _set_servo(board: Board, number: int, pulse_us: int, speed_us_s: int) -> None:
    if board.servos.move(number, pulse_us, speed_us_s, board.now_s):
        board.ask("set_servo", number)
    else:
        board.refuse("unavailable")


def _encoders(board: Board, _: int = 0) -> Values:
    """Counters of the right and the left wheel; None if they cannot be read."""
    counts = board.motors.counts(board.now_s)
    return None if counts is None else (counts.right, counts.left)


def _wheels(board: Board, _: int) -> Values:
    """The counters, the inputs, and the ranges."""
    active, *_ = board.motors.inputs.report()
    return (*board.motors.wheel_counts(board.now_s), active, *board.ranges.values)


def _sonars(board: Board, _: int = 0) -> Tuple[int, ...]:
    return tuple(board.sonars.values(board.now_s)) if board.sonars else (table.SONAR_INVALID,) * SONARS


def _with_sonars(counts: Values, board: Board) -> Values:
    return None if counts is None else (*counts, *_sonars(board))


# ---- environment sensors


def _values(sensor: table.Sensor, board: Board, _: int = 0) -> Values:
    """The values of a sensor; None if it does not answer on the bus."""
    where = sensor.i2c
    if where is None:
        return (PINS[sensor.name](board),)
    data = _registers(board, sensor, where.width * len(sensor.fields))
    if data is None:
        return None
    parts = (data[i * where.width :][: where.width] for i in range(len(sensor.fields)))
    return tuple(_wire(field, part, where.per_unit) for field, part in zip(sensor.fields, parts))


def _wire(field: table.Field, data: bytes, per_unit: float) -> int:
    count = int.from_bytes(data, "big", signed=field.low < 0)
    return max(field.low, min(field.high, math.floor(count / (per_unit * field.scale) + 1e-9)))


def _registers(board: Board, sensor: table.Sensor, count: int) -> Optional[bytes]:
    """Registers of an I2C sensor, or None without an answer, which is a fault if the build always has the sensor."""
    assert sensor.i2c is not None
    slave = board.plant.i2c[sensor.i2c.address]
    there = slave.write(bytes([sensor.i2c.register]), board.now_s)
    if sensor.capability or there:
        board.health.set_fault("sensor", not there)
    return slave.read(count, board.now_s) if there else None


PINS: Dict[str, Callable[[Any], int]] = {
    "alcohol": lambda board: 1023 - board.adc(0),
    "light": lambda board: board.adc(2),
    "dust": lambda board: min(32767, round(board.plant.sensed(board.now_s).dust_pcs_l)),
}
"""Values of the sensors on the Uno's own pins."""


def _counts_or_none_needed(board: Board) -> Values:
    """Counts, or the value 999 that boards without motors have sent instead since 2013."""
    if board.config["robot_id"] > 5 and not board.motors.ever_found:
        return 999, 999
    return _encoders(board)


def _sensors(board: Board, _: int) -> Values:
    encoders, pixels = _counts_or_none_needed(board), _values(table.SENSOR_BY_NAME["thermopile"], board)
    if encoders is None or pixels is None:
        return None
    return encoders + (PINS["alcohol"](board), PINS["dust"](board), max(pixels))


def _sensors_and_light(board: Board, _: int) -> Values:
    sensors = _sensors(board, 0)
    return None if sensors is None else sensors + (PINS["light"](board),)


# ---- streams


def _start_stream(row: table.Command, board: Board, period: int = 0) -> None:
    board.start_stream(row.code, period)


def _stop_streams(starts: Tuple[str, ...], board: Board) -> None:
    for start in starts:
        board.stop_stream(table.BY_NAME[start].code)


def _stop_imu_stream(board: Board) -> None:
    board.imu_stream = None


# ---- radio


def _send_xbee(board: Board, *values: int) -> None:
    address, length = int.from_bytes(struct.pack(">4h", *values[:4]), "big"), values[4]
    text = struct.pack(f">{len(values) - 5}h", *values[5:])
    if len(text) != length + length % 2:
        board.refuse("argument_count")
    elif not board.radio or not board.radio.send(address, text[:length], board.now_s):
        board.refuse("unavailable")


def _discover_xbee(board: Board) -> None:
    if not board.radio or not board.radio.discover(board.now_s):
        board.refuse("unavailable")


def _release_hold(board: Board) -> None:
    assert board.radio
    board.ask("release_hold", board.radio.hold.release())


# ---- the tables


def _ask(row: table.Command, board: Board) -> None:
    board.ask(row.name)


def _value(_: Board, value: int) -> Values:
    return (value,)


_SENSOR_STREAMS = ("sensor_stream", "sensor_ldr_stream", "compass_stream")
_ENCODER_SETTINGS = ("preset_encoder", "reset_encoders")
REQUESTS: Dict[str, Callable[..., None]] = {
    **{row.name: partial(_ask, row) for row in table.COMMANDS if row.reply and not row.request},
    **{
        row.name: partial(_order_motors, row)
        for row in table.COMMANDS
        if row.turns or row.name in _ENCODER_SETTINGS
    },
    **{row.name: partial(_start_stream, row) for row in table.COMMANDS if row.repeats},
    **{f"stop_{name}": partial(_stop_streams, (f"start_{name}",)) for name in _SENSOR_STREAMS},
    "stop_wheel_stream": partial(_stop_streams, ("start_wheel_stream",)),
    "stop_stream": partial(_stop_streams, ("start_stream", "start_omni_stream")),
    "start_imu_stream": lambda board, period: board.start_imu_stream(period),
    "stop_imu_stream": _stop_imu_stream,
    "set_pid_gains": _set_pid_gains,
    "set_encoder_prescaler": _set_encoder_prescaler,
    "stop": _stop,
    "set_servo": _set_servo,
    "set_debug": _set_debug,
    "set_check": _set_check,
    "set_watchdog": _set_watchdog,
    "set_baud": _set_baud,
    "read_config": _read_config,
    "write_config": _write_config,
    "save_config": _save_config,
    "default_config": _default_config,
    "send_xbee": _send_xbee,
    "discover_xbee": _discover_xbee,
    "release_hold": _release_hold,
    "release_emergency": _release_emergency,
}
"""Called with the board and the request's arguments.  A request without arguments only asks for its reply, unless its
entry does more."""
del REQUESTS["xbee_text"]  # only a reply
REPLIES: Dict[str, Callable[[Any, int], Values]] = {
    **{sensor.command.name: partial(_values, sensor) for sensor in table.SENSORS},
    **dict.fromkeys(
        ("set_check", "set_baud", "default_config", "release_hold", "release_emergency"),
        _value,
    ),
    "robot_info": _info,
    "read_encoders": _encoders,
    "read_sonars": _sonars,
    "read_encoders_and_sonars": lambda board, _: _with_sonars(_encoders(board), board),
    "start_omni_stream": lambda board, _: _with_sonars(board.motors.counts(board.now_s), board),
    "start_sensor_stream": _sensors,
    "start_sensor_ldr_stream": _sensors_and_light,
    "start_compass_stream": partial(_values, table.SENSOR_BY_NAME["compass"]),
    "read_imu": lambda board, _: board.imu_reading,
    "get_debug": lambda board, _: (int(board.debug),),
    "get_stream": lambda board, _: (int(board.stream is not None),),
    "read_protocol": _protocol,
    "read_status": _status,
    "read_counters": _counters,
    "set_watchdog": lambda board, _: (board.watchdog_ms,),
    "read_config": _config,
    "write_config": _config,
    "save_config": _saved,
    "xbee_text": lambda board, _: board.radio.text(),
    "discover_xbee": lambda board, _: board.radio.node(),
    "read_radio": lambda board, _: board.radio.hold.report(),
    "set_servo": lambda board, number: (number, board.servos.pulse_us(number, board.now_s)),
    "read_wiring": lambda board, _: board.motors.wiring_problem(),
    "read_board": lambda board, _: board.motors.wired(),
    "read_wheels": _wheels,
    "read_inputs": lambda board, _: board.motors.inputs.report(),
    "read_ranges": lambda board, _: board.ranges.values,
}
"""Called with the board and the value given to `ask`; None if there is nothing to send."""
NEEDS: Dict[str, str] = {row.name: row.capability for row in table.COMMANDS if row.capability}
"""Capability of the board without which a request is unavailable."""
