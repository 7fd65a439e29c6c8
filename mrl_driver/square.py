"""Drives a square, closed loop on the pose.  Pure: pose in, speeds out."""

import math
from typing import List, NamedTuple, Tuple

ARRIVED_M = 0.003
"""A corner counts as reached this near along the side, or once it lies behind."""
ALIGNED_RAD = math.radians(0.3)
MINIMUM_LINEAR_M_S, MINIMUM_ANGULAR_RAD_S = 0.02, 0.1
"""Slower than this the motors may not turn at all."""
HEADING_GAIN = 3.0
"""Yaw rate per heading error while driving a side [1/s]."""
OFFSET_GAIN = 3.0
"""Heading towards the side per distance from it [rad/m]; together they settle within some 0.3 m."""
MOST_HEADING_RAD = 0.4
"""The heading leaves the side's direction by no more than this."""
DELAY_S = 0.25
"""From a command to the wheels following it; the braking starts so much earlier."""

Pose = Tuple[float, float, float]
"""x [m], y [m], yaw [rad]."""


class Limits(NamedTuple):
    """Speeds and decelerations of the square."""

    linear_m_s: float = 0.25
    angular_rad_s: float = 0.9
    braking_m_s2: float = 0.15
    braking_rad_s2: float = 1.0


class Square:
    """A square counter-clockwise from the first pose, again and again.

    The robot follows each side, stands at its end and turns to the next one, so the corners are exact and no
    error is carried on.
    """

    def __init__(self, side_m: float = 1.0, limits: Limits = Limits()) -> None:  # noqa: B008 (immutable)
        self._side_m = side_m
        self._limits = limits
        self._corners: List[Tuple[float, float]] = []
        self._turning = False
        self.corner = 0
        """Corners reached so far; four make a round."""

    def command(self, pose: Pose) -> Tuple[float, float]:
        """Speeds (linear [m/s], angular [rad/s]) for the present pose."""
        if not self._corners:
            self._corners = self._plan(pose)
        left_m, offset_m, error = self._on_side(pose)
        if self._turning:
            return self._turn(error)
        if left_m < ARRIVED_M:
            self.corner += 1
            self._turning = True
            return 0.0, 0.0
        return self._drive(left_m, offset_m, error)

    def _on_side(self, pose: Pose) -> Tuple[float, float, float]:
        """Distance to the side's end [m], offset to its left [m], and its direction as seen from the robot [rad]."""
        (x0, y0), (x1, y1) = self._corners[self.corner % 4], self._corners[(self.corner + 1) % 4]
        direction = math.atan2(y1 - y0, x1 - x0)
        cos, sin = math.cos(direction), math.sin(direction)
        left_m = (x1 - pose[0]) * cos + (y1 - pose[1]) * sin
        offset_m = (pose[1] - y1) * cos - (pose[0] - x1) * sin
        return left_m, offset_m, wrapped(direction - pose[2])

    def _plan(self, pose: Pose) -> List[Tuple[float, float]]:
        x, y, yaw = pose
        corners = []
        for i in range(4):
            corners.append((x, y))
            x += self._side_m * math.cos(yaw + i * math.pi / 2)
            y += self._side_m * math.sin(yaw + i * math.pi / 2)
        return corners

    def _turn(self, error: float) -> Tuple[float, float]:
        if abs(error) < ALIGNED_RAD:
            self._turning = False
            return 0.0, 0.0
        limits = self._limits
        speed = _braked(abs(error), limits.angular_rad_s, limits.braking_rad_s2, MINIMUM_ANGULAR_RAD_S)
        return 0.0, math.copysign(speed, error)

    def _drive(self, left_m: float, offset_m: float, error: float) -> Tuple[float, float]:
        limits = self._limits
        linear = _braked(left_m, limits.linear_m_s, limits.braking_m_s2, MINIMUM_LINEAR_M_S)
        back = _clamped(OFFSET_GAIN * offset_m, MOST_HEADING_RAD)
        return linear, _clamped(HEADING_GAIN * (error - back), limits.angular_rad_s)


def _clamped(value: float, most: float) -> float:
    return max(-most, min(most, value))


def wrapped(angle: float) -> float:
    """The same angle in [-pi, pi] [rad]."""
    return math.remainder(angle, 2 * math.pi)


def _braked(left: float, top: float, braking: float, least: float) -> float:
    """Speed from which `braking` comes to rest within `left`, reacting after DELAY_S."""
    delay = braking * DELAY_S
    return max(least, min(top, math.sqrt(delay * delay + 2 * braking * left) - delay))
