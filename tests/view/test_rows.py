"""The sections and rows of a live view."""

import math

import pytest

from mrl_driver.geometry import Pose
from mrl_driver.robot.odometry import OmniTwist, Twist
from mrl_driver.view.live_model import Shown
from mrl_driver.view.rows import sections
from mrl_driver.view.shown_state import Bar, Row, ShownState, line_of
from tests.models import model as load

STATE = ShownState(
    name="traxbot 1",
    model=load("traxbot"),
    pose=Pose(1.0, -0.25, math.pi / 2),
    twist=Twist(0.2, -0.5),
    command=Twist(0.25, 0.0),
    stop_reason="none",
    ranges={"right": 0.2, "front": math.inf, "left": math.nan, "rear": 1.5},
    sensors={"light": "500 count"},
    battery_v=11.4,
    battery_share=0.5,
    battery_state="low",
    board=[Row("faults", "none")],
    ready=True,
    age_s=0.012,
    errors=Row("errors", "0 lost, 0 bad"),
)


def told(state=STATE, delays_s=(math.nan,) * 3, **others):
    """Rows by section and name."""
    shown = Shown(state._replace(**others), 0.0, 0.0, 20.0, (), 3.2, "", delays_s=delays_s)
    return {section.title: {row.name: row for row in section.rows} for section in sections(shown)}


def test_a_board_without_motors_has_sensors_and_a_link():
    quiet = told(model=load("pioneer"), ranges={}, battery_v=math.nan, board=[])
    assert list(quiet) == ["sensors", "link"]


def test_motion_is_told_in_numbers_with_units():
    assert [row.value for row in told()["motion"].values()] == [
        "x +1.000  y -0.250 m",
        "+90.0 deg",
        "+0.200 m/s  -29 deg/s",
        "+0.250 m/s  +0 deg/s",
        "3.20 m",
    ]


def test_a_robot_that_moves_sideways_has_a_third_speed():
    asked = told(command=OmniTwist(0.1, 0.2, -0.3))["motion"]["asked"]
    assert asked.value == "+0.100 m/s  +11 deg/s  -0.300 m/s to the left"


def test_a_stopped_robot_says_why():
    asked = told(command=None, stop_reason="host_paused")["motion"]["asked"]
    assert asked == Row("asked", "stopped: the computer that drives the robot was too busy", "yellow")


def test_sonars_come_as_seen_from_above_with_bars():
    assert list(told()["sonars"].values()) == [
        Row("left", "no reading", bar=Bar(0.0, "cyan")),
        Row("front", "nothing", bar=Bar(1.0, "cyan")),
        Row("right", "0.20 m", bar=Bar(pytest.approx(0.0667, abs=1e-3), "red")),
        Row("rear", "1.50 m", bar=Bar(0.5, "cyan")),
    ]


def test_silence_is_told_in_red():
    assert told(ready=False, age_s=1.25)["link"]["state"] == Row(
        "state", "no telemetry for 1.2 s", "bold red"
    )


def test_the_speed_of_a_silent_robot_is_unknown():
    """A driver has zero then, which nobody has measured."""
    assert told(ready=False, twist=Twist(0.0, 0.0))["motion"]["speed"].value == "unknown"


def test_delays_are_told_by_their_parts():
    values = [told(delays_s=each)["link"]["delay"].value for each in ((0.042, 0.012, 0.03), (math.nan,) * 3)]
    assert values == ["42 ms: key 12, link 30", "unknown: key ?, link ?"]


def test_the_line_shows_no_sign_of_a_number_that_rounds_to_zero():
    state = STATE._replace(pose=Pose(0.0, -0.0004, -1e-9), twist=Twist(-0.0004, -0.0))
    assert "-" not in line_of(state)
