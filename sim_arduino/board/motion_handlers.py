"""Requests that move the motors or set them up; `Motors` carries most of them out."""

from typing import Callable, Dict, Tuple

from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import COMMANDS, INT16_MAX, Command

from .bridge.integers import divide
from .python_board import PythonBoard
from .registry import REQUESTS

_PER_MM_S = 95492
"""6e5 / (2 pi): ceiling [mm/s] * this / (full_speed [1/min] * wheel_radius [0.01 mm]) is the ceiling in %."""


def _set_pid_gains(board: PythonBoard, kp: int, ki: int, kd: int) -> None:
    """Unchanged gains are not set again, because a motor board would write them to its EEPROM."""
    config = board.config
    if board.require_motors() and (kp, ki, kd) != (config["kp"], config["ki"], config["kd"]):
        config["kp"], config["ki"], config["kd"] = kp, ki, kd
        board.motors.refresh(board.now_s, "kp")


def _stop(board: PythonBoard) -> None:
    board.stop_motors(StopReason.HOST)
    board.require_motors()


# ---- speed ceilings


def _clamped_differential(board: PythonBoard, linear: int, angular: int) -> Tuple[int, ...]:
    config = board.config
    return _clamped(board, linear, angular, config["linear_ceiling"], config["angular_ceiling"])


def _clamped_omni(board: PythonBoard, speed: int, rotation: int, direction: int) -> Tuple[int, ...]:
    """The speed ceilings, converted to percent of full speed, limit this request too."""
    config = board.config
    linear, angular = config["linear_ceiling"], config["angular_ceiling"]
    full = config["full_speed"] * config["wheel_radius"]
    most_speed = INT16_MAX if linear == INT16_MAX else min(100, linear * _PER_MM_S // full)
    turning = angular * config["axis_radius"] // 355 * 339  # 3 / pi
    most_rotation = INT16_MAX if angular == INT16_MAX else min(100, turning // full)
    return (*_clamped(board, speed, rotation, most_speed, most_rotation), direction)


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
    return divide(linear * top, by), divide(angular * top, by)


def _beyond(value: int, ceiling: int) -> bool:
    """Whether a value is beyond its ceiling; the largest ceiling means no limit, so that -32768 passes unchanged."""
    return ceiling != INT16_MAX and abs(value) > ceiling


# ---- requests that the motors carry out

_CEILINGS: Dict[str, Callable[..., Tuple[int, ...]]] = {
    "move_differential": _clamped_differential,
    "move_omni": _clamped_omni,
}


def _register(row: Command) -> None:
    clamp = _CEILINGS.get(row.name)

    def handle(board: PythonBoard, *values: int) -> None:
        if clamp:
            values = clamp(board, *values)
        if row.turns and board.refuses_move():
            return
        if not board.motors.carry_out(board.now_s, row, *values):
            board.refuse("unavailable")

    REQUESTS[row.name] = handle


for _row in COMMANDS:
    if _row.turns or _row.name in ("set_encoder_prescaler", "preset_encoder", "reset_encoders"):
        _register(_row)
REQUESTS.update({"set_pid_gains": _set_pid_gains, "stop": _stop})
