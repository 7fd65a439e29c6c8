"""Reads and writes occupancy grids in the format of map_server: a YAML file and a PGM picture."""

import math
import os
import re
from typing import Any, List, Mapping, NamedTuple, Tuple

import numpy as np
import yaml

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.yaml_file import Reader, is_number, read_expected
from mrl_driver.yaml_form import Choice, Form, Keys, Number, Schema, Text

from .shapes import Wall
from .world import World

OCCUPIED, FREE, UNKNOWN = 100, 0, -1
_MOST_CELLS = 64_000_000
_MOST_BYTES = 2 * _MOST_CELLS + 65536
"""Longest picture: two bytes for each cell, and the header."""
_MOST_WALLS = 1_000_000
"""A map with more outlines than this is noise."""


class _Origin(Form):
    """Pose of the map's corner."""

    _PART = Number(-1e6, 1e6)

    def read(self, reader: Reader, key: str, value: Any) -> Tuple[float, ...]:
        good = isinstance(value, list) and len(value) == 3
        if not good or not all(is_number(each, self._PART.low, self._PART.high) for each in value):
            raise reader.fail(key, value, "[x m, y m, yaw rad] from -1e6 to 1e6")
        return tuple(map(float, value))

    def schema(self) -> Schema:
        return {"type": "array", "items": self._PART.schema(), "minItems": 3, "maxItems": 3}


_SHARE = Number(0.0, 1.0)
FORM = Keys(
    {
        "image": Text("the name of a PGM file"),
        "resolution": Number(0.001, 10.0),
        "origin": _Origin(),
        "negate": _SHARE,
        "occupied_thresh": _SHARE,
        "free_thresh": _SHARE,
        "mode": Choice(("trinary", "scale")),
    },
    ("negate", "occupied_thresh", "free_thresh", "mode"),
    {
        "resolution": "Side of a cell [m].",
        "origin": "Pose of the corner with the smallest x and y: x, y [m], yaw [rad].",
        "negate": "1: white is occupied.",
        "occupied_thresh": "Darker cells are occupied.",
        "free_thresh": "Lighter cells are free; at most occupied_thresh, which the schema does not check.",
    },
)
"""The form of a map_server YAML."""


class GridMap(NamedTuple):
    """A map.

    Attributes:
        cells: int8 `(height, width)`: 100 occupied, 0 free, -1 unknown; row 0 has the smallest y.
        resolution_m: Side of a cell [m].
        origin: Pose of the map's corner with the smallest x and y.
    """

    cells: Any
    resolution_m: float
    origin: Pose


def load(path: str) -> GridMap:
    """The map in a map_server YAML.

    Raises:
        ConfigError: the file cannot be opened; or as for `read`.
    """
    expected = "a map_server YAML"
    return read(path, Reader(path).mapping("", read_expected(path, expected), expected))


def read(path: str, data: Mapping[str, Any]) -> GridMap:
    """The map described by the map_server YAML `data` of the file `path`.

    Raises:
        ConfigError: a key is missing, misspelt or out of range, or the picture cannot be read.
    """
    reader = Reader(path)
    found = FORM.read(reader, "", data)
    occupied, negate = found.get("occupied_thresh", 0.65), found.get("negate", 0.0)
    free = found.get("free_thresh", min(0.196, occupied))
    if free > occupied:
        raise reader.fail("free_thresh", free, f"a number from 0 to {occupied:g}, the occupied_thresh")
    image, resolution, corner = found["image"], found["resolution"], found["origin"]
    values, most = _read_pgm(os.path.join(os.path.dirname(path), image))
    shares = np.arange(most + 1) / most
    darkness = shares if negate else 1.0 - shares
    states = np.where(darkness > occupied, OCCUPIED, np.where(darkness < free, FREE, UNKNOWN)).astype(np.int8)
    return GridMap(states[values][::-1], resolution, Pose(*corner))


_GAP = rb"(?:\s|#[^\n]*\n)+"
_HEADER = re.compile(rb"(P[25])" + _GAP + (rb"(\d{1,9})" + _GAP) * 2 + rb"(\d{1,9})(?:\r\n|\s)")


def _read_pgm(path: str) -> Tuple[Any, int]:
    """Grey values, integers `(height, width)` with row 0 at the top, and the value of white."""
    try:
        with open(path, "rb") as file:
            data = file.read(_MOST_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: of a path with NUL
        why = error.strerror if isinstance(error, OSError) else error
        raise ConfigError(f"{path}: {why}, expected a PGM picture") from None
    if len(data) > _MOST_BYTES:
        raise ConfigError(f"{path}: longer than {_MOST_BYTES} bytes, expected a PGM picture")
    header = _HEADER.match(data)
    if not header:
        raise ConfigError(
            f"{path}: begins with {data[:12]!r}, expected a PGM header, P5 or P2, width height maximum"
        )
    width, height, most = map(int, header.groups()[1:])
    if not (0 < width * height <= _MOST_CELLS and 0 < most < 65536):
        raise ConfigError(
            f"{path}: {width} x {height} pixels up to {most}, expected 1 to {_MOST_CELLS} pixels up to 65535"
        )
    body = data[header.end() :]
    values = _plain_values(path, body) if header.group(1) == b"P2" else _raw_values(body, most)
    if len(values) < width * height:
        raise ConfigError(f"{path}: has {len(values)} pixels, expected {width} x {height} = {width * height}")
    values = values[: width * height].reshape(height, width)
    if values.min() < 0 or values.max() > most:
        raise ConfigError(
            f"{path}: has pixels from {values.min()} to {values.max()}, expected 0 to {most}, the maximum it names"
        )
    return values, most


def _raw_values(body: bytes, most: int) -> Any:
    kind = np.dtype(np.uint8 if most < 256 else ">u2")
    return np.frombuffer(body[: len(body) // kind.itemsize * kind.itemsize], kind)


def _plain_values(path: str, body: bytes) -> Any:
    try:
        return np.array(re.sub(rb"#[^\n]*", b"", body).split()).astype(np.int64)
    except (ValueError, OverflowError) as error:
        raise ConfigError(f"{path}: {error}, expected whole numbers") from None


def walls_of(grid: GridMap) -> List[Wall]:
    """The outlines of the occupied cells; straight runs are joined.

    Raises:
        ConfigError: there are more than a million.
    """
    full = np.pad(grid.cells == OCCUPIED, 1)
    walls: List[Wall] = []
    for upright in (False, True):
        change = np.diff((full.T if upright else full).astype(np.int8), axis=0)[:, 1:-1]
        for sign in (1, -1):
            runs = _runs(change == sign)
            if len(walls) + len(runs) > _MOST_WALLS:
                raise ConfigError(f"the map has more than {_MOST_WALLS} outlines, expected walls and rooms")
            for line, begin, end in runs:
                a, b = ((line, begin), (line, end)) if upright else ((begin, line), (end, line))
                walls.append(_placed(grid, a, b))
    return walls


def _runs(edges: Any) -> List[Tuple[int, int, int]]:
    """Row, begin and end of each run of True."""
    steps = np.diff(np.pad(edges.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    rows, begins = (steps == 1).nonzero()
    _, ends = (steps == -1).nonzero()
    return list(zip(rows.tolist(), begins.tolist(), ends.tolist()))


def _placed(grid: GridMap, a: Tuple[int, int], b: Tuple[int, int]) -> Wall:
    points = [grid.origin.compose(x * grid.resolution_m, y * grid.resolution_m) for x, y in (a, b)]
    return Wall(*points[0][:2], *points[1][:2])


def draw(world: World, resolution_m: float = 0.025, margin_m: float = 0.25) -> GridMap:
    """The true map of a world: cells with a wall are occupied, cells reachable from the start free, others unknown."""
    left, bottom, right, top = world.bounds()
    origin = Pose(left - margin_m, bottom - margin_m, 0.0)
    width, height = (
        max(1, math.ceil((span + 2 * margin_m) / resolution_m)) for span in (right - left, top - bottom)
    )
    cells = np.full((height, width), UNKNOWN, np.int8)
    for wall in world.walls:
        length = math.hypot(wall.x2 - wall.x1, wall.y2 - wall.y1)
        t = np.linspace(0.0, 1.0, max(2, math.ceil(4 * length / resolution_m)))
        x = ((wall.x1 + t * (wall.x2 - wall.x1) - origin.x_m) / resolution_m).astype(int)
        y = ((wall.y1 + t * (wall.y2 - wall.y1) - origin.y_m) / resolution_m).astype(int)
        cells[y, x] = OCCUPIED
    seed = (
        int((world.start.y_m - origin.y_m) / resolution_m),
        int((world.start.x_m - origin.x_m) / resolution_m),
    )
    cells[_reached(cells != OCCUPIED, seed)] = FREE
    return GridMap(cells, resolution_m, origin)


def _reached(open_cells: Any, seed: Tuple[int, int]) -> Any:
    """Open cells that are connected with `seed` by edges."""
    reached = np.zeros_like(open_cells)
    reached[seed] = open_cells[seed]
    count = 0
    while count != reached.sum():
        count = reached.sum()
        for step in (1, -1):
            for axis in (0, 1):
                moved = np.roll(reached, step, axis)
                edge = (0 if step == 1 else -1,)
                moved[edge if axis == 0 else (slice(None), *edge)] = False
                reached |= moved & open_cells
    return reached


def write(grid: GridMap, yaml_path: str) -> None:
    """Writes `yaml_path` and a PGM next to it, as map_saver does.

    Raises:
        ConfigError: a file cannot be written.
    """
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
