"""Reads worlds from files: a short YAML, or a map_server map.

start: [0, 0, 90]                    # x m, y m, yaw deg; optional like all the rest
walls: [[-2, -2, 2, -2]]             # from x, y to x, y [m]
boxes: [[1, 0.5, 0.4, 0.2, 30]]      # middle x, y, length, width [m], yaw [deg]
robots: {two: [0.5, -1, 180]}        # name: x, y [m], yaw [deg], optional model; a board with this name starts there
north: 90                            # direction of north from x, counter-clockwise [deg]
ambient: {temperature: 22, alcohol: 900, dust: 300, light: 500}
heat: [[1, 1, 60, 0.1]]              # x, y [m], temperature [degC], radius [m]
gas: [[1, 1, 300, 0.5]]              # x, y [m], ADC count of the alcohol sensor there, reach [m]
dust: [[1, 1, 9000, 0.8]]            # x, y [m], particles per litre there, reach [m]
light: [[1, 1, 900, 0.8]]            # x, y [m], ADC count of the light sensor there, reach [m]
map: lab.yaml                        # additional walls from a map_server map

If you have added sensors to the table, each is a key of `ambient` and a key for its sources.
"""

import math
import os
from typing import Any, List, Mapping, Optional, Sequence, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from mrl_driver.yaml_file import Reader, is_number, read_expected
from sim_arduino.world.environment import OTHERS, PIXELS, Environment

from .robots import NAME, NAME_TEXT, Mover
from .scene import Scene, Source
from .shapes import Footprint, Wall, polygon
from .world import World

_FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "worlds")
FAR_M = 1000.0
_FIRST_MODEL = "traxbot"
_OTHERS = {row.name: row.fields[0] for row in OTHERS}
KEYS = (
    "start",
    "walls",
    "boxes",
    "robots",
    "north",
    "ambient",
    "heat",
    "gas",
    "dust",
    "light",
    "map",
    *_OTHERS,
)
_COORDINATE = (-FAR_M, FAR_M)
_SIZE = (0.001, FAR_M)
_ANGLE = (-360.0, 360.0)
_RANGES = {"temperature": (0.0, 255.0), "alcohol": (0, 1023), "dust": (0, 32767), "light": (0, 1023)}
_RANGES.update({name: (field.low * field.scale, field.high * field.scale) for name, field in _OTHERS.items()})
_SOURCES = {"heat": "temperature", "gas": "alcohol", "dust": "dust", "light": "light"}
"""Keys of sources, and the ambient key with the same range of values."""
_Limits = Sequence[Tuple[float, float]]


def names() -> List[str]:
    """Names of the packaged worlds."""
    return sorted(f[:-5] for f in os.listdir(_FOLDER) if f.endswith(".yaml"))


def load(name_or_path: str = "room") -> World:
    """The packaged world with this name, or the world in a YAML file; a YAML with the key `image` is a map_server map.

    Raises:
        ConfigError: the world does not exist, or a key is misspelt, of the wrong type or out of range.
    """
    path = name_or_path
    if not path.endswith((".yaml", ".yml")):
        path = os.path.join(_FOLDER, f"{name_or_path}.yaml")
    if not os.path.isfile(path):
        raise ConfigError(
            f"world {name_or_path!r} is unknown, expected {', '.join(names())} or the path of a .yaml file"
        )
    data = read_expected(path, "a world as YAML")
    if isinstance(data, dict) and "image" in data:
        walls = _map_walls(path, data)
        world = World(walls)
        world.solids = [walls]
        return world
    return _Reader(path, data).world()


def _map_walls(path: str, data: Mapping[str, Any]) -> List[Wall]:
    from . import grid_map

    return grid_map.walls_of(grid_map.read(path, data))


class _Reader(Reader):
    """Reads a world from parsed YAML."""

    def __init__(self, path: str, data: Any) -> None:
        super().__init__(path)
        self.mapping("", data, f"the keys {', '.join(KEYS)}")
        self._data = self.keys("", data, KEYS, KEYS)

    def world(self) -> World:
        """The world in the file."""
        walls = [Wall(*row) for row in self._rows("walls", "x1, y1, x2, y2", [_COORDINATE] * 4)]
        limits = [_COORDINATE, _COORDINATE, _SIZE, _SIZE, _ANGLE]
        solids = [_sides(*row) for row in self._rows("boxes", "x, y, length, width, yaw", limits)]
        solids.append(self._map())
        walls += [side for solid in solids for side in solid]
        start = self._numbers(
            "start", self._get("start", [0, 0, 0]), "x, y, yaw", [_COORDINATE, _COORDINATE, _ANGLE]
        )
        world = World(walls, Pose(start[0], start[1], math.radians(start[2])), self._scene())
        world.solids = solids
        world.standing = {mover.name: mover for mover in self._robots()}
        return world

    def _robots(self) -> List[Mover]:
        found = self._get("robots", {})
        self.mapping("robots", found, "names with [x, y, yaw] or [x, y, yaw, model]")
        return [self._robot(str(name), row) for name, row in found.items()]

    def _robot(self, name: str, row: Any) -> Mover:
        key, model = f"robots.{name}", _FIRST_MODEL
        if not NAME.fullmatch(name):
            raise self.fail(key, row, f"as its name {NAME_TEXT}")
        if isinstance(row, list) and len(row) == 4:
            *row, model = row
        if not isinstance(model, str):
            raise self.fail(key, model, f"as its model one of {', '.join(models.names())}, or a file")
        x, y, yaw = self._numbers(key, row, "x, y, yaw", [_COORDINATE, _COORDINATE, _ANGLE])
        try:
            there = models.load(model)
            there.require_motors()
        except ConfigError as error:
            raise ConfigError(f"{self.path}: {key}: {error}") from None
        return Mover(name, Pose(x, y, math.radians(yaw)), Footprint(there.body.length_m, there.body.width_m))

    def _scene(self) -> Scene:
        north = self.number("north", self._get("north", 90.0), *_ANGLE)
        sources = {key: self._sources(key, _RANGES[unit]) for key, unit in _SOURCES.items()}
        others = {name: self._sources(name, _RANGES[name]) for name in _OTHERS}
        return Scene(
            self._ambient(),
            north_rad=math.radians(north),
            others={name: found for name, found in others.items() if found},
            **sources,
        )

    def _ambient(self) -> Environment:
        found = self._get("ambient", {})
        self.mapping("ambient", found, f"the keys {', '.join(_RANGES)}")
        self.keys("ambient", found, tuple(_RANGES), _RANGES)
        usual = Environment()
        defaults = (usual.ambient_c, usual.alcohol_count, usual.dust_pcs_l, usual.light_count)
        temperature, alcohol, dust, light, *others = (
            self.number(f"ambient.{key}", found.get(key, default), *_RANGES[key])
            for key, default in zip(_RANGES, (*defaults, *usual.others.values()))
        )
        pixels, named = (temperature,) * PIXELS, dict(zip(usual.others, others))
        return Environment(round(alcohol), round(light), dust, temperature, pixels, named)

    def _sources(self, key: str, values: Tuple[float, float]) -> Tuple[Source, ...]:
        rows = self._rows(key, "x, y, value, reach", [_COORDINATE, _COORDINATE, values, _SIZE])
        return tuple(Source(*row) for row in rows)

    def _map(self) -> List[Wall]:
        name = self._get("map", "")
        if not isinstance(name, str):
            raise self.fail("map", name, "the name of a map_server YAML")
        if not name:
            return []
        path = os.path.join(os.path.dirname(self.path), name)
        from . import grid_map

        return grid_map.walls_of(grid_map.load(path))

    def _get(self, key: str, default: Any) -> Any:
        value = self._data.get(key)
        return default if value is None else value

    def _rows(self, key: str, meaning: str, limits: _Limits) -> List[List[float]]:
        rows = self._get(key, [])
        if not isinstance(rows, list):
            raise self.fail(key, rows, f"a list of [{meaning}]")
        return [self._numbers(f"{key}[{i}]", row, meaning, limits) for i, row in enumerate(rows)]

    def _numbers(self, key: str, row: Any, meaning: str, limits: _Limits) -> List[float]:
        if not isinstance(row, list) or len(row) != len(limits):
            raise self.fail(key, row, f"[{meaning}], {len(limits)} numbers")
        for part, value, (low, high) in zip(meaning.split(", "), row, limits):
            if not is_number(value, low, high):
                raise self.fail(key, row, f"[{meaning}] with {part} a number from {low:g} to {high:g}")
        return [float(value) for value in row]


def _sides(x: float, y: float, length: float, width: float, yaw_deg: float) -> List[Wall]:
    middle = Pose(x, y, math.radians(yaw_deg))
    corners = ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))
    return polygon([middle.compose(a * length, b * width)[:2] for a, b in corners])


def parse_pose(text: Optional[str], default: Pose) -> Pose:
    """`X,Y,YAW` in metres and degrees, or `default` for None.

    Raises:
        ConfigError: `text` is something else.
    """
    if text is None:
        return default
    try:
        x, y, yaw = (float(part) for part in text.split(","))
    except ValueError:
        x = y = yaw = math.nan
    if not all(is_number(value, *_COORDINATE) for value in (x, y, yaw)):
        raise ConfigError(f"pose is {text!r}, expected X,Y,YAW in metres and degrees, such as 0.5,0,90")
    return Pose(x, y, math.radians(yaw))


def pose_text(pose: Pose) -> str:
    """The pose as `parse_pose` takes it, to 0.1 mm and 0.001 degrees."""
    return f"{pose.x_m:.4f},{pose.y_m:.4f},{math.degrees(pose.yaw_rad):.3f}"
