"""The age of a page's messages without a common clock."""

import math
import time
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.apps.web.freshness import DEAF_S, WINDOW_S, Freshness
from mrl_driver.safety.message_age import clock_s
from mrl_driver.safety.operator_delay import DRIFT

AHEAD_S = -1234.5  # The page's clock is this far ahead of the server's


def age_s(freshness, sent_s, heard_s, heard_at_s, now_s, ahead_s=AHEAD_S):
    """All times are the server's."""
    return freshness.age_s(sent_s + ahead_s, heard_s, heard_at_s + ahead_s, now_s)


def test_the_age_is_the_way_there_and_the_shortest_way_back():
    assert age_s(Freshness(), sent_s=10.05, heard_s=10.0, heard_at_s=10.02, now_s=10.08) == pytest.approx(
        0.03 + 0.02, abs=1e-3
    )


def test_it_is_forgotten_after_ten_seconds():
    freshness = Freshness()
    age_s(freshness, 10.0, 9.9, 9.901, 10.0)
    assert age_s(freshness, 20.0, 19.8, 19.9, 20.0) == pytest.approx(0.1, abs=1e-3)
    assert WINDOW_S == 10.0


@pytest.mark.parametrize("heard_s, heard_t_s", [(None, None), (9.9, None), (None, 9.9)])
def test_a_page_that_has_heard_nothing_has_no_age(heard_s, heard_t_s):
    assert Freshness().age_s(10.0, heard_s, heard_t_s, 10.0) == math.inf


def test_a_page_that_has_heard_nothing_for_two_seconds_has_no_age():
    freshness = Freshness()
    assert age_s(freshness, 11.9, 10.0, 10.0, 11.9) < 0.01
    assert age_s(freshness, 12.1, 10.0, 10.0, 12.1) == math.inf
    assert DEAF_S == 2.0


def test_a_clock_that_jumps_forward_makes_no_message_younger_for_long():
    """Once it shows, all that was known before is forgotten."""
    freshness = Freshness()
    age_s(freshness, 10.0, 9.99, 9.99, 10.0)
    assert age_s(freshness, 10.1, 10.0, 10.0, 10.1, AHEAD_S + 1.0) == math.inf
    assert age_s(freshness, 10.2, 10.11, 10.11, 10.3, AHEAD_S + 1.0) == pytest.approx(0.1, abs=1e-3)


def test_a_clock_that_stood_still_is_a_late_message_until_something_is_heard():
    freshness = Freshness()
    age_s(freshness, 10.0, 9.99, 9.99, 10.0)
    assert freshness.age_s(10.5 + AHEAD_S, 10.0, 10.0 + AHEAD_S, 11.0) == pytest.approx(0.5, abs=0.01)
    assert age_s(freshness, 11.1, 11.05, 11.05, 11.1, AHEAD_S - 0.5) < 0.01


@pytest.mark.parametrize("early_s, expected_s", [(0.019, 0.0), (0.021, math.inf)])
def test_a_clock_that_is_20_ms_coarse_still_has_an_age(early_s, expected_s):
    assert age_s(Freshness(), 10.0, 9.99, 9.99 - early_s, 10.0) == expected_s


def test_the_clock_goes_on_while_the_computer_is_suspended(monkeypatch):
    """Or a burst of commands from before would look fresh."""
    clocks = []
    monkeypatch.setattr(time, "clock_gettime", lambda clock: clocks.append(clock) or 7.0)
    assert clock_s() == 7.0 and clocks == [time.CLOCK_BOOTTIME]


WAY_S = st.floats(0.0, 0.4)
STEPS = st.lists(st.tuples(st.floats(0.0, 1.0), WAY_S, WAY_S, st.floats(0.0, 0.1)), min_size=1, max_size=30)


@given(STEPS, st.floats(-1e6, 1e6), st.floats(-DRIFT, DRIFT))
def test_no_message_is_older_than_its_age_says(steps, ahead_s, drift):
    """Whatever the two clocks are set to, with the largest drift between them."""
    freshness, start_s = Freshness(), 1000.0

    def page_s(time_s):
        return time_s + ahead_s + drift * (time_s - start_s)

    now_s = start_s
    for wait_s, down_s, up_s, hold_s in steps:
        made_s = now_s + wait_s
        sent_s = made_s + down_s + hold_s
        now_s = sent_s + up_s
        said_s = freshness.age_s(page_s(sent_s), made_s, page_s(made_s + down_s), now_s)
        assert said_s >= up_s * (1 - 2 * DRIFT) - 1e-6


def test_many_echoes_take_no_memory():
    """A page that echoes worse and worse times, as fast as it can."""
    freshness = Freshness()
    tracemalloc.start()
    for step in range(20000):
        time_s = 10.0 + step * 1e-4
        freshness.age_s(time_s, time_s, time_s - 1 + step * 1e-6, 12.0)
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert taken < 100_000
