"""The robot that a bare board calculates, compiled for the PC: where it is, and what its encoders say."""

import ctypes
import math
from types import SimpleNamespace
from typing import Any, NamedTuple, Tuple

import numpy as np

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from mrl_driver.protocol.table import BY_NAME
from sim_arduino.board import parameter_store
from tests.firmware.pc_board import VIRTUAL, PcBoard
from tests.models import model

DUO = model("duo")
EEPROM = parameter_store.image(parameter_store.first(DUO.ids[0], DUO))
M_PER_COUNT, SEPARATION_M = math.pi * 0.065 / 1496.0, 0.150
"""Of the board's parameters, in whole hundredths of a millimetre; the model's own number is rounded."""
SAMPLE_S = 4.992e-3
BEHIND = 4  # samples in a period of the stream
CORNERS_M = ((1.0, 1.0), (2.0, 0.7), (3.2, 1.0), (3.2, 1.5), (1.9, 1.4), (0.8, 2.2))
"""Places of a tour through the room, far from its walls and the box."""
LEG_SAMPLES, STANDS_LEGS = 100, 6
THERE_M = 0.2  # from a place of the tour
NEAR_M, NEAR_RAD = 0.010, 0.003  # the pose comes in whole millimetres and milliradians


def bare() -> PcBoard:
    """A board with nothing but its cable."""
    nothing = SimpleNamespace(
        bridge=None, i2c={}, advance=lambda to_s: None, adc_volts=lambda channel, time_s: 0.0
    )
    nothing.pin_changed = lambda pin, level, time_s: None
    return PcBoard(nothing, EEPROM, VIRTUAL)


def pose(board: PcBoard) -> Tuple[float, float, float]:
    """Where the robot says that it is [m m rad]."""
    board.receive(b"@62e")
    found = FrameDecoder(REPLIES).feed(board.advance(board.now_s + 0.05))
    code = BY_NAME["read_virtual_pose"].code
    (x, y, heading), *_ = (each.args for each in found if isinstance(each, Frame) and each.code == code)
    return x / 1000, y / 1000, heading / 1000


class Odometry:
    """What a host makes of the counts, from the place where the robot starts."""

    def __init__(self) -> None:
        self.x_m = self.y_m = 1.0
        self.yaw_rad = 0.0
        self._last = np.zeros(2, dtype=np.uint16)

    def add(self, counts: Any) -> None:
        """Counts of each sample, left and right."""
        read = np.vstack([self._last, counts[BEHIND - 1 :: BEHIND]])
        left, right = (np.diff(read, axis=0).astype(np.int16) * M_PER_COUNT).T
        yaw = self.yaw_rad + np.cumsum((right - left) / SEPARATION_M)
        middle = yaw - (right - left) / SEPARATION_M / 2
        self.x_m += float(np.sum((left + right) / 2 * np.cos(middle)))
        self.y_m += float(np.sum((left + right) / 2 * np.sin(middle)))
        self.yaw_rad, self._last = float(yaw[-1]), read[-1]


def levels(odometry: Odometry, to: Tuple[float, float]) -> Tuple[int, int]:
    """Levels of PWM that bring the robot to a place."""
    ahead = math.atan2(to[1] - odometry.y_m, to[0] - odometry.x_m) - odometry.yaw_rad
    turn = int(45 * max(-1.0, min(1.0, math.remainder(ahead, 2 * math.pi))))
    return 130 - turn, 130 + turn


class Drift(NamedTuple):
    """What pose and counts differ by at the end of a tour [m rad], and its length [m]."""

    place_m: float
    heading_rad: float
    driven_m: float


def drift(seconds: float) -> Drift:
    """Drives round the room for a time, and reads the pose where the robot stands at last."""
    board, odometry, driven_m, goal = bare(), Odometry(), 0.0, 0
    board.advance(0.2)
    steps = board.native.pc_virtual_steps
    steps.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_void_p)
    counts = np.zeros((LEG_SAMPLES, 2), dtype=np.uint16)
    for _ in range(round(seconds / SAMPLE_S / LEG_SAMPLES)):
        before = odometry.x_m, odometry.y_m
        steps(LEG_SAMPLES, *levels(odometry, CORNERS_M[goal]), counts.ctypes.data)
        odometry.add(counts)
        driven_m += math.dist(before, (odometry.x_m, odometry.y_m))
        goal = (goal + (math.dist(CORNERS_M[goal], (odometry.x_m, odometry.y_m)) < THERE_M)) % len(CORNERS_M)
    for _ in range(STANDS_LEGS):
        steps(LEG_SAMPLES, 0, 0, counts.ctypes.data)
        odometry.add(counts)
    x_m, y_m, heading_rad = pose(board)
    board.close()
    turned_rad = abs(math.remainder(heading_rad - odometry.yaw_rad, 2 * math.pi))
    return Drift(math.dist((x_m, y_m), (odometry.x_m, odometry.y_m)), turned_rad, driven_m)


def test_driving_for_half_an_hour_leaves_no_drift_between_pose_and_counts():
    found = drift(1800)
    assert found.driven_m > 350 and found.place_m < NEAR_M and found.heading_rad < NEAR_RAD
