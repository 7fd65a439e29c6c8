"""Drives without a robot: counts of a path that the odometry believes in, and where a true drive ends with them."""

import math

import numpy as np

from mrl_driver.apps.calibration.trial import Trial, path
from mrl_driver.geometry import Pose

STEP_M, STEP_RAD = 0.01, 0.04


def straight(distance_m):
    return [(STEP_M * math.copysign(1, distance_m), 0.0)] * round(abs(distance_m) / STEP_M)


def turn(angle_rad):
    pieces = max(1, round(abs(angle_rad) / STEP_RAD))
    return [(0.0, angle_rad / pieces)] * pieces


def square(side_m=1.0, left=True, laps=1):
    corner = math.pi / 2 if left else -math.pi / 2
    return (straight(side_m) + turn(corner)) * 4 * laps


def counts(moves, believed, whole=True):
    """(N, 2) counts, right left, that the believed drive takes for these (way, turn)."""
    way, angle = np.array(moves).T
    half = angle * believed.turning_separation_m / 2
    ways = np.stack(
        ((way + half) / believed.right_m_per_count, (way - half) / believed.left_m_per_count), axis=1
    )
    sums = np.cumsum(ways, axis=0)
    return np.diff(np.rint(sums) if whole else sums, axis=0, prepend=np.zeros((1, 2)))


def end(steps, true, noise=None, rng=None):
    """Where these counts really lead."""
    if noise is None:
        return Pose(*path(true, steps)[-1])
    metres = np.array([true.right_m_per_count, true.left_m_per_count])
    ways = steps * metres
    ways = ways + rng.normal(size=ways.shape) * np.sqrt(noise.wheel_m2_per_m * np.abs(ways))
    forward, angle = ways.mean(axis=1), (ways[:, 0] - ways[:, 1]) / true.turning_separation_m
    angle = angle + rng.normal(size=len(angle)) * np.sqrt(noise.turn_rad2_per_rad * np.abs(angle))
    yaw = np.cumsum(angle)
    heading, chord = yaw - angle / 2, forward * np.sinc(angle / 2 / np.pi)
    return Pose(float(chord @ np.cos(heading)), float(chord @ np.sin(heading)), float(yaw[-1]))


def driven(moves, believed, true, noise=None, rng=None):
    steps = counts(moves, believed)
    return Trial(steps, end(steps, true, noise, rng))
