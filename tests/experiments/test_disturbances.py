"""Errors of the experiments' robots: the same for the same seed, and as large as they are said to be."""

import math
import random
from statistics import pstdev

import pytest

from mrl_driver.geometry import ORIGIN, Pose
from sim_arduino.experiments import disturbances
from sim_arduino.faults.key_values import robot_errors

SEEDS = range(200)


def ratio(seed, name=""):
    errors = robot_errors(disturbances.error(seed, name))
    return errors.right_scale / errors.left_scale


def test_a_robot_is_known_by_its_seed_and_name():
    assert disturbances.error(3, "robot1") == disturbances.error(3, "robot1")
    assert len({disturbances.error(seed, name) for seed in (3, 4) for name in ("robot1", "robot2")}) == 4


def test_errors_spread_as_stated():
    assert pstdev(map(ratio, SEEDS)) == pytest.approx(disturbances.WHEEL_RATIO_SD, rel=0.15)
    slips = [robot_errors(disturbances.error(seed)).turn_slip for seed in SEEDS]
    assert 0 <= min(slips) < 0.001 and 0.019 < max(slips) <= disturbances.MAX_SLIP
    found = [disturbances.placed(Pose(2.0, 1.0, math.pi), seed) for seed in SEEDS]
    assert pstdev(pose.x_m for pose in found) == pytest.approx(disturbances.PLACED_M, rel=0.15)
    assert all(abs(pose.y_m - 1.0) < 0.03 and abs(pose.yaw_rad) > 3.0 for pose in found)
    rng = random.Random(1)
    assert pstdev(disturbances.measured(ORIGIN, rng).x_m for _ in SEEDS) == pytest.approx(0.002, rel=0.15)


def test_given_errors_are_not_drawn():
    errors = robot_errors(disturbances.error(1, slip=0.05, wheel_ratio=1.0, wheel_size=1.01))
    assert (errors.turn_slip, errors.left_scale, errors.right_scale) == (0.05, 1.01, 1.01)
