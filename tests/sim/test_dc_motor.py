"""A motor on a bridge against closed forms: speeds, times, torque, current and energy."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_arduino.hardware.bridge import Shares
from sim_arduino.hardware.dc_motor import STICTION, DcMotor, Gearmotor, Load, params_of

DATA = Gearmotor(12.0, 17.8, 0.1, 1.2, 0.5, 1.2e-3)
COUNTS = 1496.0
PER_RAD = COUNTS / (2 * math.pi)
ROLLS = Load(0.5, 0.0325, 0.03)
IN_THE_AIR = Load(0.0, 0.0325, 0.0)
INERTIA = 1.2e-3 + 0.5 * 0.0325**2
KE = (12.0 - 0.1 * 10.0) / 17.8
KT = 0.5 / 1.1
FORWARD, BRAKE, COAST = Shares(1.0, 0.0, 0.0, 0.0), Shares(0.0, 0.0, 1.0, 0.0), Shares()


def motor(load=ROLLS, shares=FORWARD, speed=0.0, **changes):
    made = DcMotor(params_of(DATA, load, COUNTS)._replace(**changes))
    made.shares, made.speed = shares, speed
    return made


def test_no_load_speed_and_current_are_those_of_the_data_sheet():
    turning = motor(IN_THE_AIR)
    turning.move(5.0, 12.0)
    turning.take_charge()
    turning.move(1.0, 12.0)
    assert turning.speed / PER_RAD == pytest.approx(17.8)
    assert turning.take_charge() == pytest.approx(0.1)


def test_a_blocked_wheel_takes_the_stall_current():
    held = motor()
    held.blocked = True
    assert held.move(2.0, 12.0) == 0.0
    assert held.take_charge() / 2.0 == pytest.approx(1.2)


def test_the_stall_torque_accelerates_from_rest():
    """At rest the whole stall torque less friction turns the inertia."""
    start = motor(IN_THE_AIR, friction_counts_s2=0.0, static_counts_s2=0.0)
    start.move(1e-6, 12.0)
    assert start.speed / PER_RAD / 1e-6 == pytest.approx(KT * 1.2 / 1.2e-3, rel=1e-4)


def test_a_step_reaches_63_percent_after_the_time_constant():
    """J R / (kt ke)."""
    step = motor(friction_counts_s2=0.0, static_counts_s2=0.0)
    step.move(INERTIA * 10.0 / (KT * KE), 12.0)
    assert step.speed == pytest.approx((1 - math.exp(-1)) * 12.0 / KE * PER_RAD)


def test_the_way_of_a_step_is_the_integral_of_its_speed():
    step = motor(friction_counts_s2=0.0, static_counts_s2=0.0)
    tau, end = INERTIA * 10.0 / (KT * KE), 12.0 / KE * PER_RAD
    assert step.move(0.1, 12.0) == pytest.approx(end * (0.1 - tau * (1 - math.exp(-0.1 / tau))))


def test_friction_costs_the_speed_of_its_current():
    """(12 V - R I) / ke, where I gives the gearbox's friction and the rolling friction."""
    rolling_nm = 0.03 * 0.5 * 9.81 * 0.0325
    turning = motor()
    turning.move(5.0, 12.0)
    assert turning.speed / PER_RAD == pytest.approx((12.0 - 10.0 * (0.1 + rolling_nm / KT)) / KE)


def test_coasting_slows_down_by_friction_alone():
    turning = motor(shares=COAST, speed=1000.0)
    slowing = turning.params.friction_counts_s2
    turning.move(0.05, 12.0)
    assert turning.speed == pytest.approx(1000.0 - slowing * 0.05)
    assert turning.travel == pytest.approx(1000.0 * 0.05 - 0.5 * slowing * 0.05**2)


def test_a_brake_is_faster_than_coasting():
    ways = [motor(shares=shares, speed=4000.0).move(5.0, 12.0) for shares in (BRAKE, COAST)]
    assert 3 * ways[0] < ways[1]


def test_a_brake_takes_nothing_from_the_battery():
    turning = motor(shares=BRAKE, speed=4000.0)
    turning.move(1.0, 12.0)
    assert turning.take_charge() == 0.0


def test_a_wheel_starts_only_above_static_friction():
    """Static friction is 1.5 times the moving one, whose current is 0.1 A and the rolling friction's."""
    start_v = STICTION * 10.0 * (0.1 + 0.03 * 0.5 * 9.81 * 0.0325 / KT)
    for volts, starts in ((0.999 * start_v, False), (1.001 * start_v, True)):
        assert (motor().move(0.1, volts) > 0.0) is starts


def test_a_turning_wheel_keeps_turning_below_its_starting_voltage():
    turning = motor(speed=500.0)
    turning.move(2.0, 1.3)
    assert turning.speed > 0.0


def test_coasting_pulses_reach_a_higher_speed_than_braking_ones():
    """Between coasting pulses nothing brakes: without friction any duty ends at full speed."""
    free = {"friction_counts_s2": 0.0, "static_counts_s2": 0.0}
    ends = []
    for between in (Shares(0.3, 0.0, 0.7, 0.0), Shares(0.3, 0.0, 0.0, 0.7)):
        turning = motor(shares=between, **free)
        turning.move(20.0, 12.0)
        ends.append(turning.speed / PER_RAD * KE / 12.0)
    assert ends == pytest.approx([0.3, 1.0])


def test_backward_is_the_mirror_of_forward():
    ahead, back = motor(), motor(shares=Shares(0.0, 1.0, 0.0, 0.0))
    ahead.move(0.07, 11.0)
    back.move(0.07, 11.0)
    assert (back.travel, back.speed) == (-ahead.travel, -ahead.speed)
    assert back.take_charge() == pytest.approx(ahead.take_charge())


def test_a_reversal_passes_through_rest():
    """The friction turns round with the motion, and the end is the mirrored speed."""
    turning = motor()
    turning.move(5.0, 12.0)
    top = turning.speed
    turning.shares = Shares(0.0, 1.0, 0.0, 0.0)
    turning.move(5.0, 12.0)
    assert turning.speed == pytest.approx(-top)


def test_the_energy_is_accounted_for():
    """What the battery gives is heat in the winding, friction, the gearbox's loss and motion; in steps of 10 us."""
    turning, volts, step_s = motor(), 12.0, 1e-5
    friction_nm = turning.params.friction_counts_s2 / PER_RAD * INERTIA
    heat = shaft = 0.0
    for _ in range(10000):
        before = turning.speed
        way = turning.move(step_s, volts) / PER_RAD
        current = (volts - KE * 0.5 * (before + turning.speed) / PER_RAD) / 10.0
        heat += current**2 * 10.0 * step_s
        shaft += (KE - KT) * current * way + friction_nm * way
    motion = 0.5 * INERTIA * (turning.speed / PER_RAD) ** 2
    assert volts * turning.take_charge() == pytest.approx(heat + shaft + motion, rel=1e-4)


def test_a_bridge_takes_its_part_of_the_voltage():
    """An L298N: 1.4 V less at the motor."""
    with_drop, less = motor(drop_v=1.4), motor()
    assert with_drop.move(0.1, 12.0) == pytest.approx(less.move(0.1, 10.6))


MIXES = st.tuples(*[st.floats(0.0, 1.0)] * 4).filter(lambda mix: sum(mix) > 0.1)


@settings(deadline=None)
@given(MIXES, st.floats(-4000.0, 4000.0), st.integers(2, 40))
def test_a_long_step_is_the_same_as_many_short_ones(mix, speed, pieces):
    shares = Shares(*(each / sum(mix) for each in mix))
    one, many = motor(shares=shares, speed=speed), motor(shares=shares, speed=speed)
    one.move(0.2, 11.0)
    for _ in range(pieces):
        many.move(0.2 / pieces, 11.0)
    assert (many.travel, many.speed) == pytest.approx((one.travel, one.speed), rel=1e-6, abs=1e-6)
    assert many.take_charge() == pytest.approx(one.take_charge(), rel=1e-6, abs=1e-9)


@settings(deadline=None)
@given(MIXES, st.floats(-4000.0, 4000.0), st.floats(0.0, 1.0))
def test_a_motion_is_at_a_travel_when_it_says_so(mix, speed, share):
    turning = motor(shares=Shares(*(each / sum(mix) for each in mix)), speed=speed)
    turning.move(0.2, 11.0)
    motions = turning.take_motions()
    assert motions or not speed
    for motion in motions:
        end, _ = motion.after(motion.duration_s)
        travel = motion.travel + share * (end - motion.travel)
        found, _ = motion.after(motion.time_at(travel))
        assert found == pytest.approx(travel, abs=1e-3)
