"""Covariance matrices of pose and twist for messages.  Pure; `mrl_driver.robot.covariance` computes the values."""

from typing import List, Tuple

from mrl_driver.robot.covariance import Spread

UNUSED_VARIANCE = 1e6
"""Variance of axes that a robot on the floor does not have; filters treat it as "not measured"."""
STILL_M2_S2, STILL_RAD2_S2, SIDEWAYS_M2_S2 = 1e-4, 1e-3, 1e-6
"""Twist variances of a standing robot; the sideways variance is small because the wheels prevent sliding."""
SPEED_SHARE = 0.05
"""Standard deviation of a speed, as a share of the speed."""
Unknowns = Spread


def pose_matrix(unknowns: Unknowns) -> List[float]:
    """The 6 x 6 row-major covariance (36,) of a pose."""
    xx, xy, xt, yy, yt, tt = unknowns
    matrix = diagonal((xx, yy) + (UNUSED_VARIANCE,) * 3 + (tt,))
    matrix[1] = matrix[6] = xy
    matrix[5] = matrix[30] = xt
    matrix[11] = matrix[31] = yt
    return matrix


def twist_matrix(linear_m_s: float, angular_rad_s: float) -> List[float]:
    """The 6 x 6 row-major covariance (36,) of a twist."""
    along, turning = twist_variances(linear_m_s, angular_rad_s)
    return diagonal((along, SIDEWAYS_M2_S2) + (UNUSED_VARIANCE,) * 3 + (turning,))


def twist_variances(linear_m_s: float, angular_rad_s: float) -> Tuple[float, float]:
    """The variances of these speeds."""
    linear, angular = SPEED_SHARE * linear_m_s, SPEED_SHARE * angular_rad_s
    return STILL_M2_S2 + linear * linear, STILL_RAD2_S2 + angular * angular


def diagonal(variances: Tuple[float, ...]) -> List[float]:
    """6 x 6 row-major matrix (36,) with these six values on its diagonal."""
    return [variances[i // 6] if i % 7 == 0 else 0.0 for i in range(36)]
