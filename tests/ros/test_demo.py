"""The pure parts of the demonstration: square, keys, trail, text."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.navigation.line_follower import FollowerLimits, Square
from mrl_driver.terminal.teleop_keys import ANGULAR_RAD_S, HOLD_S, LINEAR_M_S, Teleop
from ros1_bridge.demo.braille_path import ARROWS, draw
from ros1_bridge.demo.report import Recorder, line, range_text, summary

STEP_S = 0.05
LAG = 0.4
"""Share of the difference to the commanded speed that the wheels of the test's robot make up in one step."""
CORNER_M = 0.006


def drive_square(start, rounds=1):
    """Positions at which a robot with lag reached the corners of its square."""
    square, (x, y, yaw), (v, w), reached = Square(1.0, FollowerLimits()), start, (0.0, 0.0), []
    for _ in range(int(rounds * 60 / STEP_S)):
        corner = square.corner
        wanted = square.command((x, y, yaw))
        if square.corner > corner:
            reached.append((x, y))
        if square.corner == 4 * rounds:
            return reached
        v, w = v + LAG * (wanted[0] - v), w + LAG * (wanted[1] - w)
        x, y, yaw = x + v * math.cos(yaw) * STEP_S, y + v * math.sin(yaw) * STEP_S, yaw + w * STEP_S
    raise AssertionError(f"only {square.corner} corners in time")


def test_square_reaches_its_corners_exactly():
    corners = [(1, 0), (1, 1), (0, 1), (0, 0)]
    for got, wanted in zip(drive_square((0.0, 0.0, 0.0)), corners):
        assert math.dist(got, wanted) < CORNER_M


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-math.pi, math.pi))
def test_square_starts_from_any_pose(x, y, yaw):
    last = drive_square((x, y, yaw))[-1]
    assert math.dist(last, (x, y)) < CORNER_M


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-math.pi, math.pi))
def test_square_never_exceeds_its_limits(x, y, yaw):
    square = Square()
    square.command((0.0, 0.0, 0.0))
    linear, angular = square.command((x, y, yaw))
    assert 0 <= linear <= FollowerLimits().linear_m_s
    assert abs(angular) <= FollowerLimits().angular_rad_s


def test_key_drives_until_it_is_released():
    teleop = Teleop()
    teleop.press("w", 0.0)
    assert teleop.command(HOLD_S - 0.01) == (LINEAR_M_S, 0.0)
    assert teleop.command(HOLD_S) == (0.0, 0.0)


def test_two_keys_drive_a_curve():
    teleop = Teleop()
    teleop.press("w", 0.0)
    teleop.press("d", 0.1)
    assert teleop.command(0.2) == (LINEAR_M_S, -ANGULAR_RAD_S)


def test_opposite_key_takes_over():
    teleop = Teleop()
    teleop.press("w", 0.0)
    teleop.press("down", 0.1)
    assert teleop.command(0.2) == (-LINEAR_M_S, 0.0)


def test_space_stops_at_once():
    teleop = Teleop()
    teleop.press("w", 0.0)
    assert teleop.press("space", 0.1)
    assert teleop.command(0.1) == (0.0, 0.0)


@given(st.lists(st.tuples(st.floats(-100, 100), st.floats(-100, 100)), max_size=20), st.floats(-10, 10))
def test_trail_fills_its_frame_and_shows_the_robot(points, yaw):
    lines = draw(points, (0.0, 0.0, yaw), 30, 10)
    assert [len(text) for text in lines] == [30] * 10
    assert sum(text.count(arrow) for text in lines for arrow in ARROWS) == 1


def test_arrow_points_where_the_robot_looks():
    assert any("↑" in text for text in draw([], (0.0, 0.0, math.pi / 2), 10, 5))


@pytest.mark.parametrize(
    "value, text", [(1.234, "1.23 m"), (math.inf, "clear"), (-math.inf, "near"), (math.nan, "--")]
)
def test_range_in_words(value, text):
    assert range_text(value) == text


def recorded():
    recorder = Recorder()
    for i in range(3):
        recorder.add_odometry((0.1 * i, 0.0, 0.0), (0.25, 0.0), 10.0 + 0.02 * i)
    recorder.link = {"Errors": "2"}
    return recorder.snapshot("square", 10.04)


def test_distance_is_the_length_of_the_path():
    assert recorded().distance_m == pytest.approx(0.2)


def test_summary_has_pose_distance_frames_and_errors():
    text = summary(recorded())
    assert "x +0.200 m" in text and "distance 0.200 m" in text
    assert "3 odometry frames" in text and "2 link errors" in text


def test_line_is_one_line():
    assert "\n" not in line(recorded())


def test_line_before_the_first_odometry_says_so():
    assert line(Recorder().snapshot("stopped", 0.0)) == "waiting for odometry"
