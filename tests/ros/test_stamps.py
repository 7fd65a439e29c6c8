"""Stamps of frames."""

from hypothesis import given, settings
from hypothesis import strategies as st

from ros1_bridge.topics.stamps import STEP_S, Stamps

WALL_S = 1.8e9
FLOAT_NS = 240
"""Step of a float at that time."""


def ns(stamp):
    return stamp[0] * 10**9 + stamp[1]


def test_stamp_is_the_wall_time_of_the_event():
    assert Stamps().next(1.5, 2.0, 1000.0) == (999, 500_000_000)


def test_two_frames_out_of_one_read_get_two_stamps():
    stamps = Stamps()
    first, second = (ns(stamps.next(1.0, 1.0, WALL_S)) for _ in range(2))
    assert abs(second - first - STEP_S * 1e9) <= FLOAT_NS


def test_clock_that_is_set_back_is_followed():
    stamps = Stamps()
    stamps.next(1.0, 1.0, WALL_S)
    assert stamps.next(1.0, 1.0, WALL_S - 3600) == (WALL_S - 3600, 0)


def test_simulated_time_that_stands_at_its_start_gives_stamps_too():
    stamps = Stamps()
    made = [ns(stamps.next(event_s, 3.0, 0.0)) for event_s in (0.0, 2.9, 3.0)]
    assert made == sorted(set(made)) and made[0] == 0


@settings(max_examples=50)
@given(st.lists(st.floats(0, 0.9), min_size=1))
def test_stamps_increase(events):
    """Whatever the jitter below a second."""
    stamps = Stamps()
    made = [ns(stamps.next(event_s, 1.0, WALL_S)) for event_s in events]
    assert all(before < after for before, after in zip(made, made[1:]))
