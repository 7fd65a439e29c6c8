"""Rows of the table that move the motors or set up their board."""

from typing import TYPE_CHECKING

from mrl_driver.table import INT16_MAX

from .rows import request, with_motors

if TYPE_CHECKING:
    from .board import PythonBoard


@request
def calibrate(board: "PythonBoard") -> None:
    """1."""
    if with_motors(board):
        board.health.turned()
        board.motor_board.calibrate(board.now_s)


@request
def set_pid_gains(board: "PythonBoard", kp: int, ki: int, kd: int) -> None:
    """2: gains that are in force already are not written to the motor board's EEPROM again."""
    config = board.config
    if with_motors(board) and (kp, ki, kd) != (config["kp"], config["ki"], config["kd"]):
        config["kp"], config["ki"], config["kd"] = kp, ki, kd
        board.motor_board.set_gains(board.now_s, kp, ki, kd)


@request
def set_encoder_prescaler(board: "PythonBoard", encoder: int, prescaler: int) -> None:
    """3."""
    if with_motors(board):
        board.motor_board.set_prescaler(board.now_s, encoder, prescaler)


@request
def preset_encoder(board: "PythonBoard", encoder: int, count: int) -> None:
    """4."""
    if with_motors(board):
        board.motor_board.preset_encoder(board.now_s, encoder, count)


@request
def move_motors_pid(board: "PythonBoard", left: int, right: int) -> None:
    """9."""
    if with_motors(board):
        board.health.turned()
        board.motor_board.move_percent(board.now_s, (left, 0, right), pid=True)


@request
def move_motors(board: "PythonBoard", left: int, right: int) -> None:
    """10."""
    if with_motors(board):
        board.health.turned()
        board.motor_board.move_percent(board.now_s, (left, 0, right), pid=False)


@request
def move_differential(board: "PythonBoard", linear: int, angular: int) -> None:
    """11: beyond the ceiling both speeds shrink by the same factor, which keeps the curvature."""
    linear_ceiling, angular_ceiling = board.config["linear_ceiling"], board.config["angular_ceiling"]
    fast, turning = _beyond(linear, linear_ceiling), _beyond(angular, angular_ceiling)
    if fast or turning:
        board.health.count_clamped()
        by_linear = not turning or (fast and abs(linear) * angular_ceiling > abs(angular) * linear_ceiling)
        top, by = (linear_ceiling, abs(linear)) if by_linear else (angular_ceiling, abs(angular))
        linear, angular = _scaled(linear, top, by), _scaled(angular, top, by)
    if with_motors(board):
        board.health.turned()
        board.motor_board.move_differential(board.now_s, linear, angular)


def _beyond(value: int, ceiling: int) -> bool:
    """The widest ceiling is none: -32768 is to arrive as it is."""
    return ceiling != INT16_MAX and abs(value) > ceiling


def _scaled(value: int, top: int, by: int) -> int:
    """`value * top / by`, rounded towards zero."""
    size = abs(value) * top // by
    return size if value >= 0 else -size


@request
def move_omni(board: "PythonBoard", speed: int, rotation: int, direction: int) -> None:
    """43."""
    if with_motors(board):
        board.health.turned()
        board.motor_board.move_omni(board.now_s, speed, rotation, direction)


@request
def move_to_position(board: "PythonBoard", motor: int, speed: int, position: int) -> None:
    """12: holds with torque."""
    if with_motors(board):
        board.health.turned()
        board.motor_board.move_to_position(board.now_s, motor, speed, position, hold=True)


@request
def stop(board: "PythonBoard") -> None:
    """13."""
    board.stop_motors("host")
    if not board.motor_there():
        board.refuse("unavailable")


@request
def reset_encoders(board: "PythonBoard") -> None:
    """14."""
    if with_motors(board):
        for encoder in (1, 2, 3):
            board.motor_board.preset_encoder(board.now_s, encoder, 0)
