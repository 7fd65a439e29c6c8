"""What each row of the table does on the Python board: one request handler per row, one reply builder per reply.

Function names are the rows' names; a test fails if a row has none.
"""

from typing import TYPE_CHECKING, Callable, Dict, Optional, Tuple

from mrl_driver.table import (
    BY_NAME,
    CAPABILITIES,
    INT16_MAX,
    PARAMETERS,
    PROTOCOL_VERSION,
    REASONS,
)

from .sensors import COMPASS_ADDRESS, THERMOPILE_ADDRESS

if TYPE_CHECKING:
    from .board import PythonBoard

Values = Optional[Tuple[int, ...]]
REQUESTS: Dict[str, Callable[..., None]] = {}
"""By row name: called with the board and the request's arguments."""
REPLIES: Dict[int, Callable[["PythonBoard", int], Values]] = {}
"""By reply code: called with the board and a reminder; None if there is nothing valid to send."""

_CAPABILITY = {name: 1 << bit for bit, (name, _) in enumerate(CAPABILITIES)}


def _request(handler: Callable[..., None]) -> Callable[..., None]:
    REQUESTS[handler.__name__] = handler
    return handler


def _reply(
    name: str,
) -> Callable[[Callable[["PythonBoard", int], Values]], Callable[["PythonBoard", int], Values]]:
    def register(builder: Callable[["PythonBoard", int], Values]) -> Callable[["PythonBoard", int], Values]:
        REPLIES[BY_NAME[name].code] = builder
        return builder

    return register


def _asks(*names: str) -> None:
    """Rows that do nothing but answer."""
    for name in names:
        code = BY_NAME[name].code
        REQUESTS[name] = lambda board, code=code: board.ask(code)


def _with_motors(board: "PythonBoard") -> bool:
    there = board.motor_there()
    if not there:
        board.refuse("unavailable")
    return there


# ---- motors


@_request
def calibrate(board: "PythonBoard") -> None:
    """1."""
    if _with_motors(board):
        board.motor_board.calibrate(board.now_s)


@_request
def set_pid_gains(board: "PythonBoard", kp: int, ki: int, kd: int) -> None:
    """2."""
    if _with_motors(board):
        board.config["kp"], board.config["ki"], board.config["kd"] = kp, ki, kd
        board.motor_board.set_gains(board.now_s, kp, ki, kd)


@_request
def set_encoder_prescaler(board: "PythonBoard", encoder: int, prescaler: int) -> None:
    """3."""
    if _with_motors(board):
        board.motor_board.set_prescaler(board.now_s, encoder, prescaler)


@_request
def preset_encoder(board: "PythonBoard", encoder: int, count: int) -> None:
    """4."""
    if _with_motors(board):
        board.motor_board.preset_encoder(board.now_s, encoder, count)


@_request
def move_motors_pid(board: "PythonBoard", left: int, right: int) -> None:
    """9."""
    if _with_motors(board):
        board.motor_board.move_percent(board.now_s, (left, 0, right), pid=True)


@_request
def move_motors(board: "PythonBoard", left: int, right: int) -> None:
    """10."""
    if _with_motors(board):
        board.motor_board.move_percent(board.now_s, (left, 0, right), pid=False)


@_request
def move_differential(board: "PythonBoard", linear: int, angular: int) -> None:
    """11: beyond the ceiling both speeds shrink by the same factor, which keeps the curvature."""
    linear_ceiling, angular_ceiling = board.config["linear_ceiling"], board.config["angular_ceiling"]
    fast, turning = _beyond(linear, linear_ceiling), _beyond(angular, angular_ceiling)
    if fast or turning:
        board.clamped = min(INT16_MAX, board.clamped + 1)
        by_linear = not turning or (fast and abs(linear) * angular_ceiling > abs(angular) * linear_ceiling)
        top, by = (linear_ceiling, abs(linear)) if by_linear else (angular_ceiling, abs(angular))
        linear, angular = _scaled(linear, top, by), _scaled(angular, top, by)
    if _with_motors(board):
        board.motor_board.move_differential(board.now_s, linear, angular)


def _beyond(value: int, ceiling: int) -> bool:
    """The widest ceiling is none: -32768 is to arrive as it is."""
    return ceiling != INT16_MAX and abs(value) > ceiling


def _scaled(value: int, top: int, by: int) -> int:
    """`value * top / by`, rounded towards zero."""
    size = abs(value) * top // by
    return size if value >= 0 else -size


@_request
def move_to_position(board: "PythonBoard", motor: int, speed: int, position: int) -> None:
    """12: holds with torque."""
    if _with_motors(board):
        board.motor_board.move_to_position(board.now_s, motor, speed, position, hold=True)


@_request
def stop(board: "PythonBoard") -> None:
    """13."""
    board.stop_motors("host")
    if not board.motor_there():
        board.refuse("unavailable")


@_request
def reset_encoders(board: "PythonBoard") -> None:
    """14."""
    if _with_motors(board):
        for encoder in (1, 2, 3):
            board.motor_board.preset_encoder(board.now_s, encoder, 0)


# ---- who answers, and how it fares

_asks("robot_info", "get_debug", "get_stream", "read_protocol", "read_status", "read_counters")


@_reply("robot_info")
def _robot_info(board: "PythonBoard", _: int) -> Values:
    if not board.motor_there():
        return 0, 0, 0, PROTOCOL_VERSION, board.config["robot_id"]
    motor, now = board.motor_board, board.now_s
    tenths = round(motor.temperature_c(now) * 10.0), round(motor.battery_v(now) * 10.0)
    return tenths[0] * 10, 172, tenths[1] * 10, PROTOCOL_VERSION, board.config["robot_id"]


@_request
def set_debug(board: "PythonBoard", on: int) -> None:
    """16."""
    board.debug = bool(on)


@_reply("get_debug")
def _debug(board: "PythonBoard", _: int) -> Values:
    return (int(board.debug),)


@_reply("get_stream")
def _stream(board: "PythonBoard", _: int) -> Values:
    return (int(board.stream is not None),)


@_reply("read_protocol")
def _protocol(board: "PythonBoard", _: int) -> Values:
    build = "environment" if board.environment else "sonars"
    return PROTOCOL_VERSION, sum(
        _CAPABILITY[name] for name in ("check", "watchdog", "period", "config", build)
    )


@_reply("read_status")
def _status(board: "PythonBoard", _: int) -> Values:
    uptime = int(board.now_s - board.started_s)
    return (
        uptime >> 15,
        uptime & 0x7FFF,
        board.reset_cause,
        board.stop_reason,
        board.take_faults(),
        board.clamped,
    )


@_reply("read_counters")
def _counters(board: "PythonBoard", _: int) -> Values:
    return tuple(board.counters[reason.name] for reason in REASONS)


# ---- encoders and sonars

_asks("read_encoders")


@_reply("read_encoders")
def _encoders(board: "PythonBoard", _: int) -> Values:
    return board.encoders()


_asks("read_sonars", "read_encoders_and_sonars")


def _sensor_row(board: "PythonBoard", name: str, there: bool) -> None:
    if there:
        board.ask(BY_NAME[name].code)
    else:
        board.refuse("unavailable")


@_reply("read_sonars")
def _sonars(board: "PythonBoard", _: int) -> Values:
    return tuple(board.sonar_cm())


@_reply("read_encoders_and_sonars")
def _encoders_and_sonars(board: "PythonBoard", _: int) -> Values:
    encoders = board.encoders()
    return None if encoders is None else encoders + tuple(board.sonar_cm())


@_request
def start_stream(board: "PythonBoard", period: int = 0) -> None:
    """18."""
    board.start_stream(BY_NAME["start_stream"].code, period)


@_request
def stop_stream(board: "PythonBoard") -> None:
    """19."""
    board.stop_stream(BY_NAME["start_stream"].code)


def _start(board: "PythonBoard", name: str, period: int, there: bool) -> None:
    if there:
        board.start_stream(BY_NAME[name].code, period)
    else:
        board.refuse("unavailable")


# ---- environment sensors


@_request
def read_alcohol(board: "PythonBoard") -> None:
    """20."""
    _sensor_row(board, "read_alcohol", board.environment)


@_request
def read_dust(board: "PythonBoard") -> None:
    """21."""
    _sensor_row(board, "read_dust", board.environment)


@_request
def read_thermopile(board: "PythonBoard") -> None:
    """22."""
    _sensor_row(board, "read_thermopile", board.environment)


@_request
def start_sensor_stream(board: "PythonBoard", period: int = 0) -> None:
    """23."""
    _start(board, "start_sensor_stream", period, board.environment)


@_request
def stop_sensor_stream(board: "PythonBoard") -> None:
    """24."""
    board.stop_stream(BY_NAME["start_sensor_stream"].code)


@_request
def start_sensor_ldr_stream(board: "PythonBoard", period: int = 0) -> None:
    """25."""
    _start(board, "start_sensor_ldr_stream", period, board.environment)


@_request
def stop_sensor_ldr_stream(board: "PythonBoard") -> None:
    """26."""
    board.stop_stream(BY_NAME["start_sensor_ldr_stream"].code)


@_request
def start_compass_stream(board: "PythonBoard", period: int = 0) -> None:
    """27."""
    _start(board, "start_compass_stream", period, board.environment)


@_request
def stop_compass_stream(board: "PythonBoard") -> None:
    """28."""
    board.stop_stream(BY_NAME["start_compass_stream"].code)


def read_registers(board: "PythonBoard", address: int, first: int, count: int) -> Optional[bytes]:
    """Registers of an I2C sensor, or None if it does not answer."""
    slave = board.plant.i2c[address]
    there = slave.write(bytes([first]), board.now_s)
    board.set_fault("sensor", not there)
    return slave.read(count, board.now_s) if there else None


def _dust_value(board: "PythonBoard") -> int:
    return min(32767, round(board.plant.environment.dust_pcs_l))


@_reply("read_alcohol")
def _alcohol(board: "PythonBoard", _: int) -> Values:
    return (1023 - board.adc(0),)


@_reply("read_dust")
def _dust(board: "PythonBoard", _: int) -> Values:
    return (_dust_value(board),)


@_reply("read_thermopile")
def _thermopile(board: "PythonBoard", _: int) -> Values:
    pixels = read_registers(board, THERMOPILE_ADDRESS, 2, 8)
    return None if pixels is None else tuple(pixels)


def _counts_or_none_needed(board: "PythonBoard") -> Values:
    """Counts, or what sensor boards without motors have sent since 2013 in their place."""
    if board.config["robot_id"] > 5 and not board.motors_ever_found:
        return 999, 999
    return board.encoders()


@_reply("start_sensor_stream")
def _sensors(board: "PythonBoard", _: int) -> Values:
    encoders, pixels = _counts_or_none_needed(board), read_registers(board, THERMOPILE_ADDRESS, 2, 8)
    if encoders is None or pixels is None:
        return None
    return encoders + (1023 - board.adc(0), _dust_value(board), max(pixels))


@_reply("start_sensor_ldr_stream")
def _sensors_and_light(board: "PythonBoard", value: int) -> Values:
    sensors = _sensors(board, value)
    return None if sensors is None else sensors + (board.adc(2),)


@_reply("start_compass_stream")
def _compass(board: "PythonBoard", _: int) -> Values:
    bearing = read_registers(board, COMPASS_ADDRESS, 2, 2)
    return None if bearing is None else (int.from_bytes(bearing, "big") // 10 % 360,)


# ---- check, watchdog, configuration


@_request
def set_check(board: "PythonBoard", on: int) -> None:
    """32."""
    board.set_check(bool(on))
    board.ask(BY_NAME["set_check"].code, on)


@_request
def set_watchdog(board: "PythonBoard", period: int) -> None:
    """33."""
    board.watchdog_ms = period
    board.ask(BY_NAME["set_watchdog"].code)


@_request
def read_config(board: "PythonBoard", index: int) -> None:
    """34."""
    board.ask(BY_NAME["read_config"].code, index)


@_request
def write_config(board: "PythonBoard", index: int, value: int) -> None:
    """35."""
    row = PARAMETERS[index]
    if not row.low <= value <= row.high:
        board.refuse("argument_range")
        return
    board.config[row.name] = value
    board.set_fault("id_unset", board.config["robot_id"] == 0)
    if board.motor_there():
        board.set_up_motor_board(row.name)
    board.ask(BY_NAME["write_config"].code, index)


@_request
def save_config(board: "PythonBoard") -> None:
    """36: the answer comes when the last byte is written."""
    from .board import EEPROM_BYTE_S

    changed = board.config.save()
    board.set_fault("eeprom", False)
    board.ask(BY_NAME["save_config"].code, 1, after_s=changed * EEPROM_BYTE_S)


@_request
def default_config(board: "PythonBoard") -> None:
    """37."""
    board.config.set_defaults()
    if board.motor_there():
        board.set_up_motor_board()
    board.ask(BY_NAME["default_config"].code, 1)


@_reply("read_config")
def _config(board: "PythonBoard", index: int) -> Values:
    return index, board.config.values[index]


REPLIES[BY_NAME["write_config"].code] = _config


@_reply("set_check")
@_reply("save_config")
@_reply("default_config")
def _value(_: "PythonBoard", value: int) -> Values:
    return (value,)


@_reply("set_watchdog")
def _watchdog(board: "PythonBoard", _: int) -> Values:
    return (board.watchdog_ms,)


# ---- radio: no build of this board has one


@_request
def send_xbee(board: "PythonBoard", *_: int) -> None:
    """38."""
    board.refuse("unavailable")


@_request
def discover_xbee(board: "PythonBoard") -> None:
    """40."""
    board.refuse("unavailable")
