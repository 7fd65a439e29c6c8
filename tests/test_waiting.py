"""When runs that are repeated may end: limits in real time rest on it."""

import pytest

from tests.waiting import is_decided


@pytest.mark.parametrize(
    "took_s, decided",
    [([], False), ([1, 1], False), ([1, 9, 1, 9], False), ([1, 1, 1], True), ([9, 1, 9, 9], True)],
)
def test_a_median_of_five_is_decided_once_three_are_on_one_side_of_the_limit(took_s, decided):
    assert is_decided(took_s, 1.0, 5) is decided
