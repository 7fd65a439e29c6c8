"""Handlers of the requests that move the motors or set up the motor board."""

from functools import partial
from typing import Callable, Tuple

from mrl_driver.protocol.table import INT16_MAX
from sim_arduino.hardware.omni3md import Omni3MD

from .python_board import PythonBoard
from .registry import REQUESTS, request

_PER_MM_S = 95492
"""6e5 / (2 pi): ceiling [mm/s] * this / (full_speed [1/min] * wheel_radius [0.01 mm]) is the ceiling in %."""


def _register(name: str, method: Callable[..., None], turns: bool) -> None:
    """Registers a request that goes to the motor board if it answers; with `turns` the motors may turn from then on."""

    def handle(board: PythonBoard, *values: int) -> None:
        if board.require_motors():
            if turns:
                board.health.turned()
            method(board.motor_board, board.now_s, *values)

    REQUESTS[name] = handle


def _move_motors(motors: Omni3MD, now_s: float, left: int, right: int, pid: bool) -> None:
    motors.move_percent(now_s, (left, 0, right), pid)


_register("calibrate", Omni3MD.calibrate, True)
_register("set_encoder_prescaler", Omni3MD.set_prescaler, False)
_register("preset_encoder", Omni3MD.preset_encoder, False)
_register("move_motors_pid", partial(_move_motors, pid=True), True)
_register("move_motors", partial(_move_motors, pid=False), True)
_register("move_to_position", partial(Omni3MD.move_to_position, hold=True), True)


@request
def set_pid_gains(board: PythonBoard, kp: int, ki: int, kd: int) -> None:
    """2: unchanged gains are not written to the motor board's EEPROM again."""
    config = board.config
    if board.require_motors() and (kp, ki, kd) != (config["kp"], config["ki"], config["kd"]):
        config["kp"], config["ki"], config["kd"] = kp, ki, kd
        board.motor_board.set_gains(board.now_s, kp, ki, kd)


@request
def move_differential(board: PythonBoard, linear: int, angular: int) -> None:
    """11."""
    config = board.config
    linear, angular = _clamped(board, linear, angular, config["linear_ceiling"], config["angular_ceiling"])
    if board.require_motors():
        board.health.turned()
        board.motor_board.move_differential(board.now_s, linear, angular)


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
    if board.require_motors():
        board.health.turned()
        board.motor_board.move_omni(board.now_s, speed, rotation, direction)


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
    board.stop_motors("host")
    board.require_motors()


@request
def reset_encoders(board: PythonBoard) -> None:
    """14."""
    if board.require_motors():
        for encoder in (1, 2, 3):
            board.motor_board.preset_encoder(board.now_s, encoder, 0)
