"""Geometry and noise that explain where runs ended: weighted least squares over the counts themselves.

UMBmark's closed form holds for small errors on a perfect square; this starts there and holds for any run.
"""

from typing import Callable, List, NamedTuple, Sequence, Tuple

import numpy as np

from mrl_driver.errors import ConfigError
from mrl_driver.robot.models import Drive, Noise

from .trial import Run, errors, length_m, path, spread, unit_spreads

STEPS, ENOUGH = 20, 1e-10
LEAST_RUNS_FOR_NOISE = 6
OUTLIER = 6.0
"""A run this many times as far off as is usual among the others was not measured right."""

SCALE, OFFSET, SLIP, AXLE = "metres_per_count", "wheel_offset", "turn_slip", "wheel_separation_m"
_DELTA = 1e-6


class Measured(NamedTuple):
    """How well ends are measured, as standard deviations."""

    position_m: float
    heading_rad: float

    @property
    def variances(self) -> Tuple[float, float, float]:
        """Of x, y and heading."""
        return self.position_m**2, self.position_m**2, self.heading_rad**2


BY_TAPE, BY_TRUTH = Measured(0.002, 0.01), Measured(2e-4, 1e-3)
"""People reach 2 mm and half a degree; of emulated robots the counts' own rounding is left."""


class Fit(NamedTuple):
    """`drive` explains the runs; `errors` (R, 3) is what it leaves, `deviations` the doubt of each free number."""

    drive: Drive
    errors: np.ndarray
    deviations: Tuple[float, ...]


def fit(
    runs: Sequence[Run], start: Drive, free: Sequence[str], noise: Noise, measured: Measured = BY_TAPE
) -> Fit:
    """The drive whose `free` numbers explain best where the runs ended.

    Args:
        start: taken for what is not free, and as a first guess.
        noise: how runs are weighted; its size does not matter, its shape does.

    Raises:
        ConfigError: the runs do not tell these numbers.
    """
    drive, runs = start, list(runs)
    roots = [_root(run, spread(start, run.steps, noise) + np.diag(measured.variances)) for run in runs]
    for _ in range(STEPS):
        found = _weighted(roots, errors(drive, runs))
        slopes = np.stack([_slope(drive, name, runs, roots) for name in free], axis=1)
        step, _, rank, _ = np.linalg.lstsq(slopes, found, rcond=1e-9)
        if rank < len(free) or not np.all(np.isfinite(step)):
            raise ConfigError(
                f"{len(runs)} runs do not tell {', '.join(free)}, expected ends with x, y and heading"
            )
        drive = _moved(drive, free, np.clip(step, -0.2, 0.2))
        if np.abs(step).max() < ENOUGH:
            break
    left = errors(drive, runs)
    rest = _weighted(roots, left)
    doubt = np.linalg.inv(slopes.T @ slopes) * (rest @ rest / max(1, len(rest) - len(free)))
    return Fit(drive, left, tuple(np.sqrt(np.diag(doubt)).tolist()))


def _moved(drive: Drive, free: Sequence[str], step: Sequence[float]) -> Drive:
    """The drive with steps that are relative for lengths, absolute for shares."""
    values = drive._asdict()
    for name, part in zip(free, step):
        values[name] = float(values[name] * (1 + part) if name in (SCALE, AXLE) else values[name] + part)
    return Drive(**values)


def _slope(drive: Drive, name: str, runs: List[Run], roots: List[np.ndarray]) -> np.ndarray:
    ahead, behind = (_moved(drive, [name], [delta]) for delta in (_DELTA, -_DELTA))
    ends = np.array([path(ahead, run.steps)[-1] - path(behind, run.steps)[-1] for run in runs])
    return _weighted(roots, ends / (2 * _DELTA))


def _root(run: Run, cover: np.ndarray) -> np.ndarray:
    """What makes a run's measured errors, of covariance `cover`, uncorrelated and of unit size (K, 3)."""
    known = np.isfinite(run.end)
    picked = np.eye(3)[known]
    if not known.any():
        return picked
    inverse: np.ndarray = np.linalg.inv(np.linalg.cholesky(cover[np.ix_(known, known)]))
    return inverse @ picked


def _weighted(roots: List[np.ndarray], found: np.ndarray) -> np.ndarray:
    return np.concatenate([root @ np.nan_to_num(row) for root, row in zip(roots, found)])


def outlier(runs: Sequence[Run], fitted: Fit) -> int:
    """Index of a run that the others gainsay, or -1."""
    if len(runs) < 4:
        return -1
    ways = np.array([length_m(fitted.drive, run) for run in runs])
    off = np.hypot(*np.nan_to_num(fitted.errors[:, :2]).T) / np.maximum(ways, 0.1)
    worst = int(np.argmax(off))
    usual = float(np.median(np.delete(off, worst)))
    return worst if off[worst] > max(OUTLIER * usual, 0.01) else -1


def estimate_noise(runs: Sequence[Run], fitted: Fit, free: int, measured: Measured = BY_TAPE) -> Noise:
    """The noise that makes what the fit has left most likely.

    Args:
        free: how many numbers were fitted: they have taken their share of the errors.

    Raises:
        ConfigError: too few runs.
    """
    if len(runs) < LEAST_RUNS_FOR_NOISE:
        raise ConfigError(
            f"there are {len(runs)} runs, expected {LEAST_RUNS_FOR_NOISE} or more for the noise"
        )
    known = np.isfinite(fitted.errors)
    off = np.nan_to_num(fitted.errors)
    wheels, turns = (np.array(part) for part in zip(*(unit_spreads(fitted.drive, r.steps) for r in runs)))
    doubt = np.where(known, measured.variances, _UNKNOWN)[:, :, None] * np.eye(3)
    share = max(0.1, 1 - free / int(known.sum()))

    def unlikelihood(wheel: float, turn: float) -> float:
        covers = wheel * wheels + turn * turns + doubt
        squared = np.einsum("ri,ri->", off, np.linalg.solve(covers, off[:, :, None])[:, :, 0])
        return float(share * np.linalg.slogdet(covers)[1].sum() + squared)

    return Noise(*_lowest(unlikelihood))


_UNKNOWN = 1e6
_LEAST, _MOST = -6.0, -1.0
"""Powers of ten: no robot is believed to err less than 1 mm over 1 m."""


def _lowest(height: Callable[[float, float], float]) -> Tuple[float, float]:
    """The pair at which `height` is lowest: a grid over five decades, refined around its best node."""

    def at(exponents: Tuple[float, float]) -> float:
        return height(10.0 ** exponents[0], 10.0 ** exponents[1])

    nodes = np.arange(_LEAST, _MOST + 0.1)
    best = min(((float(a), float(b)) for a in nodes for b in nodes), key=at)
    step = 0.5
    while step > 0.002:
        moves = [(a * step, b * step) for a in (-1, 0, 1) for b in (-1, 0, 1)]
        around = [_inside((best[0] + a, best[1] + b)) for a, b in moves]
        better = min(around, key=at)
        if at(better) >= at(best):
            step /= 2
        else:
            best = better
    return 10.0 ** best[0], 10.0 ** best[1]


def _inside(exponents: Tuple[float, float]) -> Tuple[float, float]:
    first, second = (min(_MOST, max(_LEAST, exponent)) for exponent in exponents)
    return first, second
