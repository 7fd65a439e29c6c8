"""Courses along straight legs: the ends of legs that have no length."""

import math

import pytest

from mrl_driver.navigation.line_follower import Course

HERE = (2.0, 1.0, math.pi / 2)
"""A robot that looks to the left of the x axis."""


@pytest.mark.parametrize("points", [[(2.0, 1.0), (2.0, 3.0)], [(2.0, 1.001), (2.0, 1.0), (2.0, 3.0)]])
def test_leg_without_length_is_passed_without_a_turn(points):
    course = Course(points)
    speeds = [course.command(HERE) for _ in range(5)]
    assert all(abs(angular) < 1e-9 for _, angular in speeds) and speeds[-1][0] > 0


def test_course_that_ends_where_it_begins_is_done_at_once():
    course = Course([HERE[:2]])
    assert [course.command(HERE) for _ in range(2)] == [(0.0, 0.0)] * 2 and course.done
