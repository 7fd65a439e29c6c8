"""Odometry over whole recordings with NumPy; agrees with `odometry.Odometry` to 1e-9."""

from typing import NamedTuple, Tuple

import numpy as np

from mrl_driver.robot.odometry import NEAR_S, QUANTUM_COUNTS, SLACK_S, Baseline, Geometry


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
    steps = _steps(counts)
    used = _plausible(steps, times_s, drive.metres_per_count, fastest_m_s, exact_time)
    if not used[1:].all():
        steps, used = _judge(counts, times_s, drive.metres_per_count, fastest_m_s, exact_time)
    return Track(_arcs(steps, drive), used)


def _steps(counts: np.ndarray) -> np.ndarray:
    """(2, N) movement since the row before, rows right left [count]; int16 differences wrap as the counters do."""
    steps = np.zeros((2, len(counts)))
    for row, column in zip(steps, counts.astype(np.int16).T):
        np.subtract(column[1:], column[:-1], out=row[1:], casting="unsafe", dtype=np.int16)
    return steps


def _plausible(
    steps: np.ndarray, times_s: np.ndarray, metres_per_count: float, fastest_m_s: float, exact_time: bool
) -> np.ndarray:
    """(N,) bool: step is one that wheels can make; the first row primes."""
    rate = fastest_m_s / metres_per_count
    reach = rate * np.diff(times_s, prepend=times_s[:1])
    bound = np.maximum(reach, 0 if exact_time else rate * NEAR_S)
    bound += QUANTUM_COUNTS + (rate * SLACK_S[True] if exact_time else 0.0)
    good = reach < 0x8000
    for row in steps:
        good &= np.abs(row) <= bound
    good[:1] = False
    return good


def _judge(
    counts: np.ndarray, times_s: np.ndarray, metres_per_count: float, fastest_m_s: float, exact_time: bool
) -> Tuple[np.ndarray, np.ndarray]:
    """Steps and use flags of a recording with readings to refuse, one by one."""
    baseline = Baseline(metres_per_count, fastest_m_s, SLACK_S[exact_time])
    steps, used = np.zeros((2, len(counts))), np.zeros(len(counts), dtype=bool)
    for i, ((right, left), time_s) in enumerate(zip(counts.tolist(), times_s.tolist())):
        step = baseline.update(right, left, time_s)
        if step is not None:
            steps[:, i] = step[:-1]
            used[i] = True
    return steps, used


def _arcs(steps: np.ndarray, drive: Geometry) -> np.ndarray:
    """(N, 3) poses from (2, N) steps [count]."""
    right_m, left_m = steps[0] * (drive.right_m_per_count / 2), steps[1] * (drive.left_m_per_count / 2)
    distance, half_turn = right_m + left_m, (right_m - left_m) / drive.turning_separation_m
    yaw = np.cumsum(2 * half_turn)
    chord = distance * _sinc(half_turn)
    heading = yaw - half_turn
    poses = np.empty((len(yaw), 3))
    np.cumsum(chord * np.cos(heading), out=poses[:, 0])
    np.cumsum(chord * np.sin(heading), out=poses[:, 1])
    poses[:, 2] = yaw + 2 * np.pi * np.floor((np.pi - yaw) / (2 * np.pi))
    return poses


def _sinc(angle_rad: np.ndarray) -> np.ndarray:
    """sin(x) / x; the series where it is exact to 1e-16 anyway, which is everywhere at usual frame rates."""
    square = angle_rad * angle_rad
    if square.size and square.max() > 1e-4:
        return np.sinc(angle_rad / np.pi)
    return 1 - square / 6 * (1 - square / 20)
