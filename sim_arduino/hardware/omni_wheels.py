"""Kinematics of a robot with three omni wheels, 120 deg apart on a circle, each rolling along this circle.

Motor 1 drives the front left wheel (60 deg from forward), motor 2 the rear wheel, motor 3 the front right wheel.
Positive speeds of all three turn the robot counter-clockwise.
"""

import math
from typing import Sequence, Tuple

OMNI_ANGLES_RAD = (math.pi / 3, math.pi, -math.pi / 3)


def twist_of(
    distances: Sequence[float], radius_m: float, angles_rad: Sequence[float] = OMNI_ANGLES_RAD
) -> Tuple[float, float, float]:
    """Motion forward [m], to the left [m] and turn [rad], if the wheels at these angles roll `distances` [m]."""
    forward = sum(-math.sin(angle) * distance for angle, distance in zip(angles_rad, distances)) * 2.0 / 3.0
    aside = sum(math.cos(angle) * distance for angle, distance in zip(angles_rad, distances)) * 2.0 / 3.0
    return forward, aside, sum(distances) / (3.0 * radius_m)


def shares_for(speed: float, rotation: float, direction_rad: float) -> Tuple[float, float, float]:
    """Shares of the wheels' rated speed for a motion.

    Args:
        speed, rotation: Shares of the fastest translation and rotation, -1 to 1.
        direction_rad: Direction of the translation, counter-clockwise from forward.

    Returns:
        -1 to 1 for motors 1 to 3; if one would exceed 1, all are scaled down together.
    """
    shares = [speed * math.sin(direction_rad - angle) + rotation for angle in OMNI_ANGLES_RAD]
    most = max(1.0, *map(abs, shares))
    left, rear, right = (share / most for share in shares)
    return left, rear, right
