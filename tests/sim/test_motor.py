"""One motor against closed forms."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_arduino.hardware.motor import ControlSettings, Mode, Motor, MotorParams

PARAMS = MotorParams(no_load_counts_s=12000.0, rated_counts_s=7500.0)
LOADED = PARAMS._replace(friction_counts_s=240.0)
VOLTS = 12.0
TICK_S = 0.05
SETTLED = 1e-3
"""Share of full speed within which a controlled motor is at its speed."""


def run(motor, seconds, gains=ControlSettings(), volts=VOLTS, tick_s=TICK_S):  # noqa: B008 - never changed
    for _ in range(round(seconds / tick_s)):
        motor.move(tick_s, volts)
        motor.control(tick_s, gains)
    return motor


def spinning(speed, params=PARAMS):
    motor = Motor(params)
    motor.speed = speed
    return motor


def test_braking_distance():
    """v^2 / 2a."""
    motor = spinning(5000.0)
    motor.move(10.0, VOLTS)
    assert motor.travel == pytest.approx(5000.0**2 / (2 * PARAMS.brake_counts_s2))


def test_brake_ends_at_rest():
    motor = spinning(-5000.0)
    motor.move(10.0, VOLTS)
    assert motor.speed == 0.0


def test_step_of_the_duty_is_first_order():
    """63.2 % of the final speed after one time constant."""
    motor = Motor(PARAMS)
    motor.set_duty(0.5)
    motor.move(PARAMS.time_constant_s, VOLTS)
    assert motor.speed == pytest.approx(6000.0 * (1 - math.exp(-1)))


def test_way_under_constant_duty():
    """v t - v tau (1 - exp(-t / tau))."""
    motor = Motor(PARAMS)
    motor.set_duty(1.0)
    tau = PARAMS.time_constant_s
    assert motor.move(1.0, VOLTS) == pytest.approx(12000.0 * (1 - tau * (1 - math.exp(-1 / tau))))


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


def test_coasting_ends_where_friction_has_it():
    """v' = -(v + f) / tau from v0: at rest after tau ln(1 + v0 / f), having gone tau v0 less f times that."""
    motor, tau, friction = spinning(3000.0, LOADED), LOADED.time_constant_s, LOADED.friction_counts_s
    motor.set_duty(0.0)
    to_rest = tau * math.log(1 + 3000.0 / friction)
    motor.move(to_rest - 1e-6, VOLTS)
    assert 0.0 < motor.speed < 1.0
    motor.move(1.0, VOLTS)
    assert (motor.speed, motor.travel) == pytest.approx((0.0, tau * 3000.0 - friction * to_rest))


@pytest.mark.parametrize("duty, speed", [(0.02, 0.0), (0.021, 12.0), (-0.021, -12.0), (1.0, 11760.0)])
def test_friction_holds_what_is_too_weak_and_slows_the_rest(duty, speed):
    motor = Motor(LOADED)
    motor.set_duty(duty)
    motor.move(5.0, VOLTS)
    assert motor.speed == pytest.approx(speed)


def test_half_the_voltage_is_half_the_speed():
    motor = Motor(PARAMS)
    motor.set_duty(1.0)
    motor.move(5.0, 6.0)
    assert motor.speed == pytest.approx(6000.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_duty_is_limited(sign):
    motor = Motor(PARAMS)
    motor.set_duty(sign * 3.0)
    assert motor.duty == sign


@pytest.mark.parametrize(
    "gains",
    [ControlSettings(), ControlSettings(350, 200, 100, 1500), ControlSettings(1300, 350, 400)],
    ids=str,
)
def test_speed_control_reaches_its_speed(gains):
    """The gains of both models, and those of 2012."""
    motor = Motor(LOADED)
    motor.set_speed(3000.0)
    run(motor, 6.0, gains)
    assert motor.speed == pytest.approx(3000.0, abs=SETTLED * 12000)


@pytest.mark.parametrize("tick_s", [0.1, 0.05, 0.025])
def test_speed_control_settles_at_each_control_rate(tick_s):
    """10, 20 and 40 Hz."""
    motor = Motor(LOADED)
    motor.set_speed(3000.0)
    run(motor, 8.0, tick_s=tick_s)
    assert motor.speed == pytest.approx(3000.0, abs=SETTLED * 12000)


def test_speed_control_makes_up_for_a_low_battery():
    motor = Motor(PARAMS)
    motor.set_speed(3000.0)
    run(motor, 6.0, volts=9.0)
    assert motor.speed == pytest.approx(3000.0, abs=SETTLED * 12000)


def test_ramp_takes_its_time_to_rated_speed():
    """2.5 s; the control lags behind by a fraction of a second."""
    motor = Motor(PARAMS)
    motor.set_speed(7500.0)
    run(motor, 1.25)
    assert motor.speed == pytest.approx(3750.0, abs=750.0)


def test_ramp_takes_off_at_its_gain():
    motor = Motor(PARAMS)
    motor.set_speed(7500.0)
    run(motor, TICK_S, ControlSettings(kp=1000, ki=0, kd=0, ramp_gain=500))
    assert motor.duty >= 0.5 * 7500 / 12000


def test_no_ramp_is_a_step():
    motor = Motor(PARAMS)
    motor.set_speed(3000.0)
    run(motor, 1.5, ControlSettings(ramp_ms=0))
    assert motor.speed == pytest.approx(3000.0, rel=0.02)


def test_speed_zero_comes_to_rest():
    motor = run(spinning(0.0), 0.0)
    motor.set_speed(4000.0)
    run(motor, 3.0)
    motor.set_speed(0.0)
    run(motor, 5.0)
    assert motor.at_rest


def test_without_power_nothing_turns():
    motor = Motor(PARAMS)
    motor.set_speed(4000.0)
    run(motor, 3.0, volts=0.0)
    assert motor.travel == 0.0


@pytest.mark.parametrize("goal", [5000.0, -5000.0, 3.0])
def test_position_is_reached_and_held(goal):
    motor = Motor(LOADED)
    motor.go_to(goal, 3000.0, hold=True)
    run(motor, 8.0)
    assert motor.travel == pytest.approx(goal, abs=2.0)
    assert motor.mode is Mode.POSITION


def test_position_without_hold_lets_go():
    motor = Motor(LOADED)
    motor.go_to(2000.0, 3000.0, hold=False)
    run(motor, 8.0)
    assert motor.mode is Mode.BRAKE


# ---- limits


@pytest.mark.parametrize("wanted", [3000.0, -3000.0])
def test_the_control_does_not_wind_up(wanted):
    """Half a minute without power asks for no more than all there is, and is forgotten a second after it returns."""
    motor = Motor(LOADED)
    motor.set_speed(wanted)
    run(motor, 30.0, volts=0.0)
    assert abs(motor.duty) == 1.0
    run(motor, 1.5)
    assert motor.speed == pytest.approx(wanted, rel=0.1)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_ramp_leads_down_as_well(sign):
    motor = Motor(PARAMS)
    motor.set_speed(sign * 7500.0)
    run(motor, 5.0)
    motor.set_speed(0.0)
    run(motor, 1.25)
    assert motor.speed == pytest.approx(sign * 3750.0, abs=750.0)


def test_a_slow_speed_takes_off_no_faster_than_it_is():
    motor = Motor(PARAMS)
    motor.set_speed(-120.0)
    run(motor, TICK_S, ControlSettings(kp=1000, ki=0, kd=0, ramp_gain=500))
    assert motor.duty == pytest.approx(-120 / 12000)


@pytest.mark.parametrize("goal", [20000.0, -20000.0])
def test_a_position_is_approached_no_faster_than_told(goal):
    motor = Motor(LOADED)
    motor.go_to(goal, 3000.0, hold=True)
    fastest = max(abs(run(motor, TICK_S).speed) for _ in range(160))
    assert fastest == pytest.approx(3000.0, rel=0.1)


@pytest.mark.parametrize("again", ["set_speed", "go_to"])
def test_a_command_that_is_repeated_changes_nothing(again):
    once, often = Motor(LOADED), Motor(LOADED)
    command = {"set_speed": (6000.0,), "go_to": (9000.0, 6000.0, True)}[again]
    getattr(once, again)(*command)
    for _ in range(40):
        getattr(often, again)(*command)
        run(often, TICK_S)
    assert run(once, 2.0).travel == often.travel


@pytest.mark.parametrize("again", ["set_speed", "go_to"])
def test_control_takes_over_without_a_jerk(again):
    motor = Motor(LOADED)
    motor.set_duty(0.5)
    motor.move(5.0, VOLTS)
    speed = motor.speed
    motor.set_speed(speed) if again == "set_speed" else motor.go_to(1e6, speed, True)
    slowest = min(run(motor, TICK_S).speed for _ in range(20))
    assert slowest > 0.99 * speed


@pytest.mark.parametrize(
    "begin, rests",
    [
        (lambda motor: motor.set_duty(0.0), True),
        (lambda motor: motor.set_duty(0.01), False),
        (lambda motor: motor.set_speed(0.0), True),
        (lambda motor: motor.set_speed(100.0), False),
        (lambda motor: motor.go_to(0.0, 100.0, True), False),
        (lambda motor: setattr(motor, "speed", 5.0), False),
        (lambda motor: motor.brake(), True),
    ],
)
def test_who_is_at_rest(begin, rests):
    """Only a motor that nothing will move before the next command."""
    motor = Motor(LOADED)
    begin(motor)
    assert motor.at_rest is rests


def test_a_slow_motor_is_not_stood_by_the_control():
    """Below a count a second it may stand only if that is what is asked for."""
    motor = spinning(0.5)
    motor.set_speed(2000.0)
    motor.control(TICK_S, ControlSettings())
    assert motor.speed == 0.5


def way_there(travel):
    """Travel at each tick of a motor that goes to a position."""
    motor, seen = Motor(PARAMS), []
    motor.go_to(travel, 7500.0, True)
    for _ in range(60):
        motor.move(TICK_S, VOLTS)
        motor.control(TICK_S, ControlSettings())
        seen.append(motor.travel)
    return seen


def test_the_way_to_a_position_behind_mirrors_the_way_to_one_ahead():
    """The ramp holds in both directions."""
    assert way_there(-3000.0) == pytest.approx([-each for each in way_there(3000.0)])


def test_a_motor_whose_duty_just_carries_its_friction_coasts_down():
    motor = spinning(1000.0, LOADED)
    motor.set_duty(LOADED.friction_counts_s / LOADED.no_load_counts_s)
    motor.move(LOADED.time_constant_s, VOLTS)
    assert motor.speed == pytest.approx(1000.0 / math.e)
