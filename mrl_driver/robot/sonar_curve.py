"""The sonars' curve: range_cm = a s^b + c for the ADC count s, fitted to a wall at known distances."""

from typing import NamedTuple, Sequence, Tuple

import numpy as np

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import PARAMETER_BY_NAME

LEAST_DISTANCES = 8
LEAST_REACH = 2.5  # the largest distance must be at least this many times the smallest
MISSED_M = 0.05
"""A reading that is further off the curve than this, and than `OUTLIERS` usual errors, counts as a missed wall."""
OUTLIERS = 5.0
MOST_MISSED = 0.2
LEAST_R2 = 0.95  # with less, the readings do not follow the distances; a wall gives 0.999
_B_RANGE = (0.5, 1.6)


class Curve(NamedTuple):
    """range_cm = a s^b + c."""

    a: float
    b: float
    c: float

    def range_m(self, counts: np.ndarray) -> np.ndarray:
        """Ranges [m] of ADC counts."""
        ranges: np.ndarray = (self.a * np.asarray(counts, float) ** self.b + self.c) / 100
        return ranges

    def counts(self, ranges_m: np.ndarray) -> np.ndarray:
        """ADC counts, not rounded, at which the curve gives these ranges [m]."""
        base = np.maximum(0.0, (100 * np.asarray(ranges_m, float) - self.c) / self.a)
        counts: np.ndarray = base ** (1 / self.b)
        return counts

    def on_wire(self) -> "Curve":
        """The curve, rounded and limited to the board's parameters."""
        limits = (PARAMETER_BY_NAME[f"sonar_{name}"] for name in self._fields)
        return Curve(*(min(p.high, max(p.low, round(v * 1e4))) / 1e4 for p, v in zip(limits, self)))


THESIS = Curve(1.1767, 0.94657, -0.3759)  # (Araujo 2012), R2 0.9992


class SonarFit(NamedTuple):
    """A curve and its quality: `errors_m` (N,) is curve minus truth, `used` (N,) bool is True for valid readings."""

    curve: Curve
    r2: float
    errors_m: np.ndarray
    used: np.ndarray


def fit(counts: Sequence[float], ranges_m: Sequence[float]) -> SonarFit:
    """The curve through readings of a wall; single readings that missed the wall are left out.

    `counts` (N,) are ADC counts, NaN for nothing in range or no reading, and `ranges_m` (N,) true distances.
    ConfigError lists the distances if they are too few, or the wall was missed too often.  ConfigError also if no curve
    fits, or the board cannot store it.
    """
    s, truth = np.asarray(counts, float), np.asarray(ranges_m, float)
    valid = np.isfinite(s) & (s > 0)
    require_wall(truth, valid)
    curve = _least_squares(s[valid], truth[valid])
    for _ in range(10):
        off = np.where(valid, curve.range_m(np.where(valid, s, 1.0)) - truth, np.inf)
        usual = 1.4826 * float(np.median(np.abs(off[valid])))
        kept = np.abs(off) <= max(MISSED_M, OUTLIERS * usual)
        require_wall(truth, kept)
        better = _least_squares(s[kept], truth[kept])
        if better == curve:
            break
        curve = better
    left = off[kept]
    r2 = 1 - float(left @ left) / float(np.sum((truth[kept] - truth[kept].mean()) ** 2))
    _require_curve(curve, r2)
    return SonarFit(curve, r2, np.where(valid, off, np.nan), kept)


def require_wall(ranges_m: np.ndarray, valid: np.ndarray) -> None:
    """Raise ConfigError for readings that did not measure a wall: too few distances, or missed too often."""
    distances = np.unique(np.round(ranges_m[valid], 3))
    lost = [d for d in np.unique(np.round(ranges_m, 3)) if not valid[np.abs(ranges_m - d) < 1e-3].any()]
    if lost or np.mean(~valid) > MOST_MISSED:
        where = ", ".join(f"{d:.2f}" for d in lost[:4]) or "several distances"
        raise ConfigError(
            f"the sonar missed the wall {int(np.sum(~valid))} of {len(valid)} times, always at {where} m; expected a "
            "flat wall straight ahead at each distance"
        )
    reach = distances[-1] / max(distances[0], 1e-3) if len(distances) else 0.0
    if len(distances) < LEAST_DISTANCES or reach < LEAST_REACH:
        raise ConfigError(
            f"there are {len(distances)} distances, the largest {reach:.1f} times the smallest; expected at least "
            f"{LEAST_DISTANCES}, the largest at least {LEAST_REACH} times the smallest"
        )


def _require_curve(curve: Curve, r2: float) -> None:
    if not r2 >= LEAST_R2:
        raise ConfigError(
            f"the readings do not follow the distances: R2 {r2:.3f}, expected at least {LEAST_R2:g}: see that the "
            "robot drives, and that the sonar sees the wall"
        )
    nearest = curve.on_wire()
    if not np.allclose(curve, nearest, rtol=0, atol=1e-4):
        raise ConfigError(
            "the board cannot store the curve {:.4f} s^{:.4f} {:+.4f}, expected one such as {:.4f} s^{:.4f} {:+.4f}; "
            "measure the distances again".format(*curve, *nearest)
        )


def _least_squares(s: np.ndarray, ranges_m: np.ndarray) -> Curve:
    """Least-squares curve: for each b, the best a and c have a closed form; ever finer grids find b."""
    low, high = _B_RANGE
    while high - low > 1e-6:
        grid = np.linspace(low, high, 12).tolist()
        best = grid.index(min(grid, key=lambda b: _with(b, s, ranges_m)[0]))
        low, high = grid[max(0, best - 1)], grid[min(best + 1, len(grid) - 1)]
    return _with((low + high) / 2, s, ranges_m)[1]


def _with(b: float, s: np.ndarray, ranges_m: np.ndarray) -> Tuple[float, Curve]:
    """Squared error and curve for this b; c stays within the board's range."""
    power, truth = s**b, 100 * ranges_m
    spread = power - power.mean()
    scatter = float(spread @ spread)  # 0 for readings that are all alike
    a = float(spread @ truth) / scatter if scatter else 0.0
    c = float(truth.mean() - a * power.mean())
    if abs(c) > 3.27:
        c = float(np.copysign(3.27, c))
        a = float(power @ (truth - c) / (power @ power))
    off = a * power + c - truth
    return float(off @ off), Curve(a, b, c)
