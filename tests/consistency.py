"""Whether a covariance describes the errors of a pose."""

from typing import Sequence

import numpy as np


def error_squared(spread: Sequence[float], *error: float) -> float:
    """The normalised estimation error squared (NEES) of a pose error [m, m, rad], with the six numbers of its
    covariance; its mean is 3 if they are right.
    """
    covariance = np.zeros((3, 3))
    covariance[np.triu_indices(3)] = covariance.T[np.triu_indices(3)] = spread
    return float(np.dot(error, np.linalg.solve(covariance, error)))
