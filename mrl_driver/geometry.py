"""Plane geometry: poses, exact arcs, angles, and quaternions about the vertical axis.  Metres and radians; no I/O.

Both the driver and the emulator use it.  The emulator's physics has its own arc: with this one, an error in it would
cancel out between the simulated robot and the odometry.
"""

import math
from typing import Any, NamedTuple, Tuple

GRAVITY_M_S2 = 9.80665  # standard gravity, by definition (3rd CGPM, 1901)


FARTHEST_M = 1e8
"""Largest coordinate: more than any map needs, and small enough for cell indices of a grid, and for steps of 0.1 um."""


class Pose(NamedTuple):
    """Position, and yaw in (-pi, pi], counter-clockwise from x."""

    x_m: float
    y_m: float
    yaw_rad: float

    def compose(self, x_m: float, y_m: float, yaw_rad: float = 0.0) -> "Pose":
        """Return a pose given in the frame of this pose (x forward, y left) in the frame that this pose is given in."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x_m, y_m = self.x_m + cos * x_m - sin * y_m, self.y_m + sin * x_m + cos * y_m
        return Pose(x_m, y_m, wrap_angle(self.yaw_rad + yaw_rad))

    def relative_to(self, origin: "Pose") -> "Pose":
        """Return this pose in the frame of `origin`: the inverse of `origin.compose`."""
        dx, dy = self.x_m - origin.x_m, self.y_m - origin.y_m
        cos, sin = math.cos(origin.yaw_rad), math.sin(origin.yaw_rad)
        return Pose(cos * dx + sin * dy, cos * dy - sin * dx, wrap_angle(self.yaw_rad - origin.yaw_rad))


ORIGIN = Pose(0.0, 0.0, 0.0)
_new = tuple.__new__  # `_new(Pose, (x, y, yaw))` is `Pose(x, y, yaw)` without a call in Python


def wrap_angle(angle_rad: float) -> float:
    """Return the same direction in (-pi, pi] [rad]."""
    if -math.pi < angle_rad <= math.pi:
        return angle_rad
    wrapped = math.remainder(angle_rad, 2 * math.pi)
    return math.pi if wrapped == -math.pi else wrapped


def wrap_angles(angles_rad: Any) -> Any:
    """Return an array of the same directions in (-pi, pi] [rad], as `wrap_angle` does for one."""
    return math.pi - (math.pi - angles_rad) % (2 * math.pi)


def advance(pose: Pose, forward_m: float, turn_rad: float, left_m: float = 0.0) -> Pose:
    """Return the pose at the end of an arc, exact for constant speeds (the exponential map of SE(2)).

    Args:
        pose: start of the arc.
        forward_m: distance along the arc; of a robot that moves sideways, the part along its own x.
        turn_rad: angle turned.
        left_m: part of the distance along the robot's own y.
    """
    half = turn_rad / 2
    yaw_rad = pose.yaw_rad
    cos, sin = math.cos(yaw_rad + half), math.sin(yaw_rad + half)
    if not -1e-8 <= half <= 1e-8:
        chord = math.sin(half) / half
        forward_m, left_m = forward_m * chord, left_m * chord
    yaw_rad += turn_rad
    if not -math.pi < yaw_rad <= math.pi:
        yaw_rad = wrap_angle(yaw_rad)
    x_m, y_m = pose.x_m + forward_m * cos, pose.y_m + forward_m * sin
    if left_m:
        x_m, y_m = x_m - left_m * sin, y_m + left_m * cos
    return _new(Pose, (x_m, y_m, yaw_rad))


def quaternion_of(yaw_rad: float) -> Tuple[float, float]:
    """Return z and w of the quaternion that turns by this yaw; its x and y are zero."""
    return math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw of a quaternion of length 1, in (-pi, pi] [rad]."""
    return wrap_angle(math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
