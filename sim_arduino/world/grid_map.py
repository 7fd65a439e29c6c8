"""Reads and writes occupancy grids in the format of map_server: a YAML file and a picture, PGM or PNG.

What ROS's own loader (map_server of Noetic) takes is taken as it does, or refused with a reason.
"""

import io
import math
import os
import re
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Tuple

import numpy as np
import yaml

from mrl_driver.errors import ConfigError
from mrl_driver.files import read_plain
from mrl_driver.geometry import Pose
from mrl_driver.yaml_file import Reader, is_number, read_expected
from mrl_driver.yaml_form import Choice, Flag, Form, Keys, Number, Schema, Text

from .shapes import Wall
from .world import World

OCCUPIED, FREE, UNKNOWN = 100, 0, -1
_MOST_CELLS = 64_000_000
_LONGEST_HEADER = _LONGEST_SIDE = 65536
"""Longest header of a PGM [byte], and longest side of a picture [cell]."""
_MOST_BYTES = 2 * _MOST_CELLS + _LONGEST_HEADER  # longest picture: two bytes for each cell, and the header
_MOST_WALLS = 1_000_000  # a map with more outlines than this is noise
_MOST_DRAWN, _MOST_POINTS = 16_000_000, 200_000_000
"""Most cells of a map that is drawn, and most points that are drawn on its walls, four in each cell."""
_SHARE = Number(0.0, 1.0)


class _Origin(Form):
    """Pose of the map's corner; a fourth number is ignored, and a yaw that map_saver wrote as nan counts as 0."""

    _PART = Number(-1e6, 1e6)
    _NAN = ("nan", "-nan")

    def read(self, reader: Reader, key: str, value: Any) -> Tuple[float, ...]:
        parts = value[:3] if isinstance(value, list) else []
        if len(parts) == 3 and (parts[2] in self._NAN or parts[2] != parts[2]):
            parts[2] = 0.0
        if len(parts) < 3 or not all(is_number(each, self._PART.low, self._PART.high) for each in parts):
            raise reader.fail(key, value, "[x m, y m, yaw rad] from -1e6 to 1e6")
        return tuple(map(float, parts))

    def schema(self) -> Schema:
        part = self._PART.schema()
        return {
            "type": "array",
            "items": [part, part, {"anyOf": [part, {"enum": list(self._NAN)}]}],
            "minItems": 3,
        }


class _Negate(Form):
    """A flag, or a number as map_server writes it."""

    def read(self, reader: Reader, key: str, value: Any) -> float:
        return float(value) if isinstance(value, bool) else _SHARE.read(reader, key, value)

    def schema(self) -> Schema:
        return {"anyOf": [Flag().schema(), _SHARE.schema()]}


class _MapFile(Keys):
    """Keys that are not known are ignored if all that ROS's loader needs are there, so that misspelt ones are found."""

    _NEEDED = {"negate", "occupied_thresh", "free_thresh"}

    def read(self, reader: Reader, key: str, value: Any) -> Dict[str, Any]:
        if isinstance(value, dict) and self._NEEDED <= value.keys():
            value = {name: each for name, each in value.items() if name in self.forms}
        return super().read(reader, key, value)

    def schema(self) -> Schema:
        return {**super().schema(), "additionalProperties": True}


FORM = _MapFile(
    {
        "image": Text("the name of a PGM or PNG file"),
        "resolution": Number(0.001, 10.0),
        "origin": _Origin(),
        "negate": _Negate(),
        "occupied_thresh": _SHARE,
        "free_thresh": _SHARE,
        "mode": Choice(("trinary", "scale", "raw")),
    },
    ("negate", "occupied_thresh", "free_thresh", "mode"),
    {
        "resolution": "Side of a cell [m].",
        "origin": "Pose of the corner with the smallest x and y: x, y [m], yaw [rad].",
        "negate": "1: white is occupied.",
        "occupied_thresh": "Darker cells are occupied.",
        "free_thresh": "Lighter cells are free; at most occupied_thresh, which the schema does not check.",
        "mode": "raw: a grey value of 100 is occupied, 0 free.  scale: as trinary; what is between is unknown.",
    },
)
"""The form of a map_server YAML."""


class GridMap(NamedTuple):
    """A map."""

    cells: Any  # int8 `(height, width)`: 100 occupied, 0 free, -1 unknown; row 0 has the smallest y
    resolution_m: float  # side of a cell [m]
    origin: Pose  # pose of the map's corner with the smallest x and y


def load(path: str) -> GridMap:
    """The map in a map_server YAML; ConfigError if the file cannot be opened, or as for `read`."""
    expected = "a map_server YAML"
    return read(path, Reader(path).mapping("", read_expected(path, expected), expected))


def read(path: str, data: Mapping[str, Any]) -> GridMap:
    """The map of the map_server YAML `data` of the file `path`; ConfigError if a key or the picture is wrong."""
    reader = Reader(path)
    found = FORM.read(reader, "", data)
    occupied, negate = found.get("occupied_thresh", 0.65), found.get("negate", 0.0)
    free = found.get("free_thresh", min(0.196, occupied))
    if free > occupied:
        raise reader.fail("free_thresh", free, f"a number from 0 to {occupied:g}, the occupied_thresh")
    image, resolution, corner = found["image"], found["resolution"], found["origin"]
    mode = found.get("mode", "trinary")
    values, most = _read_picture(os.path.join(os.path.dirname(path), image), mode == "trinary")
    grey = np.arange(most + 1)
    if mode == "raw":
        grey = (most - grey if negate else grey) * 255 // most
        states = np.where(grey == OCCUPIED, OCCUPIED, np.where(grey == FREE, FREE, UNKNOWN))
    else:
        darkness = grey / most if negate else 1.0 - grey / most
        states = np.where(darkness > occupied, OCCUPIED, np.where(darkness < free, FREE, UNKNOWN))
    cells = np.empty(values.shape, np.int8)
    for rows in _strips(*values.shape):
        cells[rows] = states[values[rows]]
    return GridMap(cells[::-1], resolution, Pose(*corner))


def _strips(height: int, width: int) -> Iterator[slice]:
    """Rows with about a million cells together: to index all at once needs eight bytes for each cell."""
    step = max(1, 1_000_000 // width)
    return (slice(top, min(top + step, height)) for top in range(0, height, step))


_GAP = rb"(?:\s|#[^\n]*\n)+"
_HEADER = re.compile(rb"(P[25])" + _GAP + (rb"(\d{1,9})" + _GAP) * 2 + rb"(\d{1,9})(?:\r\n|\s)")
_NOT_PLAIN = re.compile(rb"[^0-9\s]|[0-9]{10}")
_PNG = b"\x89PNG\r\n\x1a\n"


def _read_picture(path: str, with_alpha: bool) -> Tuple[Any, int]:
    """Grey values, integers `(height, width)` with row 0 at the top, and the value of white."""
    try:
        data = read_plain(path, _MOST_BYTES)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}, expected a PGM or PNG picture") from None
    return _read_png(path, data, with_alpha) if data.startswith(_PNG) else _read_pgm(path, data)


def _check_size(path: str, width: int, height: int, most: int) -> None:
    good = 0 < width * height <= _MOST_CELLS and max(width, height) <= _LONGEST_SIDE
    if not (good and 0 < most < 65536):
        raise ConfigError(
            f"{path}: {width} x {height} pixels up to {most}, expected 1 to {_MOST_CELLS} pixels up to 65535, and "
            f"sides up to {_LONGEST_SIDE}"
        )


def _read_pgm(path: str, data: bytes) -> Tuple[Any, int]:
    header = _HEADER.match(data, 0, _LONGEST_HEADER)
    if not header:
        raise ConfigError(
            f"{path}: begins with {data[:12]!r}, expected a PGM header, P5 or P2, width height maximum, or a PNG"
        )
    width, height, most = map(int, header.groups()[1:])
    _check_size(path, width, height, most)
    if header.group(1) == b"P2":
        values = _plain_values(path, data, header.end())
    else:
        kind = np.dtype(np.uint8 if most < 256 else ">u2")
        values = np.frombuffer(data, kind, (len(data) - header.end()) // kind.itemsize, header.end())
    if len(values) < width * height:
        raise ConfigError(f"{path}: has {len(values)} pixels, expected {width} x {height} = {width * height}")
    values = values[: width * height].reshape(height, width)
    if values.min() < 0 or values.max() > most:
        raise ConfigError(
            f"{path}: has pixels from {values.min()} to {values.max()}, expected 0 to {most}, the maximum it names"
        )
    return values, most


def _plain_values(path: str, data: bytes, start: int) -> Any:
    bad = _NOT_PLAIN.search(data, start)
    if bad:
        found = data[bad.start() : bad.start() + 20]
        raise ConfigError(
            f"{path}: has {found!r} among the pixels, expected whole numbers of at most 9 digits"
        )
    return np.fromstring(data[start:].strip(), np.int32, sep=" ")


def _read_png(path: str, data: bytes, with_alpha: bool) -> Tuple[Any, int]:
    """The mean of the channels, as ROS's loader takes it: in the mode trinary, that of transparency is one of them."""
    try:
        from PIL import PngImagePlugin
    except ImportError:
        raise ConfigError(
            f"{path}: is a PNG picture, which needs the Python package Pillow; install it (Debian: python3-pil), or "
            "convert the picture: convert map.png map.pgm"
        ) from None
    try:
        with PngImagePlugin.PngImageFile(io.BytesIO(data)) as picture:
            width, height = picture.size
            _check_size(path, width, height, 255)
            if picture.mode.startswith("I"):
                return np.asarray(picture).astype(np.uint16), 65535
            clear = picture.mode in ("LA", "RGBA") or "transparency" in picture.info
            grey = picture.mode in ("1", "L", "LA")
            converted = picture.convert("RGBA" if clear and with_alpha else "L" if grey else "RGB")
            values = np.empty((height, width), np.uint16)
            for rows in _strips(height, width):
                strip = np.asarray(converted.crop((0, rows.start, width, rows.stop)))
                values[rows] = strip.reshape(-1, width, len(converted.getbands())).sum(axis=2)
            return values, 255 * len(converted.getbands())
    except ConfigError:
        raise
    except Exception as error:  # noqa: BLE001 - Pillow raises whatever comes
        raise ConfigError(f"{path}: {str(error) or type(error).__name__}, expected a PNG picture") from None


def walls_of(grid: GridMap) -> List[Wall]:
    """The outlines of the occupied cells, straight runs joined; ConfigError if there are more than a million."""
    full = np.pad(grid.cells == OCCUPIED, 1).view(np.int8)
    found: List[Tuple[bool, Any]] = []
    count = 0
    for upright in (False, True):
        change = np.diff(full.T if upright else full, axis=0)[:, 1:-1]
        for sign in (1, -1):
            steps = np.diff(np.pad(change == sign, ((0, 0), (1, 1))).view(np.int8), axis=1)
            count += np.count_nonzero(steps == 1)
            if count > _MOST_WALLS:
                raise ConfigError(f"the map has more than {_MOST_WALLS} outlines, expected walls and rooms")
            lines, begins = (steps == 1).nonzero()
            found.append((upright, (lines, begins, (steps == -1).nonzero()[1])))
    walls: List[Wall] = []
    for upright, runs in found:
        for line, begin, end in zip(*(each.tolist() for each in runs)):
            a, b = ((line, begin), (line, end)) if upright else ((begin, line), (end, line))
            walls.append(_placed(grid, a, b))
    return walls


def _placed(grid: GridMap, a: Tuple[int, int], b: Tuple[int, int]) -> Wall:
    points = [grid.origin.compose(x * grid.resolution_m, y * grid.resolution_m) for x, y in (a, b)]
    return Wall(*points[0][:2], *points[1][:2])


def draw(world: World, resolution_m: float = 0.025, margin_m: float = 0.25) -> GridMap:
    """The true map of a world: cells with a wall are occupied, cells reachable from the start free, others unknown.

    ConfigError if the world is too large for cells of this size, or its walls are too long.
    """
    left, bottom, right, top = world.bounds()
    origin = Pose(left - margin_m, bottom - margin_m, 0.0)
    width, height = (
        max(1, math.ceil((span + 2 * margin_m) / resolution_m)) for span in (right - left, top - bottom)
    )
    lengths_m = [math.hypot(wall.x2 - wall.x1, wall.y2 - wall.y1) for wall in world.walls]
    if width * height > _MOST_DRAWN or 4 * sum(lengths_m) / resolution_m > _MOST_POINTS:
        raise ConfigError(
            f"the world is {right - left:g} x {top - bottom:g} m with {sum(lengths_m):g} m of walls, too much for a "
            f"map with cells of {resolution_m:g} m: expected at most {_MOST_DRAWN} cells, and {_MOST_POINTS // 4} "
            "cells of walls; give larger cells, or a smaller world"
        )
    cells = np.full((height, width), UNKNOWN, np.int8)
    for wall, length_m in zip(world.walls, lengths_m):
        t = np.linspace(0.0, 1.0, max(2, math.ceil(4 * length_m / resolution_m)))
        x = ((wall.x1 + t * (wall.x2 - wall.x1) - origin.x_m) / resolution_m).astype(int)
        y = ((wall.y1 + t * (wall.y2 - wall.y1) - origin.y_m) / resolution_m).astype(int)
        cells[y, x] = OCCUPIED
    x, y = (int(each / resolution_m) for each in (world.start.x_m - origin.x_m, world.start.y_m - origin.y_m))
    cells[_reached(cells != OCCUPIED, (y, x))] = FREE
    return GridMap(cells, resolution_m, origin)


def _reached(open_cells: Any, seed: Tuple[int, int]) -> Any:
    """Open cells that are connected with `seed` by edges: runs of rows and of columns that touch, in turn."""
    height, width = open_cells.shape
    closed = ~open_cells
    along_x = np.cumsum(closed, axis=1, dtype=np.int32) + np.arange(height, dtype=np.int32)[:, None] * (
        width + 1
    )
    along_y = np.cumsum(closed, axis=0, dtype=np.int32) + np.arange(width, dtype=np.int32) * (height + 1)
    reached = np.zeros(open_cells.shape, bool)
    reached[seed] = open_cells[seed]
    count = 0
    while count < np.count_nonzero(reached):
        count = np.count_nonzero(reached)
        for run in (along_x, along_y):
            touched = np.zeros((height + 1) * (width + 1), bool)
            touched[run[reached]] = True
            reached = touched[run] & open_cells
    return reached


def write(grid: GridMap, yaml_path: str) -> None:
    """Writes `yaml_path` and a PGM next to it, as map_saver does; raises ConfigError if a file cannot be written."""
    image = os.path.splitext(yaml_path)[0] + ".pgm"
    grey = np.full(grid.cells.shape, 205, np.uint8)
    grey[grid.cells == OCCUPIED], grey[grid.cells == FREE] = 0, 254
    height, width = grey.shape
    data = {
        "image": os.path.basename(image),
        "resolution": grid.resolution_m,
        "origin": [float(each) for each in grid.origin],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    try:
        with open(image, "wb") as picture:
            picture.write(b"P5\n%d %d\n255\n" % (width, height) + grey[::-1].tobytes())
        with open(yaml_path, "w", encoding="utf-8") as file:
            yaml.safe_dump(data, file, sort_keys=False)
    except OSError as error:
        raise ConfigError(
            f"{error.filename}: {error.strerror}, expected a folder that can be written"
        ) from None
