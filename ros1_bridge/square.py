"""Drives a square, closed loop on the pose.  Pure: pose in, speeds out."""

import math
from typing import List, NamedTuple, Tuple

ARRIVED_M = 0.003
"""A corner counts as reached this near, or once it lies behind."""
ALIGNED_RAD = math.radians(0.3)
MINIMUM_LINEAR_M_S, MINIMUM_ANGULAR_RAD_S = 0.02, 0.1
"""Slower than this the motors may not turn at all."""
HEADING_GAIN = 2.0
"""Yaw rate per heading error while driving straight [1/s]."""
STEER_UNTIL_M = 0.10
"""Nearer to the corner than this its direction is too uncertain to steer by."""
DELAY_S = 0.15
"""From a command to the wheels following it; the braking starts so much earlier."""

Pose = Tuple[float, float, float]
"""x [m], y [m], yaw [rad]."""


class Limits(NamedTuple):
    """Speeds and decelerations of the square."""

    linear_m_s: float = 0.25
    angular_rad_s: float = 0.9
    braking_m_s2: float = 0.15
    braking_rad_s2: float = 0.8


class Square:
    """A square counter-clockwise from the first pose, again and again.

    At each corner the robot stands and turns towards the next one, so the corners are exact and the error of
    one side is taken out by the next.
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
        target = self._corners[(self.corner + 1) % 4]
        away_m = math.hypot(target[0] - pose[0], target[1] - pose[1])
        error = wrapped(math.atan2(target[1] - pose[1], target[0] - pose[0]) - pose[2])
        if self._turning:
            return self._turn(error)
        if away_m < ARRIVED_M or (away_m < STEER_UNTIL_M and abs(error) > math.pi / 2):
            self.corner += 1
            self._turning = True
            return 0.0, 0.0
        return self._drive(away_m, error)

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

    def _drive(self, away_m: float, error: float) -> Tuple[float, float]:
        limits = self._limits
        linear = _braked(away_m, limits.linear_m_s, limits.braking_m_s2, MINIMUM_LINEAR_M_S)
        angular = HEADING_GAIN * error if away_m > STEER_UNTIL_M else 0.0
        return linear, max(-limits.angular_rad_s, min(limits.angular_rad_s, angular))


def wrapped(angle: float) -> float:
    """The same angle in [-pi, pi] [rad]."""
    return math.remainder(angle, 2 * math.pi)


def _braked(left: float, top: float, braking: float, least: float) -> float:
    """Speed from which `braking` comes to rest within `left`, reacting after DELAY_S."""
    delay = braking * DELAY_S
    return max(least, min(top, math.sqrt(delay * delay + 2 * braking * left) - delay))
