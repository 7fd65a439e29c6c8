"""Lists of waypoints, and of the robots that share some of them, as parameters.  No ROS."""

import math
from typing import Any, FrozenSet, List

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.yaml_file import is_number
from ros1_bridge.node.plane_poses import FARTHEST_M


def read_waypoints(rows: Any, key: str) -> List[Pose]:
    """Poses of a list of [x m, y m, yaw deg]; `key` is its name in errors.

    Raises:
        ConfigError: it is something else.
    """
    if not isinstance(rows, list):
        raise ConfigError(f"parameter {key} is {rows!r}, expected a list of [x m, y m, yaw deg]")
    return [_waypoint(f"{key}[{index}]", row) for index, row in enumerate(rows)]


def _waypoint(key: str, row: Any) -> Pose:
    good = isinstance(row, list) and len(row) == 3
    if not good or not all(is_number(each, -FARTHEST_M, FARTHEST_M) for each in row):
        raise ConfigError(f"parameter {key} is {row!r}, expected [x m, y m, yaw deg], three finite numbers")
    return Pose(float(row[0]), float(row[1]), math.radians(row[2]))


def read_numbers(text: str, key: str) -> FrozenSet[int]:
    """Places from 0 of waypoint numbers from 1, separated by commas; none if the text is empty.

    Raises:
        ConfigError: it is something else.
    """
    words = [word.strip() for word in text.split(",")] if text else []
    if not all(word.isdecimal() and int(word) for word in words):
        raise ConfigError(f"parameter {key} is {text!r}, expected waypoint numbers from 1, such as 1 or 1,2")
    return frozenset(int(word) - 1 for word in words)


def read_names(text: str, own: str, key: str) -> List[str]:
    """Names of the robots of a team, separated by commas; one of them is `own`.

    Raises:
        ConfigError: there are fewer than two, or `own` is not among them.
    """
    names = [word.strip() for word in text.split(",")]
    if len(names) < 2 or own not in names:
        raise ConfigError(
            f"parameter {key} is {text!r}, expected all robots that share the waypoint, {own or 'this one'} among them"
        )
    return names
