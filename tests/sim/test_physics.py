"""The robot's body against closed forms: its parameters, steps, obstacles, noise, wheels, battery and heat."""

import math
import statistics

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.hardware.bridge import Shares
from sim_arduino.hardware.dc_motor import DcMotor, DcMotorParams
from sim_arduino.hardware.motor import Mode
from sim_arduino.hardware.robot_physics import Errors, RobotPhysics, interpolate, params_for

EXACT = 1e-9  # A metre, radian, second or volt that is only rounding
TRAXBOT, STINGBOT, OMNI = (models.load(name) for name in ("traxbot", "stingbot", "omni"))
PAST_1_TICK_S, TICK_S = 0.051, 0.05


def body(model=TRAXBOT, omni=False, seed=0, **errors):
    return RobotPhysics(params_for(model, Errors(**errors), omni), seed=seed)


def turn_wheels(robot, left_m_s, rear_m_s, right_m_s):
    """Gives the wheels steady speeds: no friction, and a duty that keeps the speed at the voltage there is."""
    robot.params = robot.params._replace(rest_curve=((0.0, 1.0), (1.0, 1.0)), resistance_ohm=0.0)
    robot.sag(0.0)
    sizes = robot.params.left_m_per_count, robot.params.left_m_per_count, robot.params.right_m_per_count
    for motor, speed_m_s, size_m in zip(robot.motors, (left_m_s, rear_m_s, right_m_s), sizes):
        motor.mode, motor.speed = Mode.DUTY, speed_m_s / size_m
        motor.params = motor.params._replace(friction_counts_s=0.0)
        motor.duty = motor.speed / motor.params.no_load_counts_s * motor.params.nominal_v


def pose_of(robot):
    return robot.state.x_m, robot.state.y_m, robot.state.yaw_rad


def motions_of(robot):
    """A list that gets all motions of the robot: duration, forward, aside, turn."""
    seen = []
    robot.report_motion(lambda *motion: seen.append(motion), 1.0)
    return seen


def hold_at_full_duty(robot):
    for motor in robot.motors:
        motor.blocked = True
        motor.set_duty(1.0)


@pytest.mark.parametrize("model", [TRAXBOT, STINGBOT, OMNI])
def test_the_brake_of_each_model_slows_it_by_2_m_s2(model):
    assert params_for(model).motor.brake_counts_s2 * model.base.metres_per_count == pytest.approx(2.0)


@pytest.mark.parametrize(("load", "time_constant_s"), [(0.0, 0.057), (1.0, 0.080), (2.0, 0.103)])
def test_the_body_makes_up_for_23_ms_of_a_time_constant_of_80_ms(load, time_constant_s):
    assert params_for(TRAXBOT, Errors(load=load)).motor.time_constant_s == pytest.approx(time_constant_s)


def test_a_brake_is_as_much_weaker_as_the_motor_is_slower():
    motors = [params_for(TRAXBOT, Errors(load=load)).motor for load in (1.0, 3.0)]
    one, three = (motor.brake_counts_s2 * motor.time_constant_s for motor in motors)
    assert three == pytest.approx(one)


@pytest.mark.parametrize(
    ("model", "load", "share"), [(TRAXBOT, 1.0, 0.02), (STINGBOT, 1.0, 0.006), (TRAXBOT, 2.0, 0.04)]
)
def test_tracks_lose_2_percent_of_the_speed_to_friction_and_wheels_less(model, load, share):
    motor = params_for(model, Errors(load=load)).motor
    assert motor.friction_counts_s == pytest.approx(share * motor.no_load_counts_s)


def test_the_rated_speed_of_a_traxbot_is_160_turns_a_minute_at_7_2_v():
    """Of a wheel of 39 mm; at full duty 12 V turn it faster in proportion."""
    motor = params_for(TRAXBOT).motor
    assert motor.rated_counts_s * TRAXBOT.base.metres_per_count == pytest.approx(
        160 / 60 * 2 * math.pi * 0.039, rel=5e-3
    )
    assert motor.no_load_counts_s * 7.2 == pytest.approx(motor.rated_counts_s * 12.0)
    omni_m_s = params_for(OMNI).motor.rated_counts_s * OMNI.base.metres_per_count
    assert omni_m_s == pytest.approx(OMNI.base.full_speed_m_s)


def test_each_wheel_has_its_own_size():
    params = params_for(TRAXBOT, Errors(left_scale=1.25, right_scale=0.75))
    sizes = [
        size / TRAXBOT.base.metres_per_count for size in (params.left_m_per_count, params.right_m_per_count)
    ]
    assert sizes == pytest.approx([1.25, 0.75])


def test_the_slip_of_a_robot_adds_to_that_of_its_model():
    slipping = TRAXBOT._replace(drive=TRAXBOT.drive._replace(turn_slip=0.2))
    assert params_for(slipping, Errors(turn_slip=0.1)).turn_slip == pytest.approx(1 - 0.8 * 0.9)


@pytest.mark.parametrize(
    ("model", "omni", "axle_scale", "radius_m"),
    [
        (TRAXBOT, False, 1.0, 0.0),
        (TRAXBOT, True, 1.0, 0.09),
        (OMNI, False, 1.0, 0.1),
        (OMNI, False, 1.1, 0.11),
    ],
)
def test_three_wheels_are_half_the_axle_from_the_middle(model, omni, axle_scale, radius_m):
    assert params_for(model, Errors(axle_scale=axle_scale), omni).omni_radius_m == pytest.approx(radius_m)


@pytest.mark.parametrize(
    ("charge", "volts"),
    [
        (-1.0, 0.0),
        (-0.05, 0.0),
        (-0.025, 4.25),
        (0.0, 8.5),
        (0.04, 8.5 + 0.2 * 5.3),
        (0.19, 8.5 + 0.51 * 5.3),
        (0.55, 8.5 + 0.685 * 5.3),
        (0.9, 8.5 + 0.85 * 5.3 - 0.1 / 3 * 5.3),
        (0.95, 8.5 + 0.85 * 5.3),
        (0.975, 8.5 + 0.925 * 5.3),
        (1.0, 13.8),
        (1.05, 14.8),
        (1.1, 15.8),
        (2.0, 15.8),
    ],
)
def test_a_battery_is_steep_at_both_ends_and_flat_between(charge, volts):
    """8.5 V empty, 13.8 V full, and 2 V more when freshly charged; constant beyond."""
    assert interpolate(params_for(TRAXBOT).rest_curve, charge) == pytest.approx(volts)


def test_a_robot_at_rest_is_reported_in_steps_of_a_second_without_motion():
    robot = body()
    seen = motions_of(robot)
    robot.step(2.5)
    assert seen == [(1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0)]


@pytest.mark.parametrize(
    ("rest_s", "first"), [(0.99, 0.01), (0.049, 0.001), (0.05, 0.02), (2.0, 0.02), (0.06, 0.02)]
)
def test_the_ticks_of_the_board_go_on_at_rest(rest_s, first):
    """They stay at multiples of 50 ms."""
    robot = body()
    robot.step(rest_s)
    robot.motors[0].set_duty(0.5)
    seen = motions_of(robot)
    robot.step(0.2)
    ends = [rest_s + sum(motion[0] for motion in seen[: i + 1]) for i in range(len(seen))]
    assert seen[0][0] == pytest.approx(first)
    assert [end for end in ends if abs(end / TICK_S - round(end / TICK_S)) < 1e-6][:3] == pytest.approx(
        [(math.floor(rest_s / TICK_S + 1e-6) + n) * TICK_S for n in (1, 2, 3)]
    )


@pytest.mark.parametrize(
    ("left_m_s", "right_m_s", "errors", "end"),
    [
        (0.3, 0.3, {}, (0.3 * math.pi, 0.0, 0.0)),
        (-0.1, 0.1, {}, (0.0, 0.0, math.pi * 0.2 / 0.18)),
        (0.21, 0.39, {}, (0.0, 0.6, math.pi)),
        (0.0, 0.09, {}, (0.09, 0.09, 0.5 * math.pi)),
        (0.12, 0.48, {}, (0.0, 0.0, 2 * math.pi)),
        (-0.1, 0.1, {"turn_slip": 0.1}, (0.0, 0.0, 0.9 * math.pi * 0.2 / 0.18)),
        (0.3, 0.3, {"turn_slip": 0.1}, (0.3 * math.pi, 0.0, 0.0)),
        (-0.1, 0.1, {"axle_scale": 1.25}, (0.0, 0.0, math.pi * 0.2 / (0.18 * 1.25))),
    ],
    ids=["straight", "spin", "half_circle", "standing_wheel", "circle", "slip", "straight_slip", "axle"],
)
def test_two_wheels_move_the_body_on_an_exact_arc(left_m_s, right_m_s, errors, end):
    """For pi seconds; the radius of a circle is v / w, and w the difference of the speeds over the axle."""
    robot = body(**errors)
    turn_wheels(robot, left_m_s, 0.0, right_m_s)
    robot.step(math.pi)
    assert pose_of(robot) == pytest.approx(end, abs=1e-8)


@pytest.mark.parametrize(
    ("wheel", "twist"), [(0, (0.0175, 0.005 / 0.18)), (1, (0.02, 0.0)), (2, (0.0175, -0.005 / 0.18))]
)
def test_a_wheel_without_grip_moves_the_body_less(wheel, twist):
    """The encoder does not show it: one wheel of two rolls 20 mm, and 15 mm on the floor."""
    robot = body()
    turn_wheels(robot, 1.0, 1.0, 1.0)
    robot.grip[wheel] = 0.75
    seen = motions_of(robot)
    robot.step(0.02)
    assert seen == [pytest.approx((0.02, twist[0], 0.0, twist[1]))]
    assert robot.motors[wheel].travel * robot.params.left_m_per_count == pytest.approx(0.02)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_an_obstacle_leaves_a_share_of_a_motion(share):
    robot = body()
    turn_wheels(robot, 0.4, 0.0, 0.6)
    robot.allow = lambda *_: share
    seen = motions_of(robot)
    robot.step(0.02)
    turn = share * 0.004 / 0.18
    assert seen == [pytest.approx((0.02, share * 0.01, 0.0, turn))]
    assert pose_of(robot) == pytest.approx((share * 0.01, share * 0.01 * turn / 2, turn), abs=2e-6)
    assert robot.state.bumped is (share < 1.0)
    robot.allow = lambda *_: 1.0
    robot.step(0.02)
    assert not robot.state.bumped


@pytest.mark.parametrize(
    ("omni", "speeds", "furthest_m"),
    [
        (False, (-0.4, 0.9, 0.3), 0.008),
        (False, (0.1, 0.9, -0.3), 0.006),
        (True, (0.4, -0.9, 0.3), 0.018),
        (False, (0.0, 0.9, 0.0), 0.0),
    ],
)
def test_an_obstacle_is_looked_for_by_pose_duration_and_the_furthest_wheel(omni, speeds, furthest_m):
    robot, asked = body(omni=omni), []
    turn_wheels(robot, *speeds)
    robot.allow = lambda old, furthest, after, dt: (
        asked.append((old, furthest, after(1.0), after(0.0), dt)) or 1.0
    )
    robot.step(0.02)
    ((old, furthest, whole, none, dt),) = asked
    assert (old, none) == (Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0))
    assert (furthest, dt) == pytest.approx((furthest_m, 0.02))
    assert pose_of(robot) == pytest.approx((whole.x_m, whole.y_m, whole.yaw_rad))


def deviations(**errors):
    """How far each of 600 motions of 10 mm and 20 mrad, forward and turn, is from that without noise."""
    robot = body(**errors)
    turn_wheels(robot, 0.5 - 0.09, 0.0, 0.5 + 0.09)
    seen = motions_of(robot)
    for _ in range(600):
        robot.state.to_tick_s = 1.0  # steps of 20 ms only
        robot.step(0.02)
    return [motion[1] - 0.01 for motion in seen], [motion[3] - 0.02 for motion in seen]


def test_noise_of_the_wheels_has_the_variance_of_their_distance():
    """The way of the middle is half the sum of two wheels, the yaw is their difference by 180 mm."""
    forward, turn = deviations(wheel_noise=1e-6)
    expected_m = math.sqrt(0.5 * 1e-6 * 0.01)
    assert statistics.pstdev(forward) == pytest.approx(expected_m, rel=0.1)
    assert statistics.pstdev(turn) == pytest.approx(2 * expected_m / 0.18, rel=0.1)
    assert abs(statistics.mean(forward)) < 0.2 * expected_m


def test_noise_of_a_turn_has_the_variance_of_its_angle():
    forward, turn = deviations(turn_noise=1e-4)
    expected_rad = math.sqrt(1e-4 * 0.02)
    assert statistics.pstdev(turn) == pytest.approx(expected_rad, rel=0.1)
    assert abs(statistics.mean(turn)) < 0.2 * expected_rad
    assert forward == pytest.approx([0.0] * 600, abs=EXACT)


def test_noise_is_chosen_by_the_seed():
    ways = []
    params = params_for(TRAXBOT, Errors(wheel_noise=1e-5))
    for robot in (RobotPhysics(params), RobotPhysics(params, seed=0), RobotPhysics(params, seed=1)):
        turn_wheels(robot, 0.5, 0.0, 0.5)
        robot.step(0.1)
        ways.append(pose_of(robot))
    assert ways[0] == ways[1] != ways[2]


def roll(robot, forward_m_s, aside_m_s, turn_rad_s):
    """Turns three wheels at 60, 180 and 300 degrees so that the body moves like this."""
    turn_wheels(
        robot,
        *(
            -forward_m_s * math.sin(angle)
            + aside_m_s * math.cos(angle)
            + robot.params.omni_radius_m * turn_rad_s
            for angle in robot.params.omni_angles_rad
        ),
    )


@pytest.mark.parametrize("model", [TRAXBOT, OMNI])
@pytest.mark.parametrize("twist", [(0.2, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 1.0), (0.1, -0.2, 0.0)])
def test_three_wheels_move_the_body_in_each_direction(model, twist):
    robot = body(model, omni=True)
    roll(robot, *twist)
    robot.step(1.0)
    assert pose_of(robot) == pytest.approx(twist, abs=EXACT)


def test_a_step_that_slides_and_turns_is_exact():
    """One step of 20 ms at 50 rad/s is a third of a quarter turn."""
    robot = body(OMNI)
    roll(robot, 0.0, 1.0, 50.0)
    robot.step(0.02)
    assert pose_of(robot) == pytest.approx((0.02 * (math.cos(1.0) - 1), 0.02 * math.sin(1.0), 1.0), abs=EXACT)


def test_slip_takes_its_share_of_the_yaw_of_three_wheels_alone():
    robot = body(OMNI, turn_slip=0.25)
    roll(robot, 0.0, 0.0, 1.0)
    robot.step(1.0)
    assert pose_of(robot) == pytest.approx((0.0, 0.0, 0.75), abs=EXACT)


def test_a_held_robot_takes_its_starting_current_from_the_battery():
    """1.3 A at rest and 5 A for each motor, through 0.15 Ohm."""
    robot = body()
    rest_v = robot.state.battery_v
    assert rest_v == pytest.approx(13.8 - 1.3 * 0.15)
    hold_at_full_duty(robot)
    robot.step(PAST_1_TICK_S)
    assert rest_v - robot.state.battery_v == pytest.approx(15 * 0.15, abs=1e-3)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_robot_that_coasts_takes_current_and_starting_takes_more(sign):
    """A motor takes 1.6 A at its no-load speed, and 5 A if its duty is a full one away from that."""
    robot = body()
    for motor in robot.motors:
        motor.set_duty(0.0)
        motor.params = motor.params._replace(time_constant_s=1e9)
        motor.speed = sign * 0.5 * motor.params.no_load_counts_s
    rest_v = robot.state.battery_v
    robot.step(PAST_1_TICK_S)
    assert rest_v - robot.state.battery_v == pytest.approx(3 * (0.8 + 2.5) * 0.15, abs=1e-3)


def test_a_held_robot_warms_by_6_degrees_an_ampere_with_5_minutes():
    robot = body()
    hold_at_full_duty(robot)
    robot.step(3.0)
    assert robot.state.temperature_c == pytest.approx(25.0 + 90.0 * (1 - math.exp(-0.01)), rel=1e-6)


def test_a_warm_robot_cools_to_its_surroundings():
    robot = body()
    robot.state.temperature_c = 45.0
    robot.step(300.0)
    assert robot.state.temperature_c == pytest.approx(25.0 + 20.0 / math.e)


def test_a_sag_lowers_the_voltage_at_once_and_costs_no_charge():
    robot = body()
    rest_v = robot.state.battery_v
    robot.sag(2.0)
    assert (robot.state.battery_v, robot.state.charge) == pytest.approx((rest_v - 2.0, 1.0), abs=EXACT)
    robot.step(1.0)
    assert robot.state.battery_v == pytest.approx(rest_v - 2.0, abs=1e-2)
    robot.sag(0.0)
    assert robot.state.battery_v == pytest.approx(rest_v, abs=1e-2)
    robot.sag(20.0)
    assert robot.state.battery_v == 0.0


def bridged(shares):
    """A robot with motors of 1 Ohm on H-bridges that nothing turns."""
    motor = DcMotorParams(1.0, 1e-3, 0.0, 1.0, 1.0)
    robot = RobotPhysics(
        params_for(TRAXBOT)._replace(resistance_ohm=0.1, idle_a=0.5),
        bridged=[DcMotor(motor) for _ in range(3)],
    )
    for each in robot.motors:
        each.shares = shares
    return robot


def test_a_robot_with_h_bridges_takes_no_motor_current_at_its_start():
    assert bridged(Shares()).state.battery_v == pytest.approx(13.8 - 0.5 * 0.1)


def test_h_bridges_take_their_mean_current_from_the_battery():
    """Half of the time through 1 Ohm each, at the voltage that there was before."""
    robot = bridged(Shares(0.5, 0.0, 0.0, 0.5))
    rest_v = robot.state.battery_v
    robot.step(PAST_1_TICK_S)
    volts = robot.state.battery_v
    assert rest_v - volts == pytest.approx(3 * 0.5 * rest_v * 0.1, rel=1e-3)
    robot.sag(1.0)
    assert robot.state.battery_v == pytest.approx(volts - 1.0), "the last current, as no time has passed"


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


@pytest.mark.parametrize("volts", [13.8, 12.0, 9.0, 8.5, 8.0, 0.5, 0.0])
def test_battery_can_be_set(volts):
    robot = RobotPhysics(params_for(TRAXBOT))
    robot.set_battery(volts)
    assert robot.state.battery_v == pytest.approx(volts, abs=1e-9)
    assert (robot.state.charge == -0.05) is (volts == 0.0)


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
