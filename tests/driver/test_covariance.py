"""The covariance of pose and twist: against closed forms, and against the errors of drawn robots in the emulator."""

import math
import random
from types import SimpleNamespace

import numpy as np
import pytest

from mrl_driver.geometry import ORIGIN, Pose, advance, wrap_angle
from mrl_driver.robot.covariance import (
    AT_START,
    LARGEST_VARIANCE,
    SIDEWAYS_M2_S2,
    Uncertainty,
    WheelUncertainty,
    is_covariance,
)
from mrl_driver.robot.heading import HeadingFilter
from mrl_driver.robot.kinematics import kinematics_of
from mrl_driver.robot.models import ImuMount, Noise, load
from mrl_driver.robot.robot_state import odometry_of
from sim_arduino.hardware.imu import LONGEST_STEP_S, ImuErrors, InertialSensor
from sim_arduino.hardware.robot_physics import Errors, RobotPhysics, params_for
from tests.conftest import EXPLORE
from tests.consistency import error_squared
from tests.models import four_wheels

NOTHING = (0.0,) * 6
STEPS, STEP_M, STEP_S = 200, 0.005, 0.02
BIAS_VARIANCE = 1e-6
XX, YY, YT, TT = 0, 3, 4, 5
UPPER = (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)


def sure(**noise):
    """The covariance of a robot with these errors alone."""
    model = load("traxbot")._replace(noise=Noise(0.0, 0.0, **noise), imu=ImuMount(gyro_scale_sd=0.0))
    return Uncertainty(model, NOTHING)


def drive(made, pose=ORIGIN, steps=STEPS, step_m=STEP_M, turn_rad=0.0, gyro=None):
    """The pose after equal steps."""
    half_m = turn_rad * load("traxbot").drive.wheel_separation_m / 2
    for _ in range(steps):
        after = advance(pose, step_m, turn_rad)
        made.update(pose, after, (step_m + half_m, step_m - half_m), turn_rad, STEP_S, gyro)
        pose = after
    return pose


def gyro(bias_variance=BIAS_VARIANCE, noise_rad2_s=0.0):
    """A gyro with nothing but an unknown bias, unless there is noise."""
    return SimpleNamespace(kept=1.0, bias_variance=bias_variance, noise_rad2_s=noise_rad2_s, unseen_rad2=0.0)


@pytest.mark.parametrize(
    "noise, way, spread",
    [
        ({"distance_scale_sd": 0.01}, {}, (0.64e-4, 0.48e-4, 0.0, 0.36e-4, 0.0, 0.0)),
        ({"turn_scale_sd": 0.1}, {"step_m": 0.0, "turn_rad": 0.01}, (*NOTHING[1:], (0.1 * 2.0) ** 2)),
    ],
    ids=["distance", "turns"],
)
def test_a_scale_grows_with_the_way_and_cancels_on_the_way_back(noise, way, spread):
    made, way = sure(**noise), {"step_m": STEP_M, **way}
    pose = drive(made, Pose(0.0, 0.0, math.atan2(0.6, 0.8)), **way)
    assert made.spread == pytest.approx(spread, abs=1e-12)
    drive(made, pose, **{name: -each for name, each in way.items()})
    assert made.spread == pytest.approx(NOTHING, abs=1e-12)


WHEEL_M2_PER_M, TURN_RAD2_PER_RAD, NOISE_RAD2_S = 2e-4, 3e-3, 4e-6
SCALE_SD, TURN_SD, RATIO_SD, GYRO_SD = 0.01, 0.1, 0.02, 0.005
MODELS = {
    **{each: load(each) for each in ("traxbot", "omni")},
    **{each: four_wheels(each) for each in ("mecanum", "skid")},
}
MADE = {**dict.fromkeys(MODELS, WheelUncertainty), "traxbot": Uncertainty}


def columns_of(model):
    """What a wheel's way makes of a step: forward, left and turn [m, m, rad] per metre, wheel by wheel."""
    kinematics = kinematics_of(model.base)
    return [kinematics.step(each) for each in np.eye(len(kinematics.rows)).tolist()]


def carried(covariance, pose, after, wheels_m, step, columns, with_gyro):
    """The covariance (4, 4) of x, y, yaw [m m rad] and the gyro's bias [rad/s] after a step, as F P F' + G Q G'."""
    dx, dy, middle_rad = after[0] - pose[0], after[1] - pose[1], pose[2] + step.turn / 2
    of_turn = np.array([-dy / 2, dx / 2, 1.0, 0.0])  # a turn shows in the way as half of it
    ahead = np.array([math.cos(middle_rad), math.sin(middle_rad), 0.0, 0.0])
    aside = np.array([-math.sin(middle_rad), math.cos(middle_rad), 0.0, 0.0])
    forward = np.eye(4)
    forward[:2, 2] = -dy, dx
    if with_gyro:
        forward[:, 3] -= STEP_S * of_turn
        sources = [(of_turn, NOISE_RAD2_S * STEP_S)]
    else:
        sources = [(of_turn, TURN_RAD2_PER_RAD * abs(step.turn))]
    for column, wheel_m in zip(columns, wheels_m):
        turn = of_turn * column.turn * (not with_gyro)
        sources.append((ahead * column.forward + aside * column.left + turn, WHEEL_M2_PER_M * abs(wheel_m)))
    noise = sum(variance * np.outer(column, column) for column, variance in sources)
    return forward @ covariance @ forward.T + noise


@pytest.mark.parametrize("name", sorted(MADE))
@pytest.mark.parametrize("turns_by", ["wheels", "gyro", "gyro, wheels, gyro"])
def test_random_errors_are_carried_as_matrices_carry_them(turns_by, name):
    draw, model = random.Random(turns_by), MODELS[name]
    root = np.array([[draw.uniform(-1, 1) for _ in range(3)] for _ in range(3)])
    expected = np.diag([0.0, 0.0, 0.0, BIAS_VARIANCE])
    expected[:3, :3] = 1e-3 * root @ root.T
    start = tuple(expected[i, j] for i, j in UPPER)
    model = model._replace(noise=Noise(WHEEL_M2_PER_M, TURN_RAD2_PER_RAD), imu=ImuMount(gyro_scale_sd=0.0))
    made, columns = MADE[name](model, start), columns_of(model)
    pose = Pose(0.3, -0.2, 2.0)
    for at in range(6):
        with_gyro = turns_by == "gyro" or (turns_by != "wheels" and at not in (2, 3))
        wheels_m = [draw.uniform(-0.05, 0.08) for _ in columns]
        step = kinematics_of(model.base).step(wheels_m)
        after = advance(pose, step.forward, step.turn, step.left)
        known = gyro(noise_rad2_s=NOISE_RAD2_S) if with_gyro else None
        made.update(pose, after, wheels_m, step.turn, STEP_S, known)
        expected = carried(expected, pose, after, wheels_m, step, columns, with_gyro)
        assert made.spread == pytest.approx(tuple(expected[i, j] for i, j in UPPER), rel=1e-9), at
        pose = after


def speeds_of(model, wheels_m, turn_rad, clock_sd_s, chip):
    """Variances of the linear, the angular and the lateral speed of a step [m2/s2, rad2/s2, m2/s2].

    The wheels of a differential drive have the same way, so that half the variance of their ratio is that of each.
    The side of a base with four is the mean of two.
    """
    columns, moved = columns_of(model), kinematics_of(model.base).step(wheels_m)
    rounding_m2 = model.base.metres_per_count**2 / 6
    found = []
    for axis, way in enumerate((moved.forward, moved.left, turn_rad)):
        wheels = [(column[axis] ** 2, wheel_m) for column, wheel_m in zip(columns, wheels_m)]
        variance = sum(share * (rounding_m2 + WHEEL_M2_PER_M * abs(wheel_m)) for share, wheel_m in wheels)
        scale = TURN_SD if axis == 2 else SCALE_SD
        variance += way**2 * (scale**2 + (clock_sd_s / STEP_S) ** 2)
        if axis == 2:
            variance += TURN_RAD2_PER_RAD * abs(turn_rad)
            variance += (
                RATIO_SD**2 / 2 * (len(wheels) // 2) * sum(share * wheel_m**2 for share, wheel_m in wheels)
            )
        found.append(variance / STEP_S**2)
    linear, lateral, angular = found
    if chip is not None:
        angular = chip.noise_rad2_s / STEP_S + chip.bias_variance + (GYRO_SD * turn_rad / STEP_S) ** 2
    return linear, angular, lateral if kinematics_of(model.base).sideways else SIDEWAYS_M2_S2


@pytest.mark.parametrize("moves", [True, False], ids=["moves", "stands"])
@pytest.mark.parametrize("with_gyro", [True, False], ids=["gyro", "wheels"])
@pytest.mark.parametrize(
    "exact_time, clock_sd_s", [(True, 5e-5), (False, 2e-3)], ids=["board's time", "arrival"]
)
@pytest.mark.parametrize(
    "name, wheels_m",
    [
        *(("traxbot", (0.02, 0.02)), ("omni", (0.02, -0.01, 0.03))),
        *((each, (0.02, -0.01, 0.03, 0.05)) for each in ("mecanum", "skid")),
    ],
)
def test_variances_of_the_twist_approach_those_of_a_step_by_a_fifth(
    name, wheels_m, exact_time, clock_sd_s, with_gyro, moves
):
    noise = Noise(WHEEL_M2_PER_M, TURN_RAD2_PER_RAD, SCALE_SD, RATIO_SD, TURN_SD)
    model = MODELS[name]._replace(noise=noise, imu=ImuMount(gyro_scale_sd=GYRO_SD))
    chip = gyro(noise_rad2_s=NOISE_RAD2_S) if with_gyro else None
    wheels_m = [wheel_m * moves for wheel_m in wheels_m]
    turn_rad = 0.03 * moves if name == "traxbot" else kinematics_of(model.base).step(wheels_m).turn
    made = MADE[name](model, exact_time=exact_time)
    for _ in range(2):
        if moves:
            made.update(ORIGIN, Pose(0.01, 0.0, turn_rad), wheels_m, turn_rad, STEP_S, chip)
        else:
            made.stand(STEP_S, chip)
    found = speeds_of(model, wheels_m, turn_rad, clock_sd_s, chip)
    before = (0.0, 0.0, SIDEWAYS_M2_S2)
    expected = [old + (1 - 0.8**2) * (new - old) for old, new in zip(before, found)]
    assert made.variances == pytest.approx(expected, rel=1e-9)


def test_a_pose_that_is_set_has_its_covariance_but_at_least_the_starts():
    made = Uncertainty(load("traxbot"))
    drive(made)
    made.reset((4e-6, 1e-6, 2e-7, 9e-6, 3e-7, 5e-6))
    assert made.spread == (4e-6, 1e-6, 2e-7, 9e-6, 3e-7, 5e-6)
    made.reset(NOTHING)
    assert made.spread == AT_START
    drive(made, step_m=0.0, steps=1)
    assert made.spread == pytest.approx(AT_START), "the way before it has no effect any more"


def test_a_way_that_was_lost_widens_position_and_yaw():
    """Evenly spread over 0.3 m and 0.6 rad to either side; a way of 1 m goes on from there."""
    made = sure()
    made.widen(0.3, 0.6)
    assert made.spread == pytest.approx((0.03, 0.0, 0.0, 0.03, 0.0, 0.12))
    drive(made)
    assert made.spread == pytest.approx((0.03, 0.0, 0.0, 0.15, 0.12, 0.12))


GOOD = (1.0, 0.5, 0.5, 1.0, 0.5, 1.0)


@pytest.mark.parametrize(
    "good, changed",
    [
        *((True, {at: LARGEST_VARIANCE}) for at in (XX, YY, TT)),
        *((False, {at: 1.001 * LARGEST_VARIANCE}) for at in (XX, YY, TT)),
        *((False, {at: -1e-9}) for at in (XX, YY, TT)),
        (True, {1: 1.0}),  # errors that depend on each other completely
        (True, dict.fromkeys(range(6), 0.0)),
        *((False, {**dict.fromkeys(range(6), 0.0), at: -1e-9}) for at in (XX, YY, TT)),
    ],
)
def test_a_covariance_has_variances_and_correlations_that_can_be(good, changed):
    assert is_covariance(tuple(changed.get(at, value) for at, value in enumerate(GOOD))) == good


@pytest.mark.parametrize(
    "variances", [(1.0, 0.5, 0.01), (1.0, 0.5, -0.01), (1.0, -0.03, -0.01), (1.0, 1.0, -0.9)]
)
def test_no_direction_has_a_negative_variance(variances):
    """In drawn directions."""
    draw = np.random.RandomState(1)
    for _ in range(100):
        directions = np.linalg.qr(draw.normal(size=(3, 3)))[0]
        spread = tuple((directions * variances @ directions.T)[np.triu_indices(3)])
        assert is_covariance(spread) == (min(variances) > 0)


def test_wrong_turns_of_tracks_move_the_end_on_an_arc():
    """As the ends of two ways whose turns are wrong by sqrt(3) standard deviations, each with a weight of a sixth."""
    sd, made = 0.1, sure(turn_scale_sd=0.1)

    def end_of(scale, made=None):
        pose = ORIGIN
        for turn_rad in (0.02,) * 400 + (0.0,) * 100:
            after = advance(pose, STEP_M, turn_rad * scale)
            if made is not None:
                made.update(pose, after, (STEP_M, STEP_M), turn_rad, STEP_S)
            pose = after
        return pose

    end = end_of(1.0, made)
    others = [end_of(1 + side * math.sqrt(3) * sd) for side in (-1, 1)]
    away = [[a - b for a, b in zip(other, end)] for other in others]
    expected = [sum(each[i] * each[j] for each in away) / 6 for i in range(3) for j in range(i, 3)]
    assert made.spread == pytest.approx(expected, rel=0.02, abs=0.01)


def test_unequal_wheels_bend_a_straight_way():
    made = sure(wheel_ratio_sd=0.01)
    drive(made)
    bend = 0.01 / load("traxbot").drive.wheel_separation_m
    assert made.spread[TT] == pytest.approx(bend**2)
    assert made.spread[YY] == pytest.approx((bend / 2) ** 2)
    assert made.spread[YT] == pytest.approx(bend**2 / 2)


def test_bias_turns_the_yaw_with_the_time_and_moves_the_end_with_its_square():
    """The yaw is off by what the bias has made of it, over the whole way that the wheels alone continue."""
    seconds, made, before = STEPS * STEP_S, sure(), sure(turn_scale_sd=0.1, wheel_ratio_sd=0.01)
    drive(made, gyro=gyro())
    assert made.spread[TT] == pytest.approx(BIAS_VARIANCE * seconds**2)
    assert made.spread[YY] == pytest.approx(BIAS_VARIANCE * (seconds / 2) ** 2, rel=1e-3)  # over a way of 1 m
    assert made.spread[YT] == pytest.approx(BIAS_VARIANCE * seconds**2 / 2, rel=1e-3)
    made = sure()
    drive(made, drive(made, step_m=0.0, gyro=gyro()))
    assert made.spread[YY] == pytest.approx(BIAS_VARIANCE * seconds**2, rel=1e-3)
    drive(before, turn_rad=0.01, gyro=gyro(bias_variance=0.0))
    assert before.spread == pytest.approx(NOTHING, abs=1e-15), (
        "the errors of the wheels' turn are not the gyro's"
    )


def test_scales_of_omni_wheels_err_as_the_way_of_larger_wheels():
    """And that of the distance as a larger way.

    Each wheel's effect is the change of the pose at the end of an arc of 100 steps, per change of the wheel.
    """
    sd, small, wheels_m = 0.01, 1e-6, (0.002, 0.006, -0.004)
    omni = load("omni")
    kinematics = kinematics_of(omni.base)

    def arc(made=None, scales=(1.0, 1.0, 1.0)):
        pose = ORIGIN
        for _ in range(100):
            scaled_m = [wheel_m * scale for wheel_m, scale in zip(wheels_m, scales)]
            step = kinematics.step(scaled_m)
            after = advance(pose, step.forward, step.turn, step.left)
            if made is not None:
                made.update(pose, after, scaled_m, step.turn, STEP_S)
            pose = after
        return pose

    noise = Noise(0.0, 0.0, distance_scale_sd=sd, wheel_ratio_sd=sd)
    made = WheelUncertainty(omni._replace(noise=noise), NOTHING)
    end = arc(made)
    ends = [arc(scales=[1.0 + small * (at == each) for at in range(3)]) for each in range(3)]
    effects = [[(a - b) / small for a, b in zip(other, end)] for other in ends]
    weighted = [(sd**2, (end.x_m, end.y_m, 0.0)), *((sd**2 / 2, effect) for effect in effects)]
    expected = [sum(weight * e[i] * e[j] for weight, e in weighted) for i, j in UPPER]
    assert abs(end.yaw_rad) > 0.5
    assert made.spread == pytest.approx(expected, rel=2e-3)


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


DRAWN = [("traxbot", False, 0.1), ("stingbot", True, None), ("traxbot", True, 0.1), ("traxbot", False, None)]


@pytest.mark.parametrize("name, gyro, slip", DRAWN if EXPLORE else DRAWN[:2])
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
