"""Pose, battery and temperature against closed forms; nothing here knows the driver's odometry."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.robot import models
from sim_arduino.hardware.motor import Mode, Motor
from sim_arduino.hardware.robot_physics import Errors, RobotPhysics, interpolate, params_for

EXACT_M, EXACT_RAD = 1e-9, 1e-9
TRAXBOT, STINGBOT = models.load("traxbot"), models.load("stingbot")


def cruising(left_m_s, right_m_s, model=TRAXBOT, **scales):
    """A robot whose wheels turn at steady speeds [m/s of the model's wheels], without any transient."""
    robot = RobotPhysics(params_for(model, Errors(**scales)))
    cruise(robot, left_m_s, right_m_s, model)
    robot.params = robot.params._replace(rest_curve=((0.0, 1.0), (1.0, 1.0)), resistance_ohm=0.0)
    robot.state.battery_v = 1.0
    return robot


def cruise(robot, left_m_s, right_m_s, model=TRAXBOT):
    """Gives the wheels steady speeds."""
    for index, speed in ((0, left_m_s), (2, right_m_s)):
        motor = robot.motors[index]
        motor.mode = Mode.DUTY
        motor.speed = speed / model.drive.metres_per_count
        motor.params = motor.params._replace(friction_counts_s=0.0)
        motor.duty = motor.speed / motor.params.no_load_counts_s * motor.params.nominal_v


def test_straight_line():
    robot = cruising(0.3, 0.3)
    robot.step(10.0)
    assert (robot.state.x_m, robot.state.y_m, robot.state.yaw_rad) == pytest.approx(
        (3.0, 0.0, 0.0), abs=EXACT_M
    )


def test_spin_stays_in_place():
    """w = 2 v / track."""
    robot = cruising(-0.1, 0.1)
    robot.step(3.0)
    assert robot.state.yaw_rad == pytest.approx(3.0 * 0.2 / 0.18, abs=EXACT_RAD)
    assert math.hypot(robot.state.x_m, robot.state.y_m) < EXACT_M


def test_circle_closes():
    """Radius v / w; after one turn the robot is where it began."""
    speed, rate = 0.3, 1.0
    half = 0.5 * 0.18 * rate
    robot = cruising(speed - half, speed + half)
    robot.step(2 * math.pi / rate)
    assert math.hypot(robot.state.x_m, robot.state.y_m) < 1e-8
    assert robot.state.yaw_rad == pytest.approx(2 * math.pi)


def test_half_a_circle_is_two_radii_away():
    robot = cruising(0.3 - 0.09, 0.3 + 0.09)
    robot.step(math.pi)
    assert (robot.state.x_m, robot.state.y_m) == pytest.approx((0.0, 0.6), abs=1e-8)


def test_a_wheel_that_stands_is_the_centre():
    robot = cruising(0.0, 0.18)
    robot.step(math.pi / 2)
    assert (robot.state.x_m, robot.state.y_m) == pytest.approx((0.09, 0.09), abs=1e-8)


def test_slip_takes_its_share_of_the_yaw():
    straight, slipping = cruising(-0.1, 0.1), cruising(-0.1, 0.1, turn_slip=0.1)
    for robot in (straight, slipping):
        robot.step(1.0)
    assert slipping.state.yaw_rad == pytest.approx(0.9 * straight.state.yaw_rad)


def test_slip_costs_nothing_straight_on():
    robot = cruising(0.3, 0.3, turn_slip=0.1)
    robot.step(1.0)
    assert robot.state.x_m == pytest.approx(0.3)


def test_unequal_wheels_turn_at_equal_counts():
    """1 % between the wheels: yaw is the difference of the ways over the track."""
    robot = cruising(0.3, 0.3, right_scale=1.01)
    robot.step(1.0)
    assert robot.state.yaw_rad == pytest.approx(0.003 / 0.18)


def test_a_longer_axle_turns_less():
    robot = cruising(-0.1, 0.1, axle_scale=1.25)
    robot.step(1.0)
    assert robot.state.yaw_rad == pytest.approx(0.2 / (0.18 * 1.25))


@settings(max_examples=30, deadline=None)
@given(pieces=st.lists(st.floats(1e-4, 0.07), min_size=5, max_size=60))
def test_pose_hardly_depends_on_the_steps(pieces):
    """Ramps and turns included: below 10 um over a few seconds."""
    one, many = RobotPhysics(params_for(TRAXBOT)), RobotPhysics(params_for(TRAXBOT))
    for robot in (one, many):
        robot.motors[0].set_speed(1500.0)
        robot.motors[2].set_speed(4000.0)
    one.step(math.fsum(pieces))
    for piece in pieces:
        many.step(piece)
    assert (many.state.x_m, many.state.y_m) == pytest.approx((one.state.x_m, one.state.y_m), abs=1e-5)
    assert many.state.yaw_rad == pytest.approx(one.state.yaw_rad, abs=1e-5)


# ---- battery and temperature


def hours_until(volts, linear_m_s):
    """Time until a full battery shows `volts` while the robot drives."""
    robot = RobotPhysics(params_for(TRAXBOT))
    for index in (0, 2):
        robot.motors[index].set_speed(linear_m_s / TRAXBOT.drive.metres_per_count)
    robot.step(10.0)
    no_load_v = interpolate(robot.params.rest_curve, robot.state.charge)
    current = (no_load_v - robot.state.battery_v) / robot.params.resistance_ohm
    drained = (
        1.0 - charge_at(robot, volts + current * robot.params.resistance_ohm)
    ) * robot.params.capacity_ah
    return drained / current


def charge_at(robot, rest_v):
    return interpolate(tuple((v, c) for c, v in robot.params.rest_curve), rest_v)


@pytest.mark.parametrize("linear_m_s, hours", [(0.05, 2.8), (0.2, 2.3)])
def test_battery_lasts_as_long_as_in_the_papers(linear_m_s, hours):
    """2 to 3 hours of circles until 9 V, shorter with speed."""
    assert hours_until(9.0, linear_m_s) == pytest.approx(hours, abs=0.1)


def test_battery_drains_at_rest():
    """idle current x time over capacity."""
    robot = RobotPhysics(params_for(TRAXBOT))
    robot.step(1800.0)
    assert robot.state.charge == pytest.approx(1.0 - 0.5 * robot.params.idle_a / 4.6, abs=1e-4)


def test_load_lowers_the_voltage():
    robot = RobotPhysics(params_for(TRAXBOT))
    rest = robot.state.battery_v
    for motor in robot.motors:
        motor.set_duty(1.0)
    robot.step(0.05)
    assert robot.state.battery_v < rest - 0.3


@pytest.mark.parametrize("volts", [13.8, 12.0, 9.0, 8.5, 8.0, 0.5, 0.0])
def test_battery_can_be_set(volts):
    robot = RobotPhysics(params_for(TRAXBOT))
    robot.set_battery(volts)
    assert robot.state.battery_v == pytest.approx(volts, abs=1e-9)


def test_the_charge_is_what_has_flowed():
    """Amperes out of the drop from the voltage at no load, summed, are what the battery has lost."""
    robot = RobotPhysics(params_for(TRAXBOT))
    robot.motors[0].set_speed(6000.0)
    robot.motors[2].set_speed(-2000.0)
    coulombs = 0.0
    for _ in range(1200):
        robot.step(0.05)
        no_load_v = interpolate(robot.params.rest_curve, robot.state.charge)
        coulombs += (no_load_v - robot.state.battery_v) / robot.params.resistance_ohm * 0.05
    assert (1.0 - robot.state.charge) * 3600.0 * robot.params.capacity_ah == pytest.approx(coulombs, rel=1e-6)


def test_an_empty_battery_takes_the_motors_with_it():
    robot = RobotPhysics(params_for(TRAXBOT))
    for index in (0, 2):
        robot.motors[index].set_speed(5000.0)
    robot.step(5.0)
    robot.state.charge = -0.05
    robot.step(5.0)
    assert (robot.state.battery_v, robot.motors[0].speed) == (0.0, 0.0)


def test_the_board_warms_to_its_end_exponentially():
    """Motors that are held at full duty: rise x (1 - exp(-t / 300 s))."""
    robot = RobotPhysics(params_for(TRAXBOT)._replace(capacity_ah=1e9))
    for motor in robot.motors:
        motor.params = motor.params._replace(no_load_counts_s=1.0, friction_counts_s=2.0)
        motor.set_duty(1.0)
    robot.step(150.0)
    rise_c = 3 * robot.params.starting_a * robot.params.heating_c_per_a
    assert robot.state.temperature_c == pytest.approx(25.0 + rise_c * (1 - math.exp(-0.5)), rel=1e-6)


# ---- what must hold however it drives

way = st.floats(-0.02, 0.02)


@settings(max_examples=50, deadline=None)
@given(ways=st.lists(st.tuples(way, way), min_size=1, max_size=40))
def test_there_and_back_is_the_start(ways):
    """Ways of the wheels in steps of 20 ms [m]."""
    robot = cruising(0.0, 0.0, axle_scale=0.97)
    for left, right in [*ways, *((-left, -right) for left, right in reversed(ways))]:
        cruise(robot, left / 0.02, right / 0.02)
        robot.step(0.02)
    assert (robot.state.x_m, robot.state.y_m, robot.state.yaw_rad) == pytest.approx((0, 0, 0), abs=EXACT_M)


def test_each_wheel_goes_over_the_floor_as_far_as_it_rolls():
    """Wheels of a rigid axle that do not slip: the places where they touch the floor tell their ways."""
    model = params_for(STINGBOT, Errors(left_scale=0.99, right_scale=1.02, axle_scale=1.03))
    robot = RobotPhysics(model)
    robot.motors[0].set_speed(3000.0)
    robot.motors[2].set_speed(5000.0)
    half, gone, last = 0.5 * model.wheel_separation_m, [0.0, 0.0], None
    for _ in range(2000):
        robot.step(0.002)
        state = robot.state
        cos, sin = math.cos(state.yaw_rad), math.sin(state.yaw_rad)
        places = [(state.x_m - side * half * sin, state.y_m + side * half * cos) for side in (1, -1)]
        if last:
            gone = [so_far + math.dist(old, new) for so_far, old, new in zip(gone, last, places)]
        last = places
    rolled = robot.motors[0].travel * model.left_m_per_count, robot.motors[2].travel * model.right_m_per_count
    assert gone == pytest.approx(rolled, rel=2e-4)


@pytest.mark.parametrize("load", [0.5, 1.0, 3.0])
def test_a_heavier_robot_starts_slower_and_costs_more(load):
    def started(load):
        robot = RobotPhysics(params_for(TRAXBOT, Errors(load=load)))
        for index in (0, 2):
            robot.motors[index].set_duty(0.5)
        robot.step(0.1)
        return robot.motors[0].speed, robot.state.battery_v

    lighter, heavier = started(load), started(load * 1.1)
    assert lighter[0] > heavier[0]
    assert lighter[1] > heavier[1]


class Counted(Motor):
    """A motor at rest that counts how often it is looked at, which is once for each step."""

    looks = 0

    @property
    def at_rest(self):
        self.looks += 1
        return True


def test_a_resting_robot_costs_few_steps():
    """An hour at rest is counted in steps of a second."""
    robot = RobotPhysics(params_for(STINGBOT))
    robot.motors = tuple(Counted(motor.params) for motor in robot.motors)
    robot.step(3600.0)
    assert 0 < robot.motors[0].looks <= 3601


def test_a_robot_has_bumped_into_nothing_at_its_start():
    assert not RobotPhysics(params_for(models.load("traxbot"))).state.bumped


def test_a_battery_at_95_percent_shows_85_percent_of_its_span():
    """8.5 V empty, 13.8 V full."""
    assert interpolate(params_for(models.load("traxbot")).rest_curve, 0.95) == pytest.approx(8.5 + 0.85 * 5.3)
