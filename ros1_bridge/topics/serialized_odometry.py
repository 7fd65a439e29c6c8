"""Serializes the messages of every frame directly from numbers.  Pure.

The bytes equal those of genpy, in a tenth of its time.  ROS messages are little-endian and unpadded.  A string, or an
array without a fixed length, starts with its length (uint32).  TCPROS puts the length of the message before it.
"""

import struct
from typing import List, Sequence

from .message_covariance import (
    SIDEWAYS_M2_S2,
    SPEED_SHARE,
    STILL_M2_S2,
    STILL_RAD2_S2,
    Unknowns,
    pose_matrix,
    twist_matrix,
)

_PLANAR = "2d24x2d"
"""x, y; then z and the rotation's x, y, all zero; then the rotation's z, w."""
_ROW = "2d24xd"
"""First, second and last entry of a row of a covariance."""


class PackedOdometry:
    """nav_msgs/Odometry of a robot on the floor, with its frames set; its twist may have a speed to the left."""

    def __init__(self, odom_frame: str, base_frame: str) -> None:
        self._names = _text(odom_frame) + _text(base_frame)
        self._axes = _doubles(pose_matrix((0.0,) * 6)[12:30])  # the rows of z, roll and pitch
        self._between = _doubles(twist_matrix(0.0, 0.0)[8:35])
        layout = struct.Struct(
            f"<4I{len(self._names)}s{_PLANAR}{_ROW}{_ROW}{len(self._axes)}s{_ROW}"  # header and pose
            f"2d24xd d48xd{len(self._between)}sd"  # twist
        )
        self._size, self._pack = layout.size - 4, layout.pack

    def pack(
        self,
        sequence: int,
        secs: int,
        nsecs: int,
        x_m: float,
        y_m: float,
        half_sin: float,
        half_cos: float,
        unknowns: Unknowns,
        twist: Sequence[float],
    ) -> bytes:
        """The serialized message.

        Args:
            half_sin, half_cos: Sine and cosine of half the heading.
            twist: Linear and angular speed [m/s rad/s], and perhaps the speed to the left [m/s].
        """
        xx, xy, xt, yy, yt, tt = unknowns
        linear, angular = twist[0], twist[1]
        along = STILL_M2_S2 + (SPEED_SHARE * linear) ** 2  # as `twist_variances`, without a call
        turning = STILL_RAD2_S2 + (SPEED_SHARE * angular) ** 2
        lateral, aside = 0.0, SIDEWAYS_M2_S2
        if len(twist) == 3:
            lateral = twist[2]
            aside = STILL_M2_S2 + (SPEED_SHARE * lateral) ** 2
        return self._pack(
            self._size, sequence, secs, nsecs, self._names, x_m, y_m, half_sin, half_cos,
            xx, xy, xt, xy, yy, yt, self._axes, xt, yt, tt,
            linear, lateral, angular, along, aside, self._between, turning,
        )  # fmt: skip


class PackedTransform:
    """tf2_msgs/TFMessage with one transform of a robot on the floor, with its frames set."""

    def __init__(self, parent_frame: str, child_frame: str) -> None:
        self._names = _text(parent_frame) + _text(child_frame)
        layout = struct.Struct(f"<5I{len(self._names)}s{_PLANAR}")
        self._size, self._pack = layout.size - 4, layout.pack

    def pack(self, secs: int, nsecs: int, x_m: float, y_m: float, half_sin: float, half_cos: float) -> bytes:
        """The serialized message; `half_sin` and `half_cos` are sine and cosine of half the heading."""
        return self._pack(self._size, 1, 0, secs, nsecs, self._names, x_m, y_m, half_sin, half_cos)


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _doubles(values: List[float]) -> bytes:
    return struct.pack(f"<{len(values)}d", *values)
