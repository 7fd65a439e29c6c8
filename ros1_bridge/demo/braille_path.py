"""Draws a path from above as lines of braille characters, eight dots each.  Pure."""

import math
from typing import List, Sequence, Tuple

_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bit of each dot in a braille character, by row and column."""
_BLANK = 0x2800
_LEAST_SPAN_M = 1.2
"""The view shows at least this much; it never zooms in closer."""
_MARGIN = 1.15
GRID = "·"
GRID_M = 0.5
_MOST_MARKS = 200
"""If there are more grid marks than this, none is drawn, because they would hide the path."""
ARROWS = "→↗↑↖←↙↓↘"
"""Headings in steps of 45 deg, counter-clockwise from x; y points up."""

Point = Tuple[float, float]


def draw(points: Sequence[Point], pose: Tuple[float, float, float], columns: int, rows: int) -> List[str]:
    """Returns `rows` lines of `columns` characters: the path, and an arrow at the pose; x right, y up.

    Args:
        points: the path [m].
        pose: x, y, yaw [m m rad].
    """
    seen = [*points, pose[:2]]
    middle, scale = _fit(seen, columns * 2, rows * 4)
    cells = [[_BLANK] * columns for _ in range(rows)]
    for point in points:
        x, y = _dot(point, middle, scale, columns * 2, rows * 4)
        cells[y // 4][x // 2] |= _DOTS[y % 4][x % 2]
    lines = [[" " if cell == _BLANK else chr(cell) for cell in row] for row in cells]
    for column, row in _grid(middle, scale, columns, rows):
        if lines[row][column] == " ":
            lines[row][column] = GRID
    x, y = _dot(pose[:2], middle, scale, columns * 2, rows * 4)
    lines[y // 4][x // 2] = ARROWS[round(pose[2] / (math.pi / 4)) % 8]
    return ["".join(line) for line in lines]


def _fit(points: Sequence[Point], width: int, height: int) -> Tuple[Point, float]:
    """Centre [m] and scale [dots per metre] that show all points."""
    xs, ys = [p[0] for p in points], [p[1] for p in points]
    span_x = max((max(xs) - min(xs)) * _MARGIN, _LEAST_SPAN_M)
    span_y = max((max(ys) - min(ys)) * _MARGIN, _LEAST_SPAN_M)
    return ((max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2), min(width / span_x, height / span_y)


def _grid(middle: Point, scale: float, columns: int, rows: int) -> List[Tuple[int, int]]:
    """Character cells (column, row) of the multiples of GRID_M in view."""
    xs = _multiples(middle[0], columns * 2 / scale)
    ys = _multiples(middle[1], rows * 4 / scale)
    if len(xs) * len(ys) > _MOST_MARKS:
        return []
    dots = (_dot((x, y), middle, scale, columns * 2, rows * 4) for x in xs for y in ys)
    return [(x // 2, y // 4) for x, y in dots]


def _multiples(middle: float, width: float) -> List[float]:
    first, last = math.ceil((middle - width / 2) / GRID_M), math.floor((middle + width / 2) / GRID_M)
    return [i * GRID_M for i in range(first, last + 1)]


def _dot(point: Point, middle: Point, scale: float, width: int, height: int) -> Tuple[int, int]:
    x = round(width / 2 + (point[0] - middle[0]) * scale)
    y = round(height / 2 - (point[1] - middle[1]) * scale)
    return min(width - 1, max(0, x)), min(height - 1, max(0, y))
