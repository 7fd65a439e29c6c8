"""A motor on a bridge against closed forms: pieces of motion to their ends, rest, starting, clock and charge."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_arduino.hardware.bridge import Shares
from sim_arduino.hardware.dc_motor import DcMotor, DcMotorParams, Motion

EXACT = 1e-10  # Share of a value that is only rounding, and what the series for short motions leaves out
FORWARD, BACKWARD, COAST = Shares(1.0, 0.0, 0.0, 0.0), Shares(0.0, 1.0, 0.0, 0.0), Shares()
BRAKE, MIXED = Shares(0.0, 0.0, 1.0, 0.0), Shares(0.25, 0.5, 0.125, 0.125)
PARAMS = DcMotorParams(2.0, 0.001, 1000.0, 400.0, 600.0)
"""2 Ohm, 1 mV s a count, 1000 count/s2 an ampere, 400 count/s2 friction, 600 count/s2 to start."""


def motor(shares=COAST, speed=0.0, **changes):
    made = DcMotor(PARAMS._replace(**changes))
    made.shares, made.speed = shares, speed
    return made


@pytest.mark.parametrize("u", [1e-6, 0.9e-3, 1.1e-3, 0.5, 3.0])
@pytest.mark.parametrize("time_s", [0.1, 2.0])
def test_a_piece_of_motion_is_the_integral_of_its_exponential(time_s, u):
    first = time_s * math.fsum((-u) ** n / math.factorial(n + 1) for n in range(40))
    second = time_s**2 * math.fsum((-u) ** n / math.factorial(n + 2) for n in range(40))
    travel, speed = Motion(0.0, time_s, 0.0, 0.0, 5.0, u / time_s).after(time_s)
    assert (travel, speed) == pytest.approx((5.0 * second, 5.0 * first), rel=EXACT)
    travel, speed = Motion(0.0, time_s, 7.0, 11.0, 5.0, u / time_s).after(time_s)
    assert (travel, speed) == pytest.approx(
        (7.0 + 11.0 * time_s + 5.0 * second, 11.0 + 5.0 * first), rel=EXACT
    )


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("speed", "acceleration", "rate", "rest_s"),
    [
        (10.0, -5.0, 0.0, 2.0),
        (10.0, -5.0, 1e-12, 2.0),
        (10.0, -40.0, 2.0, 0.5 * math.log(2.0)),
        (10.0, -20.0, 2.0, math.inf),
        (10.0, -19.0, 2.0, math.inf),
        (10.0, -20.1, 2.0, -0.5 * math.log1p(-20.0 / 20.1)),
        (10.0, 5.0, 0.0, math.inf),
        (10.0, 0.0, 0.0, math.inf),
        (0.0, -5.0, 0.0, math.inf),
        (10.0, -1e6, 1e-4, 1e-5),
    ],
)
def test_a_motion_rests_when_its_speed_is_used_up(sign, speed, acceleration, rate, rest_s):
    """Never, if its end is a speed in the same direction, or zero itself."""
    motion = Motion(0.0, 9.0, 0.0, sign * speed, sign * acceleration, rate)
    assert motion.time_to_rest() == pytest.approx(rest_s, rel=EXACT)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("speed", "acceleration", "rate"),
    [
        (100.0, 0.0, 0.0),
        (100.0, 50.0, 0.0),
        (0.0, 500.0, 0.0),
        (0.0, 5000.0, 20.0),
        (200.0, -200.0, 0.0),
        (1000.0, -4000.0, 5.0),
        (1000.0, -1100.0, 1.0),
    ],
)
@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.999])
def test_a_motion_passes_a_place_when_it_was_there(share, speed, acceleration, rate, sign):
    """To 0.1 us, in both directions, from standstill, and shortly before rest."""
    motion = Motion(3.0, 0.9, sign * 40.0, sign * speed, sign * acceleration, rate)
    travel, _ = motion.after(share * 0.9)
    if share * 0.9 < motion.time_to_rest():
        assert motion.time_at(travel) == pytest.approx(share * 0.9, abs=2e-7)


def test_the_place_where_a_wheel_comes_to_rest_is_found_to_a_tenth_of_a_microsecond():
    motion = Motion(0.0, math.log(2.0), 0.0, 100.0, -200.0, 1.0)
    assert motion.time_at(motion.after(math.log(2.0))[0]) == pytest.approx(math.log(2.0), abs=1e-7)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_place_at_the_end_is_passed_at_the_end(sign):
    motion = Motion(0.0, 0.25, 0.0, sign * 100.0, 0.0, 0.0)
    assert motion.time_at(sign * 25.0) == pytest.approx(0.25)
    assert motion.time_at(0.0) == 0.0


def test_a_motor_stands_and_coasts_after_power_up():
    made = DcMotor(PARAMS)
    assert (made.travel, made.speed, made.shares, made.at_rest) == (0.0, 0.0, COAST, True)


@pytest.mark.parametrize(
    ("shares", "speed", "rests"),
    [
        (COAST, 0.0, True),
        (BRAKE, 0.0, True),
        (COAST, 1e-9, False),
        (BRAKE, -1e-9, False),
        (Shares(1e-9, 0.0, 0.0, 1.0), 0.0, False),
        (Shares(0.0, 1e-9, 0.0, 1.0), 0.0, False),
    ],
)
def test_a_motor_rests_if_it_stands_and_nothing_drives_it(shares, speed, rests):
    assert motor(shares, speed).at_rest is rests


@pytest.mark.parametrize("sign", [1, -1])
def test_a_wheel_starts_above_its_static_friction_and_then_has_the_moving_one(sign):
    """500 count/s2 a volt: 1.2 V are 600 count/s2, at which it stands; 2 V leave 600 of 1000 count/s2."""
    shares = FORWARD if sign > 0 else BACKWARD
    assert motor(shares).move(0.01, 1.2) == 0.0
    started = motor(shares, volts_per_count_s=0.0)
    assert started.move(0.1, 2.0) == pytest.approx(sign * 0.5 * 600.0 * 0.01)
    assert started.speed == pytest.approx(sign * 60.0)


@pytest.mark.parametrize("speed", [50.0, -50.0])
def test_a_wheel_coasts_to_rest_by_its_friction_and_stays(speed):
    """400 count/s2: 0.125 s."""
    coasting = motor(COAST, speed)
    moved = coasting.move(1.0, 12.0)
    assert (moved, coasting.travel, coasting.speed) == pytest.approx(
        (speed * 0.0625, speed * 0.0625, 0.0), abs=EXACT
    )
    (motion,) = coasting.take_motions()
    assert (motion.start_s, motion.duration_s, motion.speed) == pytest.approx((0.0, 0.125, speed))


@pytest.mark.parametrize("shares", [FORWARD, BACKWARD, BRAKE, MIXED])
@pytest.mark.parametrize("speed", [100.0, -100.0])
def test_acceleration_and_rate_come_from_all_shares(shares, speed):
    """Drive 500 count/s2 a volt of what is forward less backward; 0.5 1/s of what is not coasting."""
    turning = motor(shares, speed)
    turning.move(1e-6, 4.0)
    (motion,) = turning.take_motions()
    rate = 0.5 * (1.0 - shares.coast)
    drive = 2000.0 * (shares.forward - shares.backward)
    assert motion == pytest.approx(
        (0.0, 1e-6, 0.0, speed, drive - rate * speed - math.copysign(400.0, speed), rate)
    )


def test_motions_follow_each_other_on_the_motors_clock():
    """The wheel turns back: 10 ms to rest, then the other way; the clock begins anew when the motions are taken."""
    turning = motor(BACKWARD, 24.0, volts_per_count_s=0.0)
    turning.move(0.02, 4.0)
    turning.move(0.01, 4.0)
    motions = turning.take_motions()
    assert [(each.start_s, each.duration_s) for each in motions] == [
        pytest.approx(pair) for pair in ((0.0, 0.01), (0.01, 0.01), (0.02, 0.01))
    ]
    assert [each.speed for each in motions] == pytest.approx([24.0, 0.0, -16.0])
    assert [each.travel for each in motions] == pytest.approx([0.0, 0.12, 0.04])
    turning.move(0.01, 4.0)
    assert [each.start_s for each in turning.take_motions()] == [0.0]
    assert turning.take_motions() == []


def test_time_at_rest_passes_on_the_clock_without_a_motion():
    turning = motor()
    turning.move(0.5, 4.0)
    assert turning.take_motions() == []
    turning.move(0.25, 4.0)
    turning.shares = FORWARD
    turning.move(0.25, 4.0)
    (motion,) = turning.take_motions()
    assert motion.start_s == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("shares", "charge_as"),
    [(FORWARD, 0.4), (BACKWARD, 0.4), (Shares(0.25, 0.0, 0.0, 0.75), 0.1), (MIXED, 0.3), (BRAKE, 0.0)],
)
def test_a_held_wheel_takes_the_current_of_its_resistance(shares, charge_as):
    """4 V through 2 Ohm for 0.2 s, for the share of time that the bridge drives."""
    held = motor(shares, 100.0)
    held.blocked = True
    assert (held.move(0.2, 4.0), held.speed) == (0.0, 0.0)
    assert held.take_charge() == pytest.approx(charge_as)
    assert held.take_charge() == 0.0


@pytest.mark.parametrize(("shares", "sign"), [(FORWARD, 1), (BACKWARD, -1)])
def test_a_turning_wheel_gives_back_its_emf(shares, sign):
    """1 mV s a count and 2 Ohm: each count of way is half a thousandth of an ampere second less."""
    turning = motor(shares, sign * 100.0)
    way = turning.move(0.2, 4.0)
    assert turning.take_charge() == pytest.approx(0.4 - 0.0005 * abs(way))


@pytest.mark.parametrize(("volts", "drop_v"), [(1.0, 1.0), (1.0, 3.0), (0.0, 0.0)])
def test_a_bridge_that_takes_the_whole_voltage_leaves_none(volts, drop_v):
    weak = motor(FORWARD, drop_v=drop_v)
    assert weak.move(0.2, volts) == 0.0
    assert weak.take_charge() == 0.0


MIXES = st.tuples(*[st.floats(0.0, 1.0)] * 4).filter(lambda mix: sum(mix) > 0.1)


@settings(deadline=None)
@given(MIXES, st.floats(-4000.0, 4000.0), st.integers(2, 40))
def test_a_long_step_is_the_same_as_many_short_ones(mix, speed, pieces):
    shares = Shares(*(each / sum(mix) for each in mix))
    one, many = motor(shares=shares, speed=speed), motor(shares=shares, speed=speed)
    one.move(0.2, 11.0)
    ways = [many.move(0.2 / pieces, 11.0) for _ in range(pieces)]
    assert math.fsum(ways) == pytest.approx(many.travel, abs=1e-6)
    assert (many.travel, many.speed) == pytest.approx((one.travel, one.speed), rel=1e-6, abs=1e-6)
    assert many.take_charge() == pytest.approx(one.take_charge(), rel=1e-6, abs=1e-9)
