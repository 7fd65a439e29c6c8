"""The covariance of pose and twist describes their errors, on drawn robots that drive in the emulator's physics.

Each robot has wheels of its own, drawn from the model's `noise`, and a gyro with bias, scale error and noise.
"""

import math
import random

import pytest

from mrl_driver.geometry import wrap_angle
from mrl_driver.robot.covariance import error_squared
from mrl_driver.robot.heading import HeadingFilter
from mrl_driver.robot.models import load
from mrl_driver.robot.robot_state import odometry_of
from sim_arduino.hardware.imu import LONGEST_STEP_S, ImuErrors, InertialSensor
from sim_arduino.hardware.robot_physics import Errors, RobotPhysics, params_for

PERIOD_S = 0.02
ROBOTS = 16
BOUNDS = (1.38, 5.44)
"""99.9 % of the means of 16 normalised errors squared with 3 degrees of freedom: chi squared of 48, over 16."""
TWIST_BOUNDS = (0.2, 2.0)
"""Means of one degree of freedom; errors by the wheels' scale are the same in all frames of a robot."""
CHIP_DELAY_S = 4.8e-3  # Delay of the gyro's filter as the board sets it up
WINDING = ((0.2, 0.0, 3.0), (0.0, 0.8, 2.0), (0.2, 0.0, 2.0), (0.0, -0.8, 4.0), (0.2, 0.4, 3.0))
"""Speeds [m/s, rad/s], each for so long [s]."""


class Drawn:
    """One robot, and its odometry with or without a gyro."""

    def __init__(self, name, seed, gyro, slip):
        self.model, self.rng = load(name), random.Random(f"{name} {seed}")
        noise = self.model.noise
        size, ratio = 1 + self.rng.gauss(0, noise.distance_scale_sd), self.rng.gauss(0, noise.wheel_ratio_sd)
        turns = 1 - slip if slip is not None else 1 + self.rng.gauss(0, noise.turn_scale_sd)
        errors = Errors(
            size * (1 - ratio / 2), size * (1 + ratio / 2), size / turns,
            wheel_noise=noise.wheel_m2_per_m, turn_noise=noise.turn_rad2_per_rad,
        )  # fmt: skip
        self.body = RobotPhysics(params_for(self.model, errors), seed=seed)
        self.body.gains.ramp_ms = 500
        self.odometry, self.time_s = odometry_of(self.model, exact_time=True), 0.0
        if gyro:
            self.odometry.heading = HeadingFilter()
            self.sensor = InertialSensor(self.model.imu, ImuErrors.drawn(seed), seed)
            self.sensor.start(LONGEST_STEP_S, CHIP_DELAY_S)
            self.body.report_motion(self.sensor.moved, LONGEST_STEP_S)
        self.twists = []

    def drive(self, moves):
        axle_m, per_count = self.model.drive.wheel_separation_m, self.model.drive.metres_per_count
        for linear, angular, seconds in ((0.0, 0.0, 1.0), *moves, (0.0, 0.0, 1.0)):
            for motor, speed in ((0, linear - angular * axle_m / 2), (2, linear + angular * axle_m / 2)):
                self.body.motors[motor].set_speed(speed / per_count)
            for _ in range(round(seconds / PERIOD_S)):
                self.step()

    def step(self):
        state = self.body.state
        before = state.x_m, state.y_m, state.yaw_rad
        self.body.step(PERIOD_S)
        self.time_s += PERIOD_S
        right, left = (math.floor(self.body.motors[motor].travel) for motor in (2, 0))
        self.odometry.update(*((count + 0x8000 & 0xFFFF) - 0x8000 for count in (right, left)), self.time_s)
        turn = state.yaw_rad - before[2]
        if self.odometry.heading is not None:
            self.odometry.heading.on_imu(self.time_s, self.sensor.gyro_rad_s[2])
        heading = before[2] + turn / 2
        way_m = (state.x_m - before[0]) * math.cos(heading) + (state.y_m - before[1]) * math.sin(heading)
        twist, variances = self.odometry.twist, self.odometry.uncertainty.variances
        if twist[0] or twist[1]:
            pairs = zip(twist, (way_m / PERIOD_S, turn / PERIOD_S), variances)
            self.twists.append([(speed - true) ** 2 / variance for speed, true, variance in pairs])

    def error_squared(self):
        state, pose = self.body.state, self.odometry.pose
        yaw_rad = wrap_angle(state.yaw_rad - pose.yaw_rad)
        return error_squared(
            self.odometry.uncertainty.spread, state.x_m - pose.x_m, state.y_m - pose.y_m, yaw_rad
        )


@pytest.mark.parametrize(
    "name, gyro, slip",
    [
        ("traxbot", False, None),
        ("traxbot", False, 0.1),
        ("traxbot", True, 0.1),
        ("stingbot", False, None),
        ("stingbot", True, None),
    ],
)
def test_errors_of_drawn_robots_agree_with_the_covariance_of_pose_and_twist(name, gyro, slip):
    """The error of a gyro's rate in one frame is taken back in the next; the yaw shows whether the rest is right."""
    robots = [Drawn(name, seed, gyro, slip) for seed in range(ROBOTS)]
    for robot in robots:
        robot.drive(WINDING)
    assert BOUNDS[0] < sum(robot.error_squared() for robot in robots) / ROBOTS < BOUNDS[1]
    assert TWIST_BOUNDS[0] < of_speeds(robots, 0) < TWIST_BOUNDS[1]
    assert gyro or TWIST_BOUNDS[0] < of_speeds(robots, 1) < TWIST_BOUNDS[1]


def of_speeds(robots, axis):
    """Mean of the normalised errors squared of a speed, but for 1 % of the frames: those in which the motion begins."""
    squared = sorted(each[axis] for robot in robots for each in robot.twists)
    kept = squared[: round(0.99 * len(squared))]
    return sum(kept) / len(kept)
