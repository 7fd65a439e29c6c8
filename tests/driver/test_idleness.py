"""Idleness of waypoints."""

import pytest

from mrl_driver.navigation.idleness import Idleness


@pytest.fixture
def visited():
    """Two waypoints, visited at 10 s and at 20 s."""
    made = Idleness(2, 0.0)
    made.visit(0, 10.0)
    made.visit(1, 20.0)
    return made


def test_mean_is_that_of_the_time_since_the_last_visit(visited):
    """The first rises to 10 s twice, the second to 20 s once: areas of 100 and 200 s2 in 20 s."""
    assert visited.mean_s(20.0) == pytest.approx((100 + 200) / 20 / 2)


def test_worst_is_the_longest_time_between_visits(visited):
    assert visited.worst_s(20.0) == 20.0


def test_waypoint_that_nobody_visits_counts_until_now(visited):
    assert visited.worst_s(45.0) == 35.0


def test_visits_of_several_robots_count_together(visited):
    visited.visit(0, 21.0)
    assert (visited.visits, visited.worst_s(21.0)) == (3, 20.0)


def test_regular_visits_have_half_the_period_as_mean():
    idleness = Idleness(1, 0.0)
    for lap in range(1, 101):
        idleness.visit(0, 8.0 * lap)
    assert (idleness.mean_s(800.0), idleness.worst_s(800.0)) == (4.0, 8.0)


def test_idleness_at_the_start_is_zero():
    assert (Idleness(3, 5.0).mean_s(5.0), Idleness(3, 5.0).worst_s(5.0)) == (0.0, 0.0)
