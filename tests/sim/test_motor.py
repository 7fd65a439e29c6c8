"""One motor against closed forms: each tick of its control, the ramp, rest, positions, wrong wires and friction."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.robot import models
from sim_arduino.hardware.motor import ControlSettings, Mode, Motor, MotorParams

PARAMS = MotorParams(no_load_counts_s=12000.0, rated_counts_s=7500.0)
LOADED = PARAMS._replace(friction_counts_s=240.0)
VOLTS, TICK_S = 12.0, 0.05
SET_POINT = ControlSettings(kp=1000, ki=0, kd=0)
"""Gains with which the duty of a motor that stands is its set point, as a share of the no-load speed."""
STEP = ControlSettings(kp=1000, ki=0, kd=0, ramp_ms=0)


def spinning(speed, params=PARAMS, **attributes):
    motor = Motor(params)
    motor.speed = speed
    for name, value in attributes.items():
        setattr(motor, name, value)
    return motor


def set_points(motor, ticks, gains=SET_POINT):
    """The set point after each tick of a motor that does not move [count/s]."""
    seen = []
    for _ in range(ticks):
        motor.control(TICK_S, gains)
        seen.append(motor.duty * PARAMS.no_load_counts_s)
    return seen


def test_the_gains_are_those_of_a_traxbot():
    board = models.load("traxbot").board
    assert ControlSettings() == ControlSettings(
        board["kp"], board["ki"], board["kd"], board["ramp_time"], board["ramp_gain"]
    )


@pytest.mark.parametrize(
    ("gains", "duties"),
    [
        (ControlSettings(400, 0, 0, 0), [0.2, 0.2, 0.2]),
        (ControlSettings(0, 400, 0, 0), [0.2, 0.4, 0.6]),
        (ControlSettings(0, 0, 400, 0), [0.2, 0.0, 0.0]),
        (ControlSettings(400, 200, 100, 0), [0.35, 0.4, 0.5]),
        (ControlSettings(0, 1200, 0, 0), [0.6, 1.0, 1.0]),
        (ControlSettings(3000, 0, 0, 0), [1.0, 1.0, 1.0]),
    ],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_the_duty_after_each_tick_at_half_the_no_load_speed_too_little(sign, gains, duties):
    motor, seen = Motor(PARAMS), []
    motor.set_speed(sign * 6000.0)
    for _ in duties:
        motor.control(TICK_S, gains)
        seen.append(sign * motor.duty)
    assert seen == pytest.approx(duties)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_full_integral_empties_at_once(sign):
    """It is kept at the full duty, however long the motor did not follow."""
    motor, gains = Motor(PARAMS), ControlSettings(0, 500, 0, 0)
    motor.set_speed(sign * 12000.0)
    for _ in range(100):
        motor.control(TICK_S, gains)
    motor.speed = sign * 18000.0
    motor.control(TICK_S, gains)
    assert motor.duty == pytest.approx(sign * 0.75)


@pytest.mark.parametrize("sensed", [1.0, 0.0, -1.0])
def test_the_control_sees_the_speed_that_the_encoder_shows(sensed):
    motor = Motor(PARAMS)
    motor.sensed = sensed
    motor.set_speed(6000.0)
    motor.speed = 2400.0
    motor.control(TICK_S, STEP)
    assert motor.duty == pytest.approx(0.5 - 0.2 * sensed)


@pytest.mark.parametrize("sensed", [1.0, -1.0])
@pytest.mark.parametrize(
    "command", [lambda motor: motor.set_speed(1e5), lambda motor: motor.go_to(1e6, 1e5, True)]
)
def test_control_begins_at_the_speed_and_the_duty_that_there_are(command, sensed):
    """The first set point is a tick of the ramp above the speed, 150 count/s, and the integral is the duty."""
    motor = Motor(PARAMS)
    motor.sensed = sensed
    motor.set_duty(0.25)
    motor.speed = sensed * 3000.0
    command(motor)
    motor.control(TICK_S, SET_POINT)
    assert motor.duty == pytest.approx(0.25 + 150 / 12000)


def test_a_control_tick_leaves_a_given_duty_and_a_brake_alone():
    given, braked = Motor(PARAMS), spinning(500.0)
    given.set_duty(0.3)
    for motor in (given, braked):
        motor.control(TICK_S, ControlSettings())
    assert (given.duty, given.mode) == (0.3, Mode.DUTY)
    assert (braked.duty, braked.mode, braked.speed) == (0.0, Mode.BRAKE, 500.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_ramp_rises_by_the_same_speed_each_tick_and_ends_at_the_target(sign):
    """7500 count/s in 2.5 s are 150 a tick."""
    motor = Motor(PARAMS)
    motor.set_speed(sign * 400.0)
    assert set_points(motor, 4) == pytest.approx([sign * each for each in (150, 300, 400, 400)])
    motor.set_speed(sign * -100.0)
    assert set_points(motor, 4) == pytest.approx([sign * each for each in (250, 100, -50, -100)])


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("ramp_gain", "first"), [(0, 150.0), (100, 900.0), (1000, 7000.0)])
def test_the_ramp_takes_off_from_standstill_at_its_gain_and_not_above_the_target(ramp_gain, first, sign):
    motor, gains = Motor(PARAMS), ControlSettings(1000, 0, 0, ramp_gain=ramp_gain)
    motor.set_speed(sign * 7000.0)
    seen = set_points(motor, 2, gains)
    assert seen == pytest.approx([sign * first, sign * min(7000.0, first + 150.0)])


@pytest.mark.parametrize(("speed", "left"), [(0.99, 0.0), (-0.99, 0.0), (1.0, 1.0), (-1.0, -1.0)])
@pytest.mark.parametrize("command", [lambda motor: motor.set_duty(0.0), lambda motor: motor.set_speed(0.0)])
def test_a_motor_that_should_stand_is_stood_below_a_count_a_second(command, speed, left):
    motor = Motor(PARAMS)
    command(motor)
    motor.speed = speed
    motor.control(TICK_S, STEP)
    assert motor.speed == left


@pytest.mark.parametrize(
    "command", [lambda m: m.set_duty(0.0), lambda m: m.set_speed(0.0), lambda m: m.brake()]
)
@pytest.mark.parametrize(
    ("speed", "duty", "rests"), [(0.0, 0.0, True), (1e-9, 0.0, False), (0.0, 1e-9, False)]
)
def test_a_motor_rests_without_speed_and_without_duty(command, speed, duty, rests):
    motor = Motor(PARAMS)
    command(motor)
    motor.speed, motor.duty = speed, duty
    assert motor.at_rest is rests


def test_a_brake_takes_the_duty_away_at_once():
    motor = Motor(PARAMS)
    assert (motor.mode, motor.travel, motor.at_rest) == (Mode.BRAKE, 0.0, True), "after power-up"
    motor.set_duty(0.5)
    motor.brake()
    assert (motor.mode, motor.duty) == (Mode.BRAKE, 0.0)


@pytest.mark.parametrize(
    ("travel", "hold", "mode"),
    [
        (99.51, False, Mode.BRAKE),
        (100.49, False, Mode.BRAKE),
        (99.5, False, Mode.POSITION),
        (100.5, False, Mode.POSITION),
        (100.0, True, Mode.POSITION),
    ],
)
def test_a_motor_lets_go_within_half_a_count_of_its_goal(travel, hold, mode):
    motor = Motor(PARAMS)
    motor.travel = travel
    motor.go_to(100.0, 3000.0, hold)
    motor.control(TICK_S, STEP)
    assert motor.mode is mode


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("left", "speed", "wanted"),
    [(250.0, 3000.0, 1000.0), (2500.0, 3000.0, 3000.0), (2500.0, -3000.0, 3000.0)],
)
def test_the_speed_to_a_position_is_four_times_what_is_left_and_at_most_the_requested_one(
    left, speed, wanted, sign
):
    """250 counts before the goal 1000 count/s, whatever the sign of the requested speed."""
    motor = Motor(PARAMS)
    motor.travel = 700.0
    motor.go_to(700.0 + sign * left, speed, True)
    assert set_points(motor, 1, STEP) == pytest.approx([sign * wanted])


@pytest.mark.parametrize(
    "goal, ahead, travel, then",
    [(1000.0, [150.0, 300.0], 990.0, 40.0), (100.0, [150.0, 300.0, 400.0], 200.0, -400.0)],
)
def test_the_way_to_a_position_speeds_up_by_the_ramp_and_slows_down_or_turns_round_without_it(
    goal, ahead, travel, then
):
    motor = Motor(PARAMS)
    motor.go_to(goal, 3000.0, True)
    assert set_points(motor, len(ahead)) == pytest.approx(ahead)
    motor.travel = travel
    assert set_points(motor, 1) == pytest.approx([then])


@pytest.mark.parametrize("polarity", [1.0, -1.0])
@pytest.mark.parametrize("sensed", [1.0, 0.0, -1.0])
def test_wires_turn_the_motor_and_channels_turn_what_the_encoder_shows(sensed, polarity):
    motor = Motor(PARAMS)
    motor.sensed, motor.polarity = sensed, polarity
    motor.travel = 100.0
    motor.set_duty(0.5)
    moved = motor.move(0.1, VOLTS)
    assert moved * polarity > 0.0
    assert motor.travel == 100.0 + moved * sensed


@pytest.mark.parametrize("command", [lambda motor: motor.set_duty(1.0), lambda motor: motor.brake()])
def test_a_wheel_that_is_held_does_not_move_and_has_no_speed(command):
    motor = spinning(3000.0)
    command(motor)
    motor.blocked = True
    assert (motor.move(0.1, VOLTS), motor.travel, motor.speed) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("friction", [0.0, 0.5, 240.0])
def test_a_motor_that_is_turned_back_comes_to_rest_and_then_runs_the_other_way(sign, friction):
    """Until its rest friction adds to the duty, and afterwards it takes from it."""
    motor = spinning(sign * 3000.0, PARAMS._replace(friction_counts_s=friction))
    motor.set_duty(sign * -0.5)
    tau, down, up = PARAMS.time_constant_s, 6000.0 + friction, 6000.0 - friction
    to_rest = tau * math.log1p(3000.0 / down)
    there = tau * 3000.0 - down * to_rest
    moved = motor.move(to_rest + tau, VOLTS)
    assert motor.speed == pytest.approx(sign * -up * (1 - math.exp(-1)))
    assert moved == pytest.approx(sign * (there - up * tau * math.exp(-1)))


def test_a_motor_that_coasts_for_just_its_time_rests():
    for speed in range(100, 9000, 100):
        motor = spinning(float(speed), LOADED)
        motor.set_duty(0.0)
        motor.move(LOADED.time_constant_s * math.log1p(speed / LOADED.friction_counts_s), VOLTS)
        assert motor.speed == 0.0


@pytest.mark.parametrize("sign", [1, -1])
def test_a_motor_that_brakes_for_just_its_time_rests(sign):
    for speed in range(100, 9000, 100):
        motor = spinning(sign * float(speed))
        moved = motor.move(speed / PARAMS.brake_counts_s2, VOLTS)
        assert motor.speed == 0.0
        assert moved == pytest.approx(sign * 0.5 * speed**2 / PARAMS.brake_counts_s2)


def run(motor, seconds, gains=ControlSettings(), volts=VOLTS, tick_s=TICK_S):  # noqa: B008 - never changed
    for _ in range(round(seconds / tick_s)):
        motor.move(tick_s, volts)
        motor.control(tick_s, gains)
    return motor


@pytest.mark.parametrize("mode, duty", [(Mode.DUTY, 0.3), (Mode.DUTY, 0.0), (Mode.BRAKE, 0.0)])
@given(pieces=st.lists(st.floats(1e-6, 0.2), min_size=1, max_size=20), speed=st.floats(-9000, 9000))
def test_motion_does_not_depend_on_the_steps(mode, duty, pieces, speed):
    """Friction that brings it to rest, or lets it turn back, in the midst of a step included."""
    one, many = spinning(speed, LOADED), spinning(speed, LOADED)
    for motor in (one, many):
        motor.mode, motor.duty = mode, duty
    one.move(math.fsum(pieces), VOLTS)
    for piece in pieces:
        many.move(piece, VOLTS)
    assert many.travel == pytest.approx(one.travel, abs=1e-6)
    assert many.speed == pytest.approx(one.speed, abs=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_duty_is_limited(sign):
    motor = Motor(PARAMS)
    motor.set_duty(sign * 3.0)
    assert motor.duty == sign


@pytest.mark.parametrize("again", ["set_speed", "go_to"])
def test_a_command_that_is_repeated_changes_nothing(again):
    once, often = Motor(LOADED), Motor(LOADED)
    command = {"set_speed": (6000.0,), "go_to": (9000.0, 6000.0, True)}[again]
    getattr(once, again)(*command)
    for _ in range(40):
        getattr(often, again)(*command)
        run(often, TICK_S)
    assert run(once, 2.0).travel == often.travel


@pytest.mark.parametrize(
    "begin, rests",
    [
        (lambda motor: motor.set_speed(0.0), True),
        (lambda motor: motor.set_speed(100.0), False),
        (lambda motor: motor.go_to(0.0, 100.0, True), False),
    ],
)
def test_who_is_at_rest(begin, rests):
    motor = Motor(LOADED)
    begin(motor)
    assert motor.at_rest is rests


def test_a_motor_whose_duty_just_carries_its_friction_coasts_down():
    motor = spinning(1000.0, LOADED)
    motor.set_duty(LOADED.friction_counts_s / LOADED.no_load_counts_s)
    motor.move(LOADED.time_constant_s, VOLTS)
    assert motor.speed == pytest.approx(1000.0 / math.e)
