"""Fits geometry and noise to the measured ends of runs, by weighted least squares over the counts."""

from typing import Callable, Dict, List, NamedTuple, Sequence, Tuple, Union

import numpy as np

from mrl_driver.errors import ConfigError
from mrl_driver.robot.models import Drive, MecanumDrive, Noise

from .trial import Trial, errors, length_m, path, spread, unit_spreads

Geometry = Union[Drive, MecanumDrive]
STEPS, ENOUGH = 100, 1e-10  # badly measured squares need up to 30 steps
LEAST_RUNS_FOR_NOISE = 6
OUTLIER = 6.0  # a run whose error is more than this many times the median of the others was measured wrongly

SCALE, OFFSET, SLIP, AXLE = "metres_per_count", "wheel_offset", "turn_slip", "wheel_separation_m"
RADIUS, CROSS, REAR, SIDE = "wheel_radius_m", "cross_offset", "rear_offset", "side_slip"  # of mecanum wheels
_DELTA = 1e-6
LEAST_SCALE_SD = 2e-4
"""Smallest standard deviation of a calibrated scale: tyres and floors change by more than the fit may say."""
_SCALES = {
    **dict.fromkeys((SCALE, RADIUS), "distance_scale_sd"),
    OFFSET: "wheel_ratio_sd",
    **dict.fromkeys((SLIP, AXLE), "turn_scale_sd"),
}
"""Keys of `Noise` for the deviations of fitted parameters."""


class Measured(NamedTuple):
    """Accuracy of measured ends, as standard deviations."""

    position_m: float
    heading_rad: float

    @property
    def variances(self) -> Tuple[float, float, float]:
        """Variances of x, y and heading."""
        return self.position_m**2, self.position_m**2, self.heading_rad**2


BY_TAPE, BY_TRUTH = Measured(0.002, 0.01), Measured(2e-4, 1e-3)
"""A person measures to 2 mm and half a degree; for emulated robots only the rounding of the counts remains."""


class GeometryFit(NamedTuple):
    """The fitted `drive`, the remaining `errors` (R, 3), and the standard deviation of each free parameter."""

    drive: Geometry
    errors: np.ndarray
    deviations: Tuple[float, ...]


def fit(
    runs: Sequence[Trial], start: Geometry, free: Sequence[str], noise: Noise, measured: Measured = BY_TAPE
) -> GeometryFit:
    """The drive whose `free` parameters fit the ends of the runs best; ConfigError if the runs do not determine them.

    `start` is the first guess, and has the values of the other parameters.  `noise` weighs the runs: only the ratio of
    its values matters.  The ends are as accurate as `measured` says.
    """
    drive, runs = start, list(runs)
    roots = [_root(run, spread(start, run.steps, noise) + np.diag(measured.variances)) for run in runs]
    undetermined = ConfigError(
        f"{len(runs)} runs do not determine {', '.join(free)}, expected ends with x, y and heading"
    )
    for _ in range(STEPS):
        found = _weighted(roots, errors(drive, runs))
        slopes = np.stack([_slope(drive, name, runs, roots) for name in free], axis=1)
        step, _, rank, _ = np.linalg.lstsq(slopes, found, rcond=1e-9)
        if rank < len(free) or not np.all(np.isfinite(step)):
            raise undetermined
        drive = _moved(drive, free, np.clip(step, -0.2, 0.2))
        if drive.turn_slip >= 1:
            raise undetermined
        if np.abs(step).max() < ENOUGH:
            break
    else:
        raise undetermined
    left = errors(drive, runs)
    rest = _weighted(roots, left)
    doubt = np.linalg.inv(slopes.T @ slopes) * (rest @ rest / max(1, len(rest) - len(free)))
    return GeometryFit(drive, left, tuple(np.sqrt(np.diag(doubt)).tolist()))


def scale_deviations(fitted: GeometryFit, free: Sequence[str]) -> Dict[str, float]:
    """Standard deviations of what was fitted, by their keys in `Noise`; at least `LEAST_SCALE_SD`."""
    found = {}
    for name, deviation in zip(free, fitted.deviations):
        share = deviation / (1 - fitted.drive.turn_slip) if name == SLIP else deviation
        if name in _SCALES:
            found[_SCALES[name]] = max(LEAST_SCALE_SD, share)
    return found


def _moved(drive: Geometry, free: Sequence[str], step: Sequence[float]) -> Geometry:
    """The drive after a step; steps are relative for lengths and absolute for shares."""
    values = drive._asdict()
    for name, part in zip(free, step):
        is_length = name in (SCALE, AXLE, RADIUS)
        values[name] = float(values[name] * (1 + part) if is_length else values[name] + part)
    return type(drive)(**values)


def _slope(drive: Geometry, name: str, runs: List[Trial], roots: List[np.ndarray]) -> np.ndarray:
    ahead, behind = (_moved(drive, [name], [delta]) for delta in (_DELTA, -_DELTA))
    ends = np.array([path(ahead, run.steps)[-1] - path(behind, run.steps)[-1] for run in runs])
    return _weighted(roots, ends / (2 * _DELTA))


def _root(run: Trial, cover: np.ndarray) -> np.ndarray:
    """Matrix (K, 3) that makes the measured errors of a run, with covariance `cover`, uncorrelated and of unit size."""
    known = np.isfinite(run.end)
    picked = np.eye(3)[known]
    if not known.any():
        return picked
    inverse: np.ndarray = np.linalg.inv(np.linalg.cholesky(cover[np.ix_(known, known)]))
    return inverse @ picked


def _weighted(roots: List[np.ndarray], found: np.ndarray) -> np.ndarray:
    return np.concatenate([root @ np.nan_to_num(row) for root, row in zip(roots, found)])


def outlier(runs: Sequence[Trial], fitted: GeometryFit) -> int:
    """Index of a run that contradicts the others, or -1."""
    if len(runs) < 4:
        return -1
    lengths_m = np.array([length_m(fitted.drive, run) for run in runs])
    off = np.hypot(*np.nan_to_num(fitted.errors[:, :2]).T) / np.maximum(lengths_m, 0.1)
    worst = int(np.argmax(off))
    usual = float(np.median(np.delete(off, worst)))
    return worst if off[worst] > max(OUTLIER * usual, 0.01) else -1


def estimate_noise(
    runs: Sequence[Trial], fitted: GeometryFit, free: int, measured: Measured = BY_TAPE
) -> Noise:
    """The noise that makes the remaining errors of the fit most likely; raise ConfigError if there are too few runs.

    `free` is the number of fitted parameters, which have absorbed a part of the errors.
    """
    if len(runs) < LEAST_RUNS_FOR_NOISE:
        raise ConfigError(
            f"there are {len(runs)} runs, expected at least {LEAST_RUNS_FOR_NOISE} for the noise"
        )
    known = np.isfinite(fitted.errors)
    off = np.nan_to_num(fitted.errors)
    wheels, turns = (np.array(part) for part in zip(*(unit_spreads(fitted.drive, r.steps) for r in runs)))
    doubt = np.where(known, measured.variances, _UNKNOWN)[:, :, None] * np.eye(3)
    share = max(0.1, 1 - free / int(known.sum()))

    def negative_log_likelihood(wheel: float, turn: float) -> float:
        covers = wheel * wheels + turn * turns + doubt
        squared = np.einsum("ri,ri->", off, np.linalg.solve(covers, off[:, :, None])[:, :, 0])
        return float(share * np.linalg.slogdet(covers)[1].sum() + squared)

    return Noise(*_lowest(negative_log_likelihood))


_UNKNOWN = 1e6
_LEAST, _MOST = -6.0, -1.0  # range of the search as powers of ten; the lower end is an error of 1 mm over 1 m


def _lowest(height: Callable[[float, float], float]) -> Tuple[float, float]:
    """The pair with the lowest `height`: a grid over five decades, refined around its best node."""

    def at(exponents: Tuple[float, float]) -> float:
        return height(10.0 ** exponents[0], 10.0 ** exponents[1])

    nodes = np.arange(_LEAST, _MOST + 0.1)
    best = min(((float(a), float(b)) for a in nodes for b in nodes), key=at)
    step = 0.5
    while step > 0.002:
        firsts, seconds = (
            [min(_MOST, max(_LEAST, each + move * step)) for move in (-1, 0, 1)] for each in best
        )
        around = [(first, second) for first in firsts for second in seconds]
        better = min(around, key=at)
        if at(better) >= at(best):
            step /= 2
        else:
            best = better
    return 10.0 ** best[0], 10.0 ** best[1]
