"""Reads worlds from files: a short YAML, whose keys are in sim_arduino/README.md, or a map_server map.

Sensors that are added to the table are each a key of `ambient`, and a key for its sources.
"""

import math
import os
from typing import Any, List, Mapping, Optional

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from mrl_driver.yaml_file import Reader, is_number, read_expected
from mrl_driver.yaml_form import Condition, Form, Keys, Number, Numbers, Rows, Schema

from .robots import NAME, NAME_TEXT, Mover
from .scene import OTHERS, PIXELS, Environment, Scene, Source
from .shapes import Footprint, Wall
from .world import World

_FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "worlds")
SCHEMA = os.path.join(os.path.dirname(_FOLDER), "world.schema.json")
"""Path of the JSON Schema of a world's file; rendered by `make generate`."""
FAR_M = 1000.0
_FIRST_MODEL = "traxbot"
_OTHERS = {row.name: row.fields[0] for row in OTHERS}
_COORDINATE = (-FAR_M, FAR_M)
_SIZE = (0.001, FAR_M)
_ANGLE = (-360.0, 360.0)
_RANGES = {"temperature": (0.0, 255.0), "alcohol": (0, 1023), "dust": (0, 32767), "light": (0, 1023)}
_RANGES.update({name: (field.low * field.scale, field.high * field.scale) for name, field in _OTHERS.items()})
_SOURCES = {
    "heat": "temperature",
    "gas": "alcohol",
    "dust": "dust",
    "light": "light",
    **{name: name for name in _OTHERS},
}
"""Keys of sources, and the ambient key with the same range of values."""
_POSE = Numbers(x=_COORDINATE, y=_COORDINATE, yaw=_ANGLE)


class _Robots(Form):
    """Robots by name.  Only `read` checks that there is such a model, and that it has motors."""

    _EXPECTED = "names with [x, y, yaw] or [x, y, yaw, model]"

    def read(self, reader: Reader, key: str, value: Any) -> List[Mover]:
        found = reader.mapping(key, value, self._EXPECTED)
        return [self._robot(reader, f"{key}.{name}", str(name), row) for name, row in found.items()]

    def _robot(self, reader: Reader, key: str, name: str, row: Any) -> Mover:
        model = _FIRST_MODEL
        if not NAME.fullmatch(name):
            raise reader.fail(key, row, f"as its name {NAME_TEXT}")
        if isinstance(row, list) and len(row) == 4:
            *row, model = row
        if not isinstance(model, str):
            raise reader.fail(key, model, f"as its model one of {', '.join(models.names())}, or a file")
        x, y, yaw = _POSE.read(reader, key, row)
        try:
            there = models.load(model)
            there.require_motors()
        except ConfigError as error:
            raise ConfigError(f"{reader.path}: {key}: {error}") from None
        return Mover(name, Pose(x, y, math.radians(yaw)), Footprint(there.body.length_m, there.body.width_m))

    def schema(self) -> Schema:
        pose = _POSE.schema()
        model = {"type": "string", "description": "model", "examples": models.packaged()}
        row = {**pose, "items": [*pose["items"], model], "maxItems": 4}
        return {
            "type": "object",
            "patternProperties": {f"^{NAME.pattern}$": row},
            "additionalProperties": False,
        }


class _Map(Form):
    """The walls of a map_server map.  Only `read` opens its YAML and its picture."""

    def read(self, reader: Reader, key: str, value: Any) -> List[Wall]:
        if not isinstance(value, str):
            raise reader.fail(key, value, "the name of a map_server YAML")
        if not value:
            return []
        from . import grid_map

        return grid_map.walls_of(grid_map.load(os.path.join(os.path.dirname(reader.path), value)))

    def schema(self) -> Schema:
        return {"type": "string"}


def _sources(key: str) -> Rows:
    return Rows(Numbers(x=_COORDINATE, y=_COORDINATE, value=_RANGES[_SOURCES[key]], reach=_SIZE))


_FORMS: Mapping[str, Form] = {
    "start": _POSE,
    "walls": Rows(Numbers(x1=_COORDINATE, y1=_COORDINATE, x2=_COORDINATE, y2=_COORDINATE)),
    "boxes": Rows(Numbers(x=_COORDINATE, y=_COORDINATE, length=_SIZE, width=_SIZE, yaw=_ANGLE)),
    "robots": _Robots(),
    "north": Number(*_ANGLE),
    "ambient": Keys(
        {name: Number(*limits) for name, limits in _RANGES.items()},
        _RANGES,
        expected=f"the keys {', '.join(_RANGES)}",
    ),
    **{key: _sources(key) for key in ("heat", "gas", "dust", "light")},
    "map": _Map(),
    **{name: _sources(name) for name in _OTHERS},
}
_TEXTS = {
    "start": "Where a robot starts: x, y [m], yaw [deg].",
    "walls": "Each from x1, y1 to x2, y2 [m].",
    "boxes": "Each with x, y of its middle, length, width [m], yaw [deg].",
    "robots": "By name: x, y [m], yaw [deg] and maybe a model; a board of that name starts there.",
    "north": "Direction of north from x, counter-clockwise [deg].",
    "ambient": "Temperature [degC], ADC counts of alcohol and light, dust [pcs/l], and the sensors that were added.",
    "heat": "Each with x, y [m], temperature [degC], radius [m].",
    "gas": "Each with x, y [m], ADC count of the alcohol sensor there, reach [m].",
    "dust": "Each with x, y [m], particles per litre there, reach [m].",
    "light": "Each with x, y [m], ADC count of the light sensor there, reach [m].",
    "map": "Name of a map_server YAML with additional walls.",
}
KEYS = tuple(_FORMS)


class WorldFile(Form):
    """A world, or with the key `image` a map_server map.

    All keys of a world are optional, and a key without a value counts as left out.
    """

    _KEYS = Keys(_FORMS, KEYS, _TEXTS, f"the keys {', '.join(KEYS)}", or_null=True)

    def read(self, reader: Reader, key: str, value: Any) -> World:
        """Return the world."""
        if isinstance(value, dict) and "image" in value:
            from . import grid_map

            world = World(grid_map.walls_of(grid_map.read(reader.path, value)))
            world.solids = [world.walls]
            return world
        found = self._KEYS.read(reader, key, value)
        walls = [Wall(*row) for row in found.get("walls", ())]
        boxes = found.get("boxes", ())
        solids = [Footprint(*size).outline(Pose(x, y, math.radians(yaw))) for x, y, *size, yaw in boxes]
        solids.append(found.get("map", []))
        walls += [side for solid in solids for side in solid]
        x, y, yaw = found.get("start", (0.0, 0.0, 0.0))
        world = World(walls, Pose(x, y, math.radians(yaw)), _scene(found))
        world.solids = solids
        world.standing = {mover.name: mover for mover in found.get("robots", ())}
        return world

    def schema(self) -> Schema:
        """Return the JSON Schema of a world's file."""
        from . import grid_map

        return {
            "type": "object",
            "if": Condition(("image",)).schema(),
            "then": grid_map.FORM.schema(),
            "else": self._KEYS.schema(),
        }


def _scene(found: Mapping[str, Any]) -> Scene:
    sources = {key: tuple(Source(*row) for row in found.get(key, ())) for key in _SOURCES}
    own = {key: sources[key] for key in ("heat", "gas", "dust", "light")}
    others = {name: sources[name] for name in _OTHERS if sources[name]}
    north_rad = math.radians(found.get("north", 90.0))
    return Scene(_ambient(found.get("ambient", {})), north_rad=north_rad, others=others, **own)


def _ambient(found: Mapping[str, float]) -> Environment:
    usual = Environment()
    temperature = found.get("temperature", usual.ambient_c)
    return Environment(
        round(found.get("alcohol", usual.alcohol_count)),
        round(found.get("light", usual.light_count)),
        found.get("dust", usual.dust_pcs_l),
        temperature,
        (temperature,) * PIXELS,
        {name: found.get(name, value) for name, value in usual.others.items()},
    )


def names() -> List[str]:
    """Names of the packaged worlds."""
    return sorted(f[:-5] for f in os.listdir(_FOLDER) if f.endswith(".yaml"))


def load(name_or_path: str = "room") -> World:
    """The packaged world with this name, or the world in a YAML file; a YAML with the key `image` is a map_server map.

    ConfigError if it does not exist, or a key is misspelt, of the wrong type or out of range.
    """
    path = name_or_path
    if not path.endswith((".yaml", ".yml")):
        path = os.path.join(_FOLDER, f"{name_or_path}.yaml")
    if not os.path.isfile(path):
        raise ConfigError(
            f"world {name_or_path!r} is unknown, expected {', '.join(names())} or the path of a .yaml file"
        )
    data = read_expected(path, "a world as YAML")
    return WorldFile().read(Reader(path), "", data)


def parse_pose(text: Optional[str], default: Pose) -> Pose:
    """`X,Y,YAW` in metres and degrees, or `default` for None; raises ConfigError if `text` is something else."""
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
    """The pose as `parse_pose` takes it."""
    return f"{pose.x_m},{pose.y_m},{math.degrees(pose.yaw_rad)}"
