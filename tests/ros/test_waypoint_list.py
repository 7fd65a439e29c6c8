"""Lists of waypoints as parameters."""

import math

import pytest

from mrl_driver.errors import ConfigError
from ros1_bridge.navigation.follow_waypoints_node import read_names, read_numbers, read_waypoints


def test_a_list_is_read_in_metres_and_degrees():
    assert read_waypoints([[1, 2.5, 90]], "~waypoints") == [(1.0, 2.5, math.pi / 2)]


@pytest.mark.parametrize("rows", [None, "1 2 3", [[1, 2]], [[1, 2, math.nan]], [[1, 2, "3"]], [[1, 2, True]]])
def test_a_wrong_list_is_refused_in_one_line(rows):
    with pytest.raises(ConfigError, match=r"~waypoints.* is .*, expected .*x m, y m, yaw deg") as caught:
        read_waypoints(rows, "~waypoints")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text, places", [("", set()), ("1", {0}), ("1, 4", {0, 3})])
def test_waypoint_numbers_are_read_from_one(text, places):
    assert read_numbers(text, "~shared") == places


@pytest.mark.parametrize("text", ["0", "1;2", "-1", "1,", "a"])
def test_other_waypoint_numbers_are_refused(text):
    with pytest.raises(ConfigError, match="~shared is .*, expected waypoint numbers from 1"):
        read_numbers(text, "~shared")


def test_names_of_a_team_are_read():
    assert read_names("a, b,c", "b", "~team") == ["a", "b", "c"]


@pytest.mark.parametrize("text", ["", "b", "a,c"])
def test_team_without_this_robot_or_without_others_is_refused(text):
    with pytest.raises(ConfigError, match="~team is .*, expected all robots .*, b among them"):
        read_names(text, "b", "~team")
