"""The parameters for robot_localization's EKF, and what a model of this filter makes of our odometry with them."""

import math

import pytest
import yaml

from mrl_driver.geometry import wrap_angle
from mrl_driver.robot.covariance import error_squared
from tests.driver.test_consistency import PERIOD_S, Drawn

from .planar_ekf import IN_3D, VYAW, YAW, PlanarEkf, X, Y
from .rig import ROOT

VALUES = yaml.safe_load((ROOT / "ros1_bridge" / "navigation" / "ekf.yaml").read_text())
SQUARE = ((0.2, 0.0, 3.0), (0.0, 0.8, math.pi / 2 / 0.8)) * 4  # Speeds [m/s, rad/s], each for this long [s]
ROBOTS = 5
LEAST, MOST = 0.1, 7.53
"""99.9 % of the means of 5 normalised errors squared are below the second: chi squared of 15, over 5.  Below the first,
the standard deviations are more than five times the errors."""
NEAR_M, NEAR_RAD = 0.005, 0.005


def test_filter_takes_the_twist_of_the_odometry_alone_with_a_diagonal_noise():
    """The pose would count the same errors again, and no other sensor could correct it."""
    used = [at for at, taken in enumerate(VALUES["odom0_config"]) if taken]
    assert (VALUES["odom0"], used) == ("odom", [6, 7, 11]), "vx, vy, vyaw"
    noise = VALUES["process_noise_covariance"]
    assert len(noise) == 15 * 15 and all((value > 0) == (at % 16 == 0) for at, value in enumerate(noise))


class Filtered(Drawn):
    """A robot whose odometry goes to a filter with our parameters."""

    def __init__(self, *robot):
        super().__init__(*robot)
        ours = VALUES["process_noise_covariance"][::16]
        self.filter = PlanarEkf([ours[at] for at in IN_3D], VALUES["dynamic_process_noise_covariance"])

    def step(self):
        super().step()
        linear, angular = self.odometry.twist
        of_linear, of_angular, of_lateral = self.odometry.uncertainty.variances
        self.filter.update(PERIOD_S, (linear, 0.0, angular), (of_linear, of_lateral, of_angular))


@pytest.mark.parametrize("robot", [("traxbot", True, 0.1), ("stingbot", False, None)], ids=["gyro", "wheels"])
def test_filter_is_where_the_odometry_is_and_as_sure_as_its_errors_allow(robot):
    """After a square.  Nothing that the odometry measures is lost, at the beginning and the end of a turn either."""
    errors = []
    for seed in range(ROBOTS):
        made = Filtered(robot[0], seed, *robot[1:])
        made.drive(SQUARE)
        pose, true, (x, y, yaw) = made.odometry.pose, made.body.state, made.filter.state[[X, Y, YAW]]
        assert math.hypot(x - pose.x_m, y - pose.y_m) < NEAR_M and abs(made.filter.state[VYAW]) < NEAR_RAD
        assert abs(wrap_angle(yaw - pose.yaw_rad)) < NEAR_RAD
        away = true.x_m - x, true.y_m - y, wrap_angle(true.yaw_rad - yaw)
        errors.append(error_squared(made.filter.spread, *away))
    assert LEAST < sum(errors) / ROBOTS < MOST, errors
