"""Handlers of the requests that move the motors or set them up."""

from typing import Callable, Tuple

from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import INT16_MAX

from .motors import Motors
from .python_board import PythonBoard
from .registry import REQUESTS, request

_PER_MM_S = 95492
"""6e5 / (2 pi): ceiling [mm/s] * this / (full_speed [1/min] * wheel_radius [0.01 mm]) is the ceiling in %."""


def _register(name: str, method: Callable[..., bool], moves: bool = False) -> None:
    """Registers a request that a method of `Motors` carries out, given the time and the request's arguments."""

    def handle(board: PythonBoard, *values: int) -> None:
        if moves and board.refuses_move():
            return
        if not method(board.motors, board.now_s, *values):
            board.refuse("unavailable")

    REQUESTS[name] = handle


def _move_motors_pid(motors: Motors, now_s: float, left: int, right: int) -> bool:
    return motors.move_percent(now_s, left, right, True)


def _move_motors(motors: Motors, now_s: float, left: int, right: int) -> bool:
    return motors.move_percent(now_s, left, right, False)


_register("calibrate", lambda motors, *values: motors.calibrate(*values), moves=True)
_register("set_encoder_prescaler", lambda motors, *values: motors.set_prescaler(*values))
_register("preset_encoder", lambda motors, *values: motors.preset_encoder(*values))
_register("move_motors_pid", _move_motors_pid, moves=True)
_register("move_motors", _move_motors, moves=True)
_register("move_to_position", lambda motors, *values: motors.move_position(*values), moves=True)
_register("reset_encoders", lambda motors, *values: motors.reset_encoders(*values))


@request
def set_pid_gains(board: PythonBoard, kp: int, ki: int, kd: int) -> None:
    """2: unchanged gains are not set again, because a motor board would write them to its EEPROM."""
    config = board.config
    if board.require_motors() and (kp, ki, kd) != (config["kp"], config["ki"], config["kd"]):
        config["kp"], config["ki"], config["kd"] = kp, ki, kd
        board.motors.refresh(board.now_s, "kp")


@request
def move_differential(board: PythonBoard, linear: int, angular: int) -> None:
    """11."""
    config = board.config
    linear, angular = _clamped(board, linear, angular, config["linear_ceiling"], config["angular_ceiling"])
    if board.refuses_move():
        return
    if not board.motors.move_speed(board.now_s, linear, angular):
        board.refuse("unavailable")


@request
def move_omni(board: PythonBoard, speed: int, rotation: int, direction: int) -> None:
    """43: the speed ceilings, converted to percent of full speed, limit this request too."""
    config = board.config
    linear, angular = config["linear_ceiling"], config["angular_ceiling"]
    full = config["full_speed"] * config["wheel_radius"]
    most_speed = INT16_MAX if linear == INT16_MAX else min(100, linear * _PER_MM_S // full)
    turning = angular * config["axis_radius"] // 355 * 339  # 3 / pi
    most_rotation = INT16_MAX if angular == INT16_MAX else min(100, turning // full)
    speed, rotation = _clamped(board, speed, rotation, most_speed, most_rotation)
    if board.refuses_move():
        return
    if not board.motors.move_omni(board.now_s, speed, rotation, direction):
        board.refuse("unavailable")


def _clamped(
    board: PythonBoard, linear: int, angular: int, most_linear: int, most_angular: int
) -> Tuple[int, int]:
    """If a speed is beyond its ceiling, both speeds shrink by the same factor, which keeps the curvature."""
    fast, turning = _beyond(linear, most_linear), _beyond(angular, most_angular)
    if not (fast or turning):
        return linear, angular
    board.health.count_clamped()
    by_linear = not turning or (fast and abs(linear) * most_angular > abs(angular) * most_linear)
    top, by = (most_linear, abs(linear)) if by_linear else (most_angular, abs(angular))
    return _scaled(linear, top, by), _scaled(angular, top, by)


def _beyond(value: int, ceiling: int) -> bool:
    """Whether a value is beyond its ceiling; the largest ceiling means no limit, so that -32768 passes unchanged."""
    return ceiling != INT16_MAX and abs(value) > ceiling


def _scaled(value: int, top: int, by: int) -> int:
    """`value * top / by`, rounded towards zero."""
    size = abs(value) * top // by
    return size if value >= 0 else -size


@request
def stop(board: PythonBoard) -> None:
    """13."""
    board.stop_motors(StopReason.HOST)
    board.require_motors()
