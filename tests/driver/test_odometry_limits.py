"""Odometry to the count: which readings it uses, and what it hands on."""

import pytest

from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot.covariance import AT_START, TWIST_INTERVAL_S
from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import SLACK_S, Baseline, Odometry, Twist, fastest_wheel_m_s

DRIVE = load("traxbot").drive
UNEQUAL = DRIVE._replace(wheel_offset=0.2)
WRAP_S = 32.768
"""In this time a wheel of 1000 counts/s covers half the range of its counter."""
PERIOD_S = 0.02


def baseline(exact, *readings):
    """Of wheels that make 1000 counts/s at most, after readings of both wheels (right, left, time)."""
    made = Baseline(1.0, 1000.0, SLACK_S[exact])
    for reading in readings:
        made.update(*reading)
    return made


@pytest.mark.parametrize(
    "exact, dt_s, most",
    [(True, 0.1, 105), (True, 0.0, 5), (False, 0.1, 103), (False, 0.0, 23)],
    ids=["board time", "board time, none", "arrival", "burst"],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_a_wheel_moves_as_far_as_its_speed_and_the_errors_of_reading_allow(exact, dt_s, most, sign):
    start = (0, 0, 0.0)
    assert baseline(exact, start).update(0, sign * most, dt_s) == (0, sign * most, dt_s)
    assert baseline(exact, start).update(0, sign * (most + 1), dt_s) is None


def test_after_a_gap_in_which_a_counter_may_have_wrapped_even_no_movement_is_unknown():
    start = (0, 0, 0.0)
    assert baseline(True, start).update(0, 0, WRAP_S - 0.001) is not None
    assert baseline(True, start).update(0, 0, WRAP_S) is None


def test_a_wheel_that_coasts_shortly_goes_no_farther_in_a_shorter_time():
    made = baseline(True, (0, 0, 0.0))
    made.coast_s = 0.5
    assert made.update(400, 400, 0.1) is None


def confirmed(base, reading):
    """What comes of three equal readings without a checksum that arrive after `base`."""
    made = baseline(False, base)
    return [made.update(*reading) for _ in range(3)][-1], made.primed


@pytest.mark.parametrize("jump, primed", [(100, 1), (101, 2)])
def test_a_confirmed_jump_is_integrated_if_the_wheels_can_make_it_in_the_slack(jump, primed):
    step, baselines = confirmed((5000, 5000, 0.0), (5000 + jump, 5000, 0.0))
    assert (step is not None, baselines) == (primed == 1, primed)


@pytest.mark.parametrize("count, primed", [(23, 2), (24, 1)])
def test_a_confirmed_jump_to_near_zero_is_a_restart(count, primed):
    assert confirmed((80, 80, 0.0), (count, count, 0.0))[1] == primed


def test_a_restart_zeroes_both_counters():
    assert confirmed((60, 5000, 0.0), (10, 5050, 0.0)) == ((-50, 50, 0.0), 1)


def test_a_confirmed_jump_after_a_gap_in_which_the_counter_may_have_wrapped_is_not_integrated():
    time_s = WRAP_S - SLACK_S[False]
    assert confirmed((-16350, -16350, 0.0), (16350, 16350, time_s)) == (None, 2)


@pytest.mark.parametrize("count, used", [(123, True), (124, False)])
def test_a_way_back_is_as_near_to_the_reading_before_as_a_step(count, used):
    made = baseline(False, (100, 100, 0.0), (80, 80, 0.0))
    assert (made.update(count, count, 0.0) is not None) is used


def test_a_reading_of_before_a_new_baseline_is_no_way_back():
    made = baseline(False, (5000, 5000, 0.0), (5002, 5002, 0.0), *[(0, 0, 0.0)] * 3)
    assert made.primed == 2 and made.update(5004, 5004, 0.0) is None


# -- what odometry hands on


class Heard:
    """A heading filter and an uncertainty that keep what they are told."""

    in_use = True

    def __init__(self):
        self.rolled, self.resets, self.moved, self.stood = [], [], [], []

    def turn(self, time_s, turn, rolled):
        self.rolled.append(rolled)
        return turn

    def reset(self, *spread):
        self.resets.append(spread)

    def update(self, before, pose, wheels_m, turn, dt_s, gyro):
        self.moved.append((before, wheels_m, dt_s, gyro))

    def stand(self, dt_s, gyro):
        self.stood.append((dt_s, gyro))


def driven(*counts, **parts):
    """Odometry after readings of both wheels, 20 ms apart."""
    odometry = Odometry(parts.pop("drive", DRIVE), 2.0)
    for name, part in parts.items():
        setattr(odometry, name, part)
    for i, (right, left) in enumerate(counts):
        odometry.update(right, left, i * PERIOD_S)
    return odometry


@pytest.mark.parametrize("side", [(1, 0), (0, 1)], ids=["right", "left"])
def test_a_wheel_has_rolled_if_it_has_left_its_place_by_more_than_one_count(side):
    heard = Heard()
    driven(*[(n * side[0], n * side[1]) for n in (0, 1, -1, 0, 2, 3, 1, 2, 0)], heading=heard)
    assert heard.rolled == [False, False, False, True, False, False, False, True]


@pytest.mark.parametrize("counts", [(30, 0), (0, 20), (30, 20)])
def test_the_uncertainty_is_told_the_way_of_each_wheel(counts):
    heard = Heard()
    driven((0, 0), counts, drive=UNEQUAL, uncertainty=heard)
    before, wheels_m, dt_s, gyro = heard.moved[0]
    right_m, left_m = counts[0] * UNEQUAL.right_m_per_count, counts[1] * UNEQUAL.left_m_per_count
    assert wheels_m == pytest.approx((right_m, left_m))
    assert (before, dt_s, gyro, heard.stood) == (ORIGIN, PERIOD_S, None, [])


def test_the_uncertainty_is_told_that_the_wheels_stand():
    heard = Heard()
    driven((5, 5), (5, 5), uncertainty=heard)
    assert (heard.moved, heard.stood) == ([], [(PERIOD_S, None)])


def test_the_travel_of_each_wheel_begins_at_zero():
    assert driven((100, 50), (110, 70)).travel == (10, 20)


def test_a_new_pose_has_the_covariance_given():
    heard = Heard()
    odometry = driven((0, 0), (30, 30), uncertainty=heard)
    odometry.set_pose(Pose(1.0, 2.0, 0.5))
    assert (odometry.pose, heard.resets) == (Pose(1.0, 2.0, 0.5), [(AT_START,)])
    odometry.uncertainty = None
    odometry.set_pose(ORIGIN)
    assert odometry.pose == ORIGIN


def test_after_a_restart_the_speeds_are_zero_and_the_gyro_begins_anew():
    heard = Heard()
    odometry = driven((0, 0), (30, 20), heading=heard)
    assert odometry.twist != (0.0, 0.0)
    odometry.reset()
    assert (odometry.twist, heard.resets) == ((0.0, 0.0), [()])


def test_a_reading_that_is_not_used_is_false():
    assert Odometry(DRIVE, 2.0).update(0, 0, 0.0) is False


def in_burst(reset):
    """Readings without board time; the last two arrive at once, and half an interval before a third one."""
    odometry = Odometry(UNEQUAL, 2.0, exact_time=False)
    odometry.update(0, 0, 0.0)
    odometry.update(6, 2, TWIST_INTERVAL_S / 2)
    if reset:
        odometry.reset()
        odometry.update(6, 2, TWIST_INTERVAL_S / 2)
    odometry.update(12, 4, 2 * TWIST_INTERVAL_S)
    return odometry.twist


@pytest.mark.parametrize("reset, share", [(False, 1.0), (True, 0.5)])
def test_speeds_of_readings_that_are_too_close_are_those_of_their_sum(reset, share):
    """Those of before a restart do not count."""
    dt_s = (1.5 if reset else 2.0) * TWIST_INTERVAL_S
    right_m, left_m = 12 * share * UNEQUAL.right_m_per_count, 4 * share * UNEQUAL.left_m_per_count
    twist = in_burst(reset)
    assert twist.linear_m_s == pytest.approx((right_m + left_m) / 2 / dt_s)
    assert twist.angular_rad_s == pytest.approx((right_m - left_m) / UNEQUAL.turning_separation_m / dt_s)


def test_with_board_time_each_reading_has_its_speed_however_near():
    odometry = Odometry(DRIVE, 2.0)
    odometry.update(0, 0, 0.0)
    odometry.update(3, 3, 0.001)
    assert odometry.twist.linear_m_s == pytest.approx(3 * DRIVE.metres_per_count / 0.001)


def test_wheels_prevent_a_speed_to_the_left():
    assert Twist(0.2, 1.0).lateral_m_s == 0.0


def test_no_wheel_is_faster_than_both_ceilings_together_and_half_as_much():
    assert fastest_wheel_m_s(0.5, 2.0, 0.2) == pytest.approx(1.5 * (0.5 + 0.2))
