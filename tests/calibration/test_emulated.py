"""Odometry and its uncertainty against the emulator's body, which knows no odometry."""

import math

import numpy as np
import pytest

from mrl_driver.calibration import fit
from mrl_driver.calibration.trial import Trial, path
from mrl_driver.geometry import Pose
from mrl_driver.robot.covariance import error_squared
from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import Odometry
from mrl_driver.robot.robot_state import fastest_m_s, odometry_of
from sim_arduino.hardware.robot_physics import Errors, RobotPhysics, params_for

TRAXBOT = load("traxbot")
PERIOD_S = 0.05
WHOLE_M, UNROUNDED_M = 1e-3, 2e-4
BOUNDS = (2.54, 3.50)
"""95 % of the means of 100 normalised errors squared with 3 degrees of freedom: chi2 of 300, over 100."""
SQUARE, ZIGZAG = (
    ((0.2, 0.0, 5.0), (0.0, 0.8, 1.96)) * 4,
    ((0.2, 0.3, 3.0), (0.0, -0.8, 1.5), (0.2, -0.2, 3.0)),
)
"""Speeds [m/s, rad/s], each for so long [s]."""
SMALL = ((0.2, 0.0, 2.5), (0.0, 0.8, 1.96)) * 4
BACK = tuple((0.2 if v else 0.0, -w, t) for v, w, t in SMALL)


def driven(robot, moves):
    """Way of both wheels (N, 2) [count, not rounded], right left, and true poses (N, 3), 20 times a second."""
    rows, axle_m = [], TRAXBOT.drive.wheel_separation_m

    def look():
        rows.append((robot.motors[2].travel, robot.motors[0].travel, *robot_pose(robot)))

    look()
    for linear, angular, seconds in (*moves, (0.0, 0.0, 1.0)):
        for motor, speed in ((0, linear - angular * axle_m / 2), (2, linear + angular * axle_m / 2)):
            robot.motors[motor].set_speed(speed / TRAXBOT.drive.metres_per_count)
        for _ in range(round(seconds / PERIOD_S)):
            robot.step(PERIOD_S)
            look()
    table = np.array(rows)
    return table[:, :2], table[:, 2:]


def robot_pose(robot):
    return robot.state.x_m, robot.state.y_m, robot.state.yaw_rad


def quick(seed=0, **wrong):
    robot = RobotPhysics(params_for(TRAXBOT, Errors(**wrong)), seed=seed)
    robot.gains.ramp_ms = 500
    return robot


def test_ten_laps_of_a_square_stay_within_a_millimetre_of_the_true_path():
    """Exact arcs at 20 Hz, counters that wrap at 16 bits; without the rounding of the counts a fifth of that."""
    ways, true = driven(quick(), SQUARE * 10)
    unrounded = path(TRAXBOT.drive, np.diff(ways, axis=0))
    assert np.hypot(*(unrounded - true)[:, :2].T).max() < UNROUNDED_M
    counts = (np.floor(ways).astype(np.int64) + 30000 + 0x8000 & 0xFFFF) - 0x8000
    assert np.ptp(counts[:, 0]) > 60000
    odometry, worst_m = Odometry(TRAXBOT.drive, fastest_m_s(TRAXBOT)), 0.0
    for i, (right, left) in enumerate(counts.tolist()):
        odometry.update(right, left, i * PERIOD_S)
        worst_m = max(worst_m, math.dist(odometry.pose[:2], true[i, :2]))
    assert worst_m < WHOLE_M


def run_of(robot, moves):
    begin = Pose(*robot_pose(robot))
    ways, true = driven(robot, moves)
    return Trial(np.diff(np.floor(ways), axis=0), Pose(*true[-1]).relative_to(begin))


@pytest.fixture(scope="module")
def calibrated():
    """A robot with slip and noise as its own calibration found it: 12 runs each of a line, turns and squares."""
    robot = quick(1, turn_slip=0.08, wheel_noise=2e-5, turn_noise=2e-4)
    kinds = ((0.2, 0.0, 5.0),), ((0.0, 0.8, 4.0),), ((0.0, -0.8, 4.0),), SMALL, BACK
    runs = [run_of(robot, moves) for moves in kinds for _ in range(12)]
    fitted = fit.fit(runs, TRAXBOT.drive, (fit.OFFSET, fit.SLIP), TRAXBOT.noise, fit.BY_TRUTH)
    noise = fit.estimate_noise(runs, fitted, 2, fit.BY_TRUTH)
    return TRAXBOT._replace(drive=fitted.drive, noise=noise)


def test_errors_of_a_hundred_drives_agree_with_the_uncertainty_of_a_calibrated_robot(calibrated):
    """Monte Carlo: normalised estimation error squared, the coefficients being those that calibration found."""
    squared = []
    for seed in range(100):
        robot = quick(100 + seed, turn_slip=0.08, wheel_noise=2e-5, turn_noise=2e-4)
        ways, true = driven(robot, ZIGZAG)
        odometry = odometry_of(calibrated, exact_time=True)
        for i, (right, left) in enumerate(np.floor(ways).astype(int).tolist()):
            odometry.update(right, left, i * PERIOD_S)
        off = np.subtract(true[-1], odometry.pose)
        off[2] = math.remainder(off[2], math.tau)
        squared.append(error_squared(odometry.uncertainty.spread, *off))
    assert BOUNDS[0] < np.mean(squared) < BOUNDS[1]
