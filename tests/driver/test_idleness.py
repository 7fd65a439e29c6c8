"""Idleness of waypoints."""

import pytest

from mrl_driver.navigation.idleness import Idleness


def test_idleness_is_the_time_since_the_last_visit():
    """Two waypoints, visited at 10 s and at 20 s; the first again at 21 s, by another robot."""
    visited = Idleness(2, 0.0)
    assert (visited.mean_s(0.0), visited.worst_s(0.0)) == (0.0, 0.0)
    visited.visit(0, 10.0)
    visited.visit(1, 20.0)
    assert visited.mean_s(20.0) == pytest.approx((100 + 200) / 20 / 2)  # areas of 100 and 200 s2 in 20 s
    assert (visited.worst_s(20.0), visited.worst_s(45.0)) == (20.0, 35.0)
    visited.visit(0, 21.0)
    assert (visited.visits, visited.worst_s(21.0)) == (3, 20.0)
