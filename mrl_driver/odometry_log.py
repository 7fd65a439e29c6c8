"""Odometry over whole recordings with NumPy; agrees with `odometry.Odometry` to 1e-9."""

from typing import NamedTuple, Tuple

import numpy as np

from .odometry import QUANTUM_COUNTS, Baseline, Geometry

_SLACK_S = {True: 0.002, False: 0.1}


class Track(NamedTuple):
    """The result for N readings.

    `poses` (N, 3), columns x y yaw [m m rad], yaw in (-pi, pi]; a refused reading repeats the pose before it.
    `used` (N,) bool: readings that were integrated; the first one primes and is not.
    """

    poses: np.ndarray
    used: np.ndarray


def integrate(
    counts: np.ndarray, times_s: np.ndarray, drive: Geometry, fastest_m_s: float, exact_time: bool = True
) -> Track:
    """Poses of a recording, from (0, 0, 0).

    Args:
        counts: (N, 2) int16 counters, columns right left [count].
        times_s: (N,) time of each reading [s].

    Raises:
        ValueError: the shapes do not match.
    """
    counts, times_s = np.asarray(counts), np.asarray(times_s, dtype=float)
    if counts.shape != (len(times_s), 2):
        raise ValueError(f"counts have shape {counts.shape}, expected ({len(times_s)}, 2)")
    steps = np.zeros(counts.shape)
    if len(counts):
        moved: np.ndarray = np.diff(counts.astype(np.int32), axis=0) + 0x8000
        steps[1:] = np.bitwise_and(moved, 0xFFFF) - 0x8000
    used = _plausible(steps, times_s, drive.metres_per_count, fastest_m_s, exact_time)
    if not used[1:].all():
        steps, used = _judge(counts, times_s, drive.metres_per_count, fastest_m_s, exact_time)
    return Track(_arcs(steps, drive), used)


def _plausible(
    steps: np.ndarray, times_s: np.ndarray, metres_per_count: float, fastest_m_s: float, exact_time: bool
) -> np.ndarray:
    """(N,) bool: step is one that wheels can make; the first row primes."""
    rate = fastest_m_s / metres_per_count
    reach = rate * np.diff(times_s, prepend=times_s[:1])
    bound = np.clip(reach, 0, 0x7FFF) + QUANTUM_COUNTS + rate * _SLACK_S[exact_time]
    good = (np.abs(steps[:, 0]) <= bound) & (np.abs(steps[:, 1]) <= bound) & (reach < 0x8000)
    good[:1] = False
    return good


def _judge(
    counts: np.ndarray, times_s: np.ndarray, metres_per_count: float, fastest_m_s: float, exact_time: bool
) -> Tuple[np.ndarray, np.ndarray]:
    """Steps and use flags of a recording with readings to refuse, one by one."""
    baseline = Baseline(metres_per_count, fastest_m_s, _SLACK_S[exact_time])
    steps, used = np.zeros(counts.shape), np.zeros(len(counts), dtype=bool)
    for i, ((right, left), time_s) in enumerate(zip(counts.tolist(), times_s.tolist())):
        step = baseline.update(right, left, time_s)
        if step is not None:
            steps[i] = step[:2]
            used[i] = True
    return steps, used


def _arcs(steps: np.ndarray, drive: Geometry) -> np.ndarray:
    """(N, 3) poses from (N, 2) steps [count]."""
    metres = steps * drive.metres_per_count
    distance, turn = metres.sum(axis=1) / 2, (metres[:, 0] - metres[:, 1]) / drive.wheel_separation_m
    yaw = np.cumsum(turn)
    chord = distance * np.sinc(turn / (2 * np.pi))
    heading = yaw - turn / 2
    wrapped = np.pi - np.remainder(np.pi - yaw, 2 * np.pi)
    return np.column_stack((np.cumsum(chord * np.cos(heading)), np.cumsum(chord * np.sin(heading)), wrapped))
