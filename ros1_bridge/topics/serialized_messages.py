"""Serializes the messages that come many times a second directly from numbers.  Pure.

The bytes equal those of genpy.  They save half of the CPU of a message: 5.5 of 10.3 us for `odom` and `/tf`, medians of
60 rounds, measured as in `fast_publisher`.  ROS messages are little-endian and unpadded.  A string, or an array without
a fixed length, starts with its length (uint32).  TCPROS puts the length of the message before it.
"""

import struct
from typing import List, Sequence

from sensor_msgs.msg import Range

from mrl_driver.robot.covariance import Spread, Variances
from mrl_driver.robot.models import RangeKind

from .message_covariance import pose_matrix, twist_matrix

_PLANAR = "2d24x2d"  # x, y; then z and the rotation's x, y, all zero; then the rotation's z, w
_ROW = "2d24xd"  # First, second and last entry of a row of a covariance

_DIAGONAL = "d24xd24xd"  # A 3 x 3 matrix with three values on its diagonal


class PackedOdometry:
    """nav_msgs/Odometry of a robot on the floor, with its frames set; its twist may have a speed to the left."""

    def __init__(self, odom_frame: str, base_frame: str) -> None:
        self._names = _text(odom_frame) + _text(base_frame)
        self._axes = _doubles(pose_matrix((0.0,) * 6)[12:30])  # the rows of z, roll and pitch
        self._between = _doubles(twist_matrix((0.0,) * 3)[8:35])
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
        spread: Spread,
        twist: Sequence[float],
        variances: Variances,
    ) -> bytes:
        """The serialized message.

        Args:
            half_sin, half_cos: Sine and cosine of half the heading.
            spread: Covariance of the pose.
            twist: Linear and angular speed [m/s rad/s], and perhaps the speed to the left [m/s].
            variances: Those of the twist.
        """
        xx, xy, xt, yy, yt, tt = spread
        along, turning, aside = variances
        linear, angular = twist[0], twist[1]
        lateral = twist[2] if len(twist) == 3 else 0.0
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


class PackedJoints:
    """sensor_msgs/JointState without a frame and without efforts, with its names set."""

    def __init__(self, names: Sequence[str]) -> None:
        self._count, self._names = len(names), b"".join(map(_text, names))
        layout = struct.Struct(f"<6I{len(self._names)}sI{len(names)}dI{len(names)}dI")
        self._size, self._pack = layout.size - 4, layout.pack

    def pack(
        self, sequence: int, secs: int, nsecs: int, positions: Sequence[float], velocities: Sequence[float]
    ) -> bytes:
        """The serialized message; positions are in rad, velocities in rad/s."""
        count = self._count
        return self._pack(
            self._size, sequence, secs, nsecs, 0, count, self._names, count, *positions, count, *velocities, 0
        )  # fmt: skip


class PackedRange:
    """sensor_msgs/Range of a kind of sonar with its frame set."""

    def __init__(self, frame: str, kind: RangeKind) -> None:
        self._name, self._farthest_m = _text(frame), kind.farthest_m
        radiation = Range.INFRARED if kind.infrared else Range.ULTRASOUND
        self._constant = self._name, radiation, kind.field_of_view_rad, kind.nearest_m
        layout = struct.Struct(f"<4I{len(self._name)}sB4f")
        self._size, self._pack = layout.size - 4, layout.pack

    def pack(self, sequence: int, secs: int, nsecs: int, range_m: float, clear_m: float = 0.0) -> bytes:
        """The serialized message; -inf is too near, NaN is invalid, +inf is nothing in range (REP-117).

        With `clear_m`, that is the longest range, unless the sonar's own is shorter, and what is farther reads as it:
        some costmap layers clear only then.
        """
        most_m = min(clear_m or self._farthest_m, self._farthest_m)
        shown_m = most_m if 0 < clear_m and most_m < range_m else range_m
        return self._pack(self._size, sequence, secs, nsecs, *self._constant, most_m, shown_m)


class PackedImu:
    """sensor_msgs/Imu with its frame set; roll, pitch and all correlations are zero."""

    def __init__(self, frame: str, acceleration_variance: float) -> None:
        self._name = _text(frame)
        variance = acceleration_variance
        self._constant = _doubles([variance, 0, 0, 0, variance, 0, 0, 0, variance])
        layout = struct.Struct(f"<4I{len(self._name)}s16x2d{_DIAGONAL}3d{_DIAGONAL}3d{len(self._constant)}s")
        self._size, self._pack = layout.size - 4, layout.pack

    def pack(
        self,
        sequence: int,
        secs: int,
        nsecs: int,
        half_sin: float,
        half_cos: float,
        orientation_variances: Sequence[float],
        rates: Sequence[float],
        rate_variances: Sequence[float],
        accelerations: Sequence[float],
    ) -> bytes:
        """The serialized message.

        Args:
            half_sin, half_cos: Sine and cosine of half the heading.
            orientation_variances: Of roll, pitch and yaw [rad2]; -1, 0, 0 if the orientation is unknown.
            rates: Angular velocity [rad/s], x, y, z as all further ones.
            rate_variances: Of the angular velocity [rad2/s2].
            accelerations: Linear acceleration [m/s2].
        """
        return self._pack(
            self._size, sequence, secs, nsecs, self._name, half_sin, half_cos, *orientation_variances, *rates,
            *rate_variances, *accelerations, self._constant,
        )  # fmt: skip


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _doubles(values: List[float]) -> bytes:
    return struct.pack(f"<{len(values)}d", *values)
