"""The sonar chain: volts, turns, power."""

import pytest

from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.hardware.sonars import FULL_COUNT, SonarChain, SonarErrors, count_of
from sim_arduino.world.world import Wall, World

MOUNTS = models.load("traxbot").sonars
VOLT = 1024 / 5.0
WALL = World([Wall(1.1, -9, 1.1, 9)])  # 1 m before the front sonar


def chain(world=WALL, pose=lambda time_s: Pose(0.0, 0.0, 0.0)):
    sonars = SonarChain(MOUNTS, world, pose)
    sonars.power(True, 0.0)
    return sonars


def counts(sonars, time_s):
    return [int(sonars.volts(channel, time_s) * VOLT) for channel in range(3)]


OTHER_CURVE = SonarErrors(gain=1.05, exponent=1.03, offset=-0.01)


@pytest.mark.parametrize("centimetres", [15, 20, 50, 100, 200, 400])
@pytest.mark.parametrize("errors", [SonarErrors(), OTHER_CURVE])
def test_the_thesis_curve_gives_the_distance_back(centimetres, errors):
    count = count_of(centimetres / 100, errors)
    found = errors.gain * 1.1767 * count ** (errors.exponent * 0.94657) - 0.3759 + 100 * errors.offset
    assert found == pytest.approx(centimetres, abs=0.6)


def test_what_is_nearer_than_the_dead_zone_reads_as_its_edge():
    assert count_of(0.05) == count_of(0.15)


def test_nothing_in_range_is_the_full_count_of_another_curve():
    """Which reaches farther than the sonar before its voltage is at its end."""
    assert count_of(float("inf")) == FULL_COUNT
    assert count_of(6.4, OTHER_CURVE) < count_of(float("inf"), OTHER_CURVE) == FULL_COUNT


def test_sensors_take_turns_of_100_ms():
    sonars = chain()
    sonars.trigger(0.3)
    ready = [[bool(count) for count in counts(sonars, time_s)] for time_s in (0.399, 0.41, 0.51, 0.61)]
    assert ready == [[False] * 3, [True, False, False], [True, True, False], [True] * 3]


def test_a_trigger_during_warm_up_is_lost():
    sonars = chain()
    sonars.trigger(0.2)
    assert counts(sonars, 1.0) == [0, 0, 0]


def test_echo_is_of_the_moment_the_sensor_fires():
    """The robot moves on afterwards; the front sonar fired at the start of its round."""
    sonars = chain(pose=lambda time_s: Pose(0.0 if time_s <= 0.3 else 0.5, 0.0, 0.0))
    sonars.trigger(0.3)
    assert counts(sonars, 0.45)[0] == count_of(1.0)


def test_a_trigger_that_stays_high_starts_round_after_round():
    """The robot comes nearer by 0.1 m/s; after four rounds of 0.3 s the front sonar reads what it saw at 1.2 s."""
    sonars = chain(pose=lambda time_s: Pose(0.1 * time_s, 0.0, 0.0))
    sonars.hold(True, 0.3)
    assert counts(sonars, 1.35)[0] == count_of(1.0 - 0.1 * 1.2)


def test_a_round_that_runs_ends_after_the_trigger_goes_low():
    sonars = chain()
    sonars.hold(True, 0.3)
    sonars.hold(False, 0.7)
    assert sonars.next_s < 0.91
    sonars.advance(0.91)
    assert sonars.next_s == float("inf")


def test_a_trigger_held_through_the_warm_up_starts_when_the_sensors_are_up():
    sonars = chain()
    sonars.hold(True, 0.1)
    assert counts(sonars, 0.34) == [0, 0, 0]
    assert counts(sonars, 0.36)[0] > 0


def test_power_that_returns_under_a_held_trigger_starts_a_round():
    sonars = chain()
    sonars.hold(True, 0.3)
    sonars.power(False, 0.5)
    sonars.power(True, 1.0)
    assert counts(sonars, 1.36)[0] > 0
