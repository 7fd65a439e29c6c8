"""Walls and boxes, read from a short YAML, and what a sonar sees of them.

start: [0, 0, 90]              # x m, y m, yaw deg; optional
walls: [[-2, -2, 2, -2]]       # from x, y to x, y [m]
boxes: [[1, 0.5, 0.4, 0.2, 30]]  # middle x, y, length, width [m], yaw [deg]
"""

import math
import os
from typing import Any, List, NamedTuple, Optional, Sequence

import yaml

from mrl_driver.errors import ConfigError

_FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "worlds")
_KEYS = ("start", "walls", "boxes")
_FAR_M = 1000.0


class Pose(NamedTuple):
    """Where something stands in the world: metres, and radians counter-clockwise from x."""

    x_m: float
    y_m: float
    yaw_rad: float


ORIGIN = Pose(0.0, 0.0, 0.0)


class Wall(NamedTuple):
    """A straight wall between two points [m]."""

    x1: float
    y1: float
    x2: float
    y2: float


class World:
    """Walls, and the pose at which a robot starts."""

    def __init__(self, walls: Sequence[Wall] = (), start: Pose = ORIGIN) -> None:
        self.walls = list(walls)
        self.start = start

    def nearest(self, pose: Pose, half_angle_rad: float, range_m: float) -> float:
        """Distance from `pose` to the nearest point of any wall inside a cone along its x [m]; infinite if none
        is within `range_m`.

        Exact for the flat cone: an echo comes from the nearest surface, and nothing nearer can hide it.
        """
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        slope = math.tan(half_angle_rad)
        least = range_m * range_m
        for x1, y1, x2, y2 in self.walls:
            dx, dy = x1 - pose.x_m, y1 - pose.y_m
            u, v = cos * dx + sin * dy, cos * dy - sin * dx
            dx, dy = x2 - x1, y2 - y1
            du, dv = cos * dx + sin * dy, cos * dy - sin * dx
            least = min(least, _in_cone(u, v, du, dv, slope))
        return math.sqrt(least) if least < range_m * range_m else math.inf


def _in_cone(u: float, v: float, du: float, dv: float, slope: float) -> float:
    """Squared distance from the origin to the part of the segment (u, v) + t (du, dv) where |v| <= slope u."""
    low, high = 0.0, 1.0
    for base, change in ((slope * u - v, slope * du - dv), (slope * u + v, slope * du + dv)):
        if base < 0.0 and base + change < 0.0:
            return math.inf
        if base < 0.0:
            low = max(low, -base / change)
        elif base + change < 0.0:
            high = min(high, -base / change)
    length2 = du * du + dv * dv
    if low > high or length2 == 0.0:
        return math.inf
    t = min(high, max(low, -(u * du + v * dv) / length2))
    return (u + t * du) ** 2 + (v + t * dv) ** 2


def names() -> List[str]:
    """Names of the worlds that come with the package."""
    return sorted(f[:-5] for f in os.listdir(_FOLDER) if f.endswith(".yaml"))


def load(name_or_path: str = "room") -> World:
    """The world of that name, or in that YAML file.

    Raises:
        ConfigError: no such world, or a key is misspelt, of the wrong type or out of range.
    """
    path = name_or_path
    if not path.endswith((".yaml", ".yml")):
        path = os.path.join(_FOLDER, f"{name_or_path}.yaml")
    try:
        with open(path, encoding="utf-8") as file:
            data = yaml.safe_load(file)
    except OSError:
        raise ConfigError(
            f"world {name_or_path!r} is unknown, expected {', '.join(names())} or the path of a .yaml file"
        ) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: no YAML: {' '.join(str(error).split())}") from None
    return _read(path, data)


def _read(path: str, data: Any) -> World:
    if not isinstance(data, dict):
        raise ConfigError(f"{path}: file is {data!r}, expected the keys {', '.join(_KEYS)}")
    for key in data:
        if key not in _KEYS:
            raise ConfigError(f"{path}: key {key} is unknown, expected {', '.join(_KEYS)}")
    walls = [Wall(*row) for row in _rows(path, "walls", data, "from x, y to x, y", 4)]
    for row in _rows(path, "boxes", data, "x, y, length, width, yaw", 5):
        walls += _sides(*row)
    start = _numbers(path, "start", data.get("start", [0, 0, 0]), "x, y, yaw", 3)
    return World(walls, Pose(start[0], start[1], math.radians(start[2])))


def _rows(path: str, key: str, data: Any, meaning: str, count: int) -> List[List[float]]:
    rows = data.get(key) or []
    if not isinstance(rows, list):
        raise ConfigError(f"{path}: {key} is {rows!r}, expected a list of [{meaning}]")
    return [_numbers(path, f"{key}[{i}]", row, meaning, count) for i, row in enumerate(rows)]


def _numbers(path: str, key: str, row: Any, meaning: str, count: int) -> List[float]:
    if not isinstance(row, list) or len(row) != count or not all(map(_is_number, row)):
        raise ConfigError(
            f"{path}: {key} is {row!r}, expected [{meaning}], {count} numbers from {-_FAR_M:g} to {_FAR_M:g}"
        )
    return [float(value) for value in row]


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= _FAR_M


def _sides(x: float, y: float, length: float, width: float, yaw_deg: float) -> List[Wall]:
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    half = ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))
    corners = [
        (x + cos * a * length - sin * b * width, y + sin * a * length + cos * b * width) for a, b in half
    ]
    return [Wall(*corners[i - 1], *corners[i]) for i in range(4)]


def parse_pose(text: Optional[str], default: Pose) -> Pose:
    """`X,Y,YAW` in metres and degrees, or `default` for None.

    Raises:
        ConfigError: it is something else.
    """
    if text is None:
        return default
    try:
        x, y, yaw = (float(part) for part in text.split(","))
    except ValueError:
        x = y = yaw = math.nan
    if not all(map(_is_number, (x, y, yaw))):
        raise ConfigError(f"pose is {text!r}, expected X,Y,YAW in metres and degrees, such as 0.5,0,90")
    return Pose(x, y, math.radians(yaw))
