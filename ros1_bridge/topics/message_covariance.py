"""Covariance matrices of pose and twist for messages.  Pure; `mrl_driver.robot.covariance` computes the values."""

from typing import List, Sequence, Tuple

from mrl_driver.robot.covariance import Spread, Variances

UNUSED_VARIANCE = 1e6
"""Variance of axes that a robot on the floor does not have; filters treat it as "not measured"."""


def pose_matrix(spread: Spread) -> List[float]:
    """The 6 x 6 row-major covariance (36,) of a pose."""
    xx, xy, xt, yy, yt, tt = spread
    matrix = diagonal((xx, yy) + (UNUSED_VARIANCE,) * 3 + (tt,))
    matrix[1] = matrix[6] = xy
    matrix[5] = matrix[30] = xt
    matrix[11] = matrix[31] = yt
    return matrix


def spread_of(matrix: Sequence[float]) -> Spread:
    """The covariance on the floor in a 6 x 6 row-major matrix (36,), unchecked."""
    xx, xy, xt, yy, yt, tt = (matrix[at] for at in (0, 1, 5, 7, 11, 35))
    return xx, xy, xt, yy, yt, tt


def twist_matrix(variances: Variances) -> List[float]:
    """The 6 x 6 row-major covariance (36,) of a twist."""
    linear, angular, lateral = variances
    return diagonal((linear, lateral) + (UNUSED_VARIANCE,) * 3 + (angular,))


def diagonal(variances: Tuple[float, ...]) -> List[float]:
    """6 x 6 row-major matrix (36,) with these six values on its diagonal."""
    return [variances[i // 6] if i % 7 == 0 else 0.0 for i in range(36)]
