import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.geometry import ORIGIN, wrap_angle
from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import CONFIRMATIONS, Baseline, Odometry, fastest_wheel_m_s

DRIVE = load("traxbot").drive
FASTEST_M_S = fastest_wheel_m_s(0.65, 5.0, DRIVE.wheel_separation_m)
PERIOD_S = 0.02

int16 = st.integers(-32768, 32767)


def as_int16(count):
    return ((int(count) + 0x8000) & 0xFFFF) - 0x8000


@given(int16, st.integers(-2000, 2000))
def test_movement_is_the_difference_of_counters_that_may_wrap(start, moved):
    baseline = Baseline(DRIVE.metres_per_count, FASTEST_M_S, 0.002)
    baseline.update(start, start, 0.0)
    assert baseline.update(as_int16(start + moved), as_int16(start - moved), 1.0) == (moved, -moved, 1.0)


def test_first_reading_primes():
    odometry = Odometry(DRIVE, FASTEST_M_S)
    assert not odometry.update(12345, -4321, 0.0)
    assert odometry.pose == ORIGIN


def test_second_reading_integrates():
    odometry = Odometry(DRIVE, FASTEST_M_S)
    odometry.update(1000, 1000, 0.0)
    odometry.update(1100, 1100, 0.1)
    assert odometry.pose == pytest.approx((100 * DRIVE.metres_per_count, 0, 0))


def test_twist_comes_from_the_time_given():
    odometry = Odometry(DRIVE, FASTEST_M_S)
    odometry.update(0, 0, 0.0)
    odometry.update(100, 50, 0.1)
    assert odometry.twist.linear_m_s == pytest.approx(75 * DRIVE.metres_per_count / 0.1)
    turn = 50 * DRIVE.metres_per_count / DRIVE.wheel_separation_m
    assert odometry.twist.angular_rad_s == pytest.approx(turn / 0.1)


@pytest.mark.parametrize("exact", [True, False])
def test_no_time_between_readings_makes_no_spike(exact):
    """A burst after a pause arrives all at once."""
    odometry = Odometry(DRIVE, FASTEST_M_S, exact_time=exact)
    odometry.update(0, 0, 0.0)
    odometry.update(2, 2, 0.0)
    assert odometry.twist == (0.0, 0.0)


def test_arrival_times_that_bunch_give_the_mean_speed():
    odometry = Odometry(DRIVE, FASTEST_M_S, exact_time=False)
    for i in range(5):
        odometry.update(10 * i, 10 * i, 0.016 * (i // 2))
    assert odometry.twist.linear_m_s == pytest.approx(20 * DRIVE.metres_per_count / 0.016)


def test_the_counter_wrap_moves_nothing_extra():
    odometry = Odometry(DRIVE, FASTEST_M_S)
    odometry.update(32767, -32768, 0.0)
    odometry.update(-32768, -32767, PERIOD_S)
    assert odometry.pose.x_m == pytest.approx(DRIVE.metres_per_count)
    assert odometry.pose.yaw_rad == 0.0


def test_an_impossible_reading_is_refused_and_the_next_good_one_bridges_it():
    odometry = Odometry(DRIVE, FASTEST_M_S)
    for i, count in enumerate([0, 20, 9000, 60]):
        odometry.update(count, count, i * PERIOD_S)
    assert odometry.baseline.refused == 1
    assert odometry.pose.x_m == pytest.approx(60 * DRIVE.metres_per_count)


def test_a_refused_jump_is_never_integrated():
    """The counters were reset: after three readings that agree they are the baseline, without a jump."""
    odometry = Odometry(DRIVE, FASTEST_M_S)
    odometry.update(20000, 20000, 0.0)
    for i in range(1, CONFIRMATIONS + 2):
        odometry.update(i, i, i * PERIOD_S)
    assert odometry.pose.x_m == pytest.approx(DRIVE.metres_per_count)


@pytest.mark.parametrize("count", [1000, 2000])
@pytest.mark.parametrize("exact", [True, False])
def test_counters_that_start_from_zero_again_move_nothing(count, exact):
    """A board that goes on streaming after its restart, with little on its counters."""
    odometry = Odometry(DRIVE, FASTEST_M_S, exact)
    for i in range(10):
        odometry.update(count + 60 * i, count + 60 * i, i * PERIOD_S)
    before = odometry.pose
    for i in range(10, 20):
        odometry.update(60 * (i - 10), 60 * (i - 10), i * PERIOD_S)
    assert 0 <= odometry.pose.x_m - before.x_m <= 10 * 60 * DRIVE.metres_per_count


def test_readings_that_disagree_make_no_baseline():
    baseline = Baseline(DRIVE.metres_per_count, FASTEST_M_S, 0.0)
    baseline.update(0, 0, 0.0)
    for i, count in enumerate([9000, -9000, 15000, -15000, 20000]):
        assert baseline.update(count, count, (i + 1) * 1e-3) is None
    assert baseline.update(1, 1, 6e-3) == (1, 1, 6e-3)


def test_a_gap_in_which_the_counter_could_have_wrapped_is_not_guessed():
    """At 1.65 m/s half the counter's range passes in 1.7 s."""
    odometry = Odometry(DRIVE, FASTEST_M_S)
    odometry.update(0, 0, 0.0)
    assert not odometry.update(30000, 30000, 5.0)


def test_a_reset_keeps_the_pose():
    odometry = Odometry(DRIVE, FASTEST_M_S)
    odometry.update(0, 0, 0.0)
    odometry.update(100, 100, 0.1)
    pose = odometry.pose
    odometry.reset()
    odometry.update(0, 0, 0.2)
    assert odometry.pose == pose


@given(st.lists(st.tuples(int16, int16, st.floats(0, 1)), max_size=40))
def test_no_reading_moves_the_robot_faster_than_its_wheels(readings):
    """Whatever the wire says, no accepted step exceeds what the wheels can do in its time."""
    baseline = Baseline(DRIVE.metres_per_count, FASTEST_M_S, 0.0)
    time_s = 0.0
    for right, left, dt_s in readings:
        time_s += dt_s
        step = baseline.update(right, left, time_s)
        if step is not None:
            right, left, dt_s = step
            bound = FASTEST_M_S * dt_s + 4 * DRIVE.metres_per_count
            assert max(abs(right), abs(left)) * DRIVE.metres_per_count <= bound


def test_unequal_wheels_and_slip_turn_as_calibrated():
    """Right wheel 1 % larger, a tenth of each turn lost: 5000 counts each, and 5000 counts of the right one more."""
    drive = DRIVE._replace(wheel_offset=0.01, turn_slip=0.1)
    odometry = Odometry(drive, 2.0)
    odometry.update(0, 0, 0.0)
    odometry.update(5000, 5000, 1.0)
    kept_rad_per_m = 0.9 / DRIVE.wheel_separation_m
    assert odometry.pose.yaw_rad == pytest.approx(5000 * DRIVE.metres_per_count * 0.01 * kept_rad_per_m)
    assert math.hypot(*odometry.pose[:2]) == pytest.approx(5000 * DRIVE.metres_per_count, rel=1e-3)
    before = odometry.pose.yaw_rad
    odometry.update(10000, 5000, 2.0)
    turned = 5000 * DRIVE.metres_per_count * 1.005 * kept_rad_per_m
    assert wrap_angle(odometry.pose.yaw_rad - before) == pytest.approx(wrap_angle(turned))


def distance_m(readings, exact):
    """Where odometry is along x after readings of both wheels [(count, s)]."""
    odometry = Odometry(DRIVE, FASTEST_M_S, exact)
    for count, time_s in readings:
        odometry.update(count, count, time_s)
    return odometry.pose.x_m


@pytest.mark.parametrize("exact", [True, False])
def test_one_wrong_count_near_zero_does_not_stay(exact):
    """200 read as 600 by a board without check value: the way back would look like a restart."""
    readings = [(196, 0.0), (198, 0.003), (600, 0.006), (202, 0.009), (204, 0.012)]
    assert distance_m(readings, exact) == pytest.approx(8 * DRIVE.metres_per_count)


def test_one_wrong_count_after_a_pause_does_not_stay():
    """In the time of the pause the wheels could have made that way, but not back in the time after it."""
    readings = [(196, 0.0), (198, 0.003), (900, 0.053), (202, 0.056), (204, 0.059)]
    assert distance_m(readings, exact=False) == pytest.approx(8 * DRIVE.metres_per_count)


def test_frames_lost_from_a_burst_are_bridged_once_they_are_confirmed():
    """Arrival times say that 600 counts took no time."""
    readings = [(5000, 0.0), (5600, 0.001), (5602, 0.002), (5604, 0.003), (5606, 0.004)]
    assert distance_m(readings, exact=False) == pytest.approx(606 * DRIVE.metres_per_count)


@pytest.mark.parametrize(
    ("jump", "pause_s"),
    [
        pytest.param(20000, 0.001, id="no wheel can make it"),
        pytest.param(10000, 60.0, id="it may have wrapped"),
    ],
)
def test_a_confirmed_jump_of_unknown_length_is_not_integrated(jump, pause_s):
    after = [(5000 + jump + 2 * i, pause_s + 0.003 * i) for i in range(4)]
    assert distance_m([(5000, 0.0), *after], exact=False) == pytest.approx(2 * DRIVE.metres_per_count)


def test_a_gap_after_which_the_wheels_must_have_stood_is_bridged():
    odometry = Odometry(DRIVE, FASTEST_M_S)
    odometry.baseline.coast_s = 1.25
    odometry.update(30000, 30000, 0.0)
    assert odometry.update(as_int16(50000), as_int16(50000), 60.0)
    assert odometry.pose.x_m == pytest.approx(20000 * DRIVE.metres_per_count)


def test_a_way_longer_than_the_wheels_can_coast_is_not_believed():
    odometry = Odometry(DRIVE, FASTEST_M_S)
    odometry.baseline.coast_s = 0.5
    odometry.update(0, 0, 0.0)
    assert not odometry.update(20000, 20000, 60.0)


def test_each_new_baseline_is_counted():
    baseline = Baseline(DRIVE.metres_per_count, FASTEST_M_S, 0.0)
    for i, count in enumerate([0, 10, 9000, 9001, 9002, 9003]):
        baseline.update(count, count, i * PERIOD_S)
    baseline.reset()
    baseline.update(5, 5, 1.0)
    assert baseline.primed == 3
