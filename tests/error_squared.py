"""How well a covariance describes the errors that it is given for."""

from typing import Tuple


def error_squared(spread: Tuple[float, ...], dx_m: float, dy_m: float, dyaw_rad: float) -> float:
    """Return the normalised estimation error squared (NEES) of a pose error; its mean is 3 if `spread` is right.

    Raises:
        ValueError: the covariance has no inverse.
    """
    xx, xy, xt, yy, yt, tt = spread
    a, b, c = yy * tt - yt * yt, xt * yt - xy * tt, xy * yt - xt * yy
    d, e, f = xx * tt - xt * xt, xy * xt - xx * yt, xx * yy - xy * xy
    determinant = xx * a + xy * b + xt * c
    if not determinant > 0.0:
        raise ValueError(f"{spread} has no inverse, expected a covariance")
    x, y, t = dx_m, dy_m, dyaw_rad
    return (x * x * a + y * y * d + t * t * f + 2 * (x * y * b + x * t * c + y * t * e)) / determinant
