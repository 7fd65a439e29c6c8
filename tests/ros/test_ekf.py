"""The parameters for robot_localization's EKF, and what a model of this filter makes of our odometry with them.

The order of the states is that of its documentation.
"""

import math

import pytest
import yaml

from mrl_driver.geometry import wrap_angle
from mrl_driver.robot.covariance import error_squared
from tests.driver.test_consistency import PERIOD_S, Drawn

from .planar_ekf import DEFAULT_NOISE, IN_3D, VYAW, YAW, PlanarEkf, X, Y
from .rig import ROOT

STATES = [
    "x",
    "y",
    "z",
    "roll",
    "pitch",
    "yaw",
    "vx",
    "vy",
    "vz",
    "vroll",
    "vpitch",
    "vyaw",
    "ax",
    "ay",
    "az",
]
VALUES = yaml.safe_load((ROOT / "ros1_bridge" / "navigation" / "ekf.yaml").read_text())
SQUARE = ((0.2, 0.0, 3.0), (0.0, 0.8, math.pi / 2 / 0.8)) * 4
"""Speeds [m/s, rad/s], each for this long [s]."""
ROBOTS = 5
MOST = 7.53
"""99.9 % of the means of 5 normalised errors squared are below it: chi squared of 15, over 5."""
UNSURE = 0.1
"""With a mean below this, the standard deviations are more than five times the errors."""
NEAR_M, NEAR_RAD = 0.005, 0.005
STILL_M2 = 1e-5
"""3 mm squared."""


def test_filter_takes_the_twist_of_the_odometry_alone():
    """The pose would count the same errors again, and no other sensor could correct it."""
    used = [state for state, taken in zip(STATES, VALUES["odom0_config"]) if taken]
    assert (VALUES["odom0"], used) == ("odom", ["vx", "vy", "vyaw"])


def test_process_noise_is_a_diagonal_matrix():
    size, noise = len(STATES), VALUES["process_noise_covariance"]
    assert len(noise) == size * size
    assert all((value > 0) == (at % (size + 1) == 0) for at, value in enumerate(noise))


def new_filter():
    """A filter with our parameters."""
    ours = VALUES["process_noise_covariance"][:: len(STATES) + 1]
    return PlanarEkf([ours[at] for at in IN_3D], VALUES["dynamic_process_noise_covariance"])


def test_filter_of_a_robot_that_stands_stays_sure():
    """For 10 s, with the variances of a TraxBot that stands."""
    made = new_filter()
    for _ in range(500):
        made.update(PERIOD_S, (0.0, 0.0, 0.0), (1e-6, 1e-6, 1e-5))
    assert made.spread[0] < STILL_M2


class Filtered(Drawn):
    """A robot whose odometry goes to two filters: one with our parameters, one with robot_localization's defaults."""

    def __init__(self, *robot):
        super().__init__(*robot)
        self.filter = new_filter()
        self.default = PlanarEkf(DEFAULT_NOISE, False)

    def step(self):
        super().step()
        linear, angular = self.odometry.twist
        of_linear, of_angular, of_lateral = self.odometry.uncertainty.variances
        for each in (self.filter, self.default):
            each.update(PERIOD_S, (linear, 0.0, angular), (of_linear, of_lateral, of_angular))

    def errors_squared(self):
        """Normalised errors squared of both filters."""
        true = self.body.state
        for each in (self.filter, self.default):
            x, y, yaw = each.state[[X, Y, YAW]]
            yield error_squared(each.spread, true.x_m - x, true.y_m - y, wrap_angle(true.yaw_rad - yaw))


@pytest.fixture(
    scope="module", params=[("traxbot", True, 0.1), ("stingbot", False, None)], ids=["gyro", "wheels"]
)
def robots(request):
    """Robots of one kind after a square."""
    made = [Filtered(request.param[0], seed, *request.param[1:]) for seed in range(ROBOTS)]
    for robot in made:
        robot.drive(SQUARE)
    return made


def test_filter_is_where_the_odometry_is(robots):
    """Nothing that the odometry measures is lost in the filter, at the beginning and the end of a turn either."""
    for robot in robots:
        pose, (x, y, yaw) = robot.odometry.pose, robot.filter.state[[X, Y, YAW]]
        assert (
            math.hypot(x - pose.x_m, y - pose.y_m) < NEAR_M and abs(wrap_angle(yaw - pose.yaw_rad)) < NEAR_RAD
        )
        assert abs(robot.filter.state[VYAW]) < NEAR_RAD


def test_filter_is_as_sure_as_its_errors_allow(robots):
    """Beside the defaults, which make it unsure of everything."""
    ours, defaults = (sum(each) / ROBOTS for each in zip(*(robot.errors_squared() for robot in robots)))
    assert UNSURE < ours < MOST and defaults < UNSURE, (ours, defaults)
