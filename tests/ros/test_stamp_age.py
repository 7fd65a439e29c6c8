"""Which messages of other nodes count as fresh, by their stamps."""

import pytest

from ros1_bridge.node.stamp_age import AHEAD_S, StampAge

LIMIT_S, EDGE_S = 0.5, 1e-6
NOW_S, ARRIVED_S = 1700000000.0, 50.0


@pytest.fixture
def source():
    return StampAge(LIMIT_S)


def judged(source, age_s, later_s=0.0):
    """A message of this age that arrives so much later."""
    return source.trouble(NOW_S + later_s - age_s, NOW_S + later_s, ARRIVED_S + later_s)


@pytest.mark.parametrize("age_s", [0.0, LIMIT_S - EDGE_S, -AHEAD_S + EDGE_S])
def test_message_within_the_limits_is_fresh(source, age_s):
    assert judged(source, age_s) == ""
    assert source.made_s == pytest.approx(ARRIVED_S - max(0.0, age_s))


@pytest.mark.parametrize(
    "age_s, words",
    [
        (LIMIT_S + EDGE_S, "s old by"),
        (10.0, "its stamp 1699999990.000 is 10.000 s old by this node's clock 1700000000.000"),
        (-AHEAD_S - EDGE_S, "s ahead of"),
        (-3600.0, "its stamp 1700003600.000 is 3600.000 s ahead of this node's clock 1700000000.000"),
        (NOW_S, "its stamp is 0"),
    ],
)
def test_message_beyond_the_limits_is_not_and_both_times_are_told(source, age_s, words):
    assert words in judged(source, age_s)


def test_stamp_of_zero_is_no_time_although_simulated_time_begins_there(source):
    assert "its stamp is 0" in source.trouble(0.0, 0.1, ARRIVED_S)


def test_clocks_are_the_likely_cause_only_until_a_message_was_fresh(source):
    assert "synchronise them (NTP)" in judged(source, 10.0)
    assert judged(source, 0.0, later_s=1.0) == ""
    assert "NTP" not in judged(source, 10.0, later_s=2.0)


@pytest.mark.parametrize("runs", [True, False], ids=["clock runs", "clock stands still"])
def test_repeated_stamp_ages_from_its_first_arrival(source, runs):
    """A simulator that has stopped may go on publishing."""

    def repeated(later_s):
        return source.trouble(NOW_S, NOW_S + (later_s if runs else 0.0), ARRIVED_S + later_s)

    assert repeated(0.0) == repeated(LIMIT_S) == ""
    assert source.made_s == ARRIVED_S
    assert f"{LIMIT_S + 0.01:.3f} s old" in repeated(LIMIT_S + 0.01)


def test_clock_that_was_set_back_is_followed(source):
    assert judged(source, 0.0) == ""
    assert source.trouble(NOW_S - 100.0, NOW_S - 100.0, ARRIVED_S + 1.0) == ""
