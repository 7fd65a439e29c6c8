"""Drives along straight legs, closed loop on the pose: a list of points, or a square.  No I/O: pose in, speeds out."""

import math
from typing import List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose, wrap_angle

ARRIVED_M = 0.003
"""A corner counts as reached within this distance along the leg, or when it lies behind the robot [m]."""
ALIGNED_RAD = math.radians(0.3)
MINIMUM_LINEAR_M_S, MINIMUM_ANGULAR_RAD_S = 0.02, 0.1  # at lower speeds the motors may not turn at all
HEADING_GAIN = 3.0  # yaw rate per heading error while driving a leg [1/s]
OFFSET_GAIN = 3.0
"""Heading towards the leg per distance from it [rad/m]; with both gains the robot settles within about 0.3 m."""
MOST_HEADING_RAD = 0.4  # largest angle between the heading and the leg's direction
DELAY_S = 0.25  # delay from a command to the wheels' motion [s]; braking starts earlier by this time

Point = Tuple[float, float]


class FollowerLimits(NamedTuple):
    """Speeds and decelerations along the legs."""

    linear_m_s: float = 0.25
    angular_rad_s: float = 0.9
    braking_m_s2: float = 0.15
    braking_rad_s2: float = 1.0


DEFAULT_LIMITS = FollowerLimits()


class Course:
    """A course from the first pose through a list of points (x, y) [m], the ends of the legs.

    The robot turns towards each leg, follows it and stops at its end.  So corners are exact and errors do not add up.
    """

    def __init__(self, points: Sequence[Point], limits: FollowerLimits = DEFAULT_LIMITS) -> None:
        self._limits = limits
        self._points: List[Point] = list(points)
        self._begin: Optional[Point] = None
        self._turning = True
        self.corner = 0  # number of points reached
        self.done = False  # the last point is reached

    def command(self, pose: Pose) -> Tuple[float, float]:
        """Return the speeds (linear [m/s], angular [rad/s]) at this pose; zero when done."""
        if self._begin is None:
            self._begin = (pose[0], pose[1])
        if self.corner == len(self._points):
            self.done = True
            return 0.0, 0.0
        end = self._points[self.corner]
        # A leg without direction:
        if math.hypot(end[0] - self._begin[0], end[1] - self._begin[1]) < ARRIVED_M:
            self._reach()
            return 0.0, 0.0
        left_m, offset_m, error = self._on_leg(self._begin, end, pose)
        if self._turning:
            return self._turn(error)
        if left_m < ARRIVED_M:
            self._reach()
            return 0.0, 0.0
        return self._drive(left_m, offset_m, error)

    def _reach(self) -> None:
        self._begin = self._points[self.corner]
        self.corner += 1
        self._turning = True

    @staticmethod
    def _on_leg(begin: Point, end: Point, pose: Pose) -> Tuple[float, float, float]:
        """Return the distance to the leg's end [m], the offset to its left [m] and its direction in base_link [rad]."""
        direction = math.atan2(end[1] - begin[1], end[0] - begin[0])
        x_m, offset_m, yaw_rad = Pose(*pose).relative_to(Pose(*end, direction))
        return -x_m, offset_m, wrap_angle(-yaw_rad)

    def _turn(self, error: float) -> Tuple[float, float]:
        if abs(error) < ALIGNED_RAD:
            self._turning = False
            return 0.0, 0.0
        limits = self._limits
        top, braking = limits.angular_rad_s, limits.braking_rad_s2
        speed = limit_to_stop(abs(error), top, braking, DELAY_S, MINIMUM_ANGULAR_RAD_S)
        return 0.0, math.copysign(speed, error)

    def _drive(self, left_m: float, offset_m: float, error: float) -> Tuple[float, float]:
        limits = self._limits
        linear = limit_to_stop(left_m, limits.linear_m_s, limits.braking_m_s2, DELAY_S, MINIMUM_LINEAR_M_S)
        back = _clamped(OFFSET_GAIN * offset_m, MOST_HEADING_RAD)
        return linear, _clamped(HEADING_GAIN * (error - back), limits.angular_rad_s)


class Square(Course):
    """A counter-clockwise square from the first pose, repeated without end; a round has four corners."""

    def __init__(self, side_m: float = 1.0, limits: FollowerLimits = DEFAULT_LIMITS) -> None:
        super().__init__((), limits)
        self._side_m = side_m
        self._round: List[Point] = []  # the corners in driving order; the first side is ahead of the robot

    def command(self, pose: Pose) -> Tuple[float, float]:
        """Return the speeds (linear [m/s], angular [rad/s]) at this pose."""
        if not self._round:
            corner = Pose(*pose)
            for _ in range(3):
                corner = corner.compose(self._side_m, 0.0, math.pi / 2)
                self._round.append(corner[:2])
            self._round.append((pose[0], pose[1]))
        if self.corner == len(self._points):
            self._points += self._round
        return super().command(pose)


def _clamped(value: float, most: float) -> float:
    return max(-most, min(most, value))


def limit_to_stop(left: float, top: float, braking: float, delay_s: float, least: float) -> float:
    """Return the speed from which the robot stops within `left`: it brakes after `delay_s`, at the rate `braking`.

    The result is between `least` and `top`.
    """
    delay = braking * delay_s
    return max(least, min(top, math.sqrt(delay * delay + 2 * braking * left) - delay))
