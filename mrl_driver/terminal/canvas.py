"""A map of the plane, drawn with braille characters of eight dots each.  No I/O."""

import itertools
import math
from typing import TYPE_CHECKING, List, NamedTuple, Sequence, Tuple

from mrl_driver.geometry import Pose

if TYPE_CHECKING:
    from rich.text import Text

_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bit of each dot in a braille character, by row and column."""
_BLANK = 0x2800
_SPANS_M = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 24.0, 32.0)
"""Widths of the view [m]; the view grows in these steps, not continuously."""
_STEP_M = 0.5
_MARGIN_M = 0.3
ARROWS = "→↗↑↖←↙↓↘"  # headings in steps of 45 deg, counter-clockwise from x; y points up

Point = Tuple[float, float]


class View(NamedTuple):
    """The visible part of the plane: its centre [m] and its scale [dots per metre]."""

    x_m: float
    y_m: float
    scale: float


def fit(points: Sequence[Point], columns: int, rows: int) -> View:
    """Return a view that contains all points.  It changes in steps, so that it is steady while the robot drives."""
    xs, ys = [point[0] for point in points], [point[1] for point in points]
    x_m = round((max(xs) + min(xs)) / 2 / _STEP_M) * _STEP_M
    y_m = round((max(ys) + min(ys)) / 2 / _STEP_M) * _STEP_M
    reach_x = max(abs(x - x_m) for x in xs) + _MARGIN_M
    reach_y = max(abs(y - y_m) for y in ys) + _MARGIN_M
    for span_m in _SPANS_M:
        scale = min(columns * 2, rows * 4) / span_m
        if reach_x * scale <= columns and reach_y * scale <= rows * 2:
            return View(x_m, y_m, scale)
    return View(x_m, y_m, min(columns / reach_x, rows * 2 / reach_y))


class Canvas:
    """Dots and characters on `rows` lines of `columns` characters; later drawings cover earlier ones.

    Styles are those of rich.
    """

    def __init__(self, columns: int, rows: int, view: View) -> None:
        self.columns, self.rows, self.view = columns, rows, view
        self._bits = [[0] * columns for _ in range(rows)]
        self._marks = [[""] * columns for _ in range(rows)]
        self._styles = [[""] * columns for _ in range(rows)]

    def dot(self, point: Point, style: str) -> None:
        """Set the dot at a point [m]; points outside the view are ignored."""
        column, row = self.at(point)
        if 0 <= column < self.columns * 2 and 0 <= row < self.rows * 4:
            self._bits[row // 4][column // 2] |= _BITS[row % 4][column % 2]
            self._styles[row // 4][column // 2] = style

    def line(self, points: Sequence[Point], style: str, every: int = 1) -> None:
        """Set each `every`th dot of the straight lines from each point to the next [m]."""
        for (x, y), end in zip(points, points[1:]):
            dx, dy = end[0] - x, end[1] - y
            steps = min(4000, max(1, math.ceil(math.hypot(dx, dy) * self.view.scale / every)))
            for i in range(steps + 1):
                self.dot((x + dx * i / steps, y + dy * i / steps), style)

    def mark(self, point: Point, character: str, style: str, over: bool = True) -> None:
        """Put a character at a point [m]; without `over` only on an empty cell."""
        column, row = (each // size for each, size in zip(self.at(point), (2, 4)))
        if not (0 <= column < self.columns and 0 <= row < self.rows):
            return
        if over or not (self._bits[row][column] or self._marks[row][column]):
            self._marks[row][column], self._styles[row][column] = character, style

    def grid(self, step_m: float, style: str) -> None:
        """Draw a point at each multiple of `step_m` where the cell is empty."""
        half_x, half_y = self.columns / self.view.scale, self.rows * 2 / self.view.scale
        for x in _multiples(self.view.x_m, half_x, step_m):
            for y in _multiples(self.view.y_m, half_y, step_m):
                self.mark((x, y), "·", style, over=False)

    def arrow(self, pose: Pose) -> None:
        """Put an arrow at a pose."""
        self.mark(pose[:2], ARROWS[round(pose.yaw_rad / (math.pi / 4)) % 8], "bold")

    def text(self) -> "Text":
        """Return the drawing as lines of styled text."""
        from rich.text import Text

        text = Text(no_wrap=True)
        for number, row in enumerate(zip(self._bits, self._marks, self._styles)):
            text.append("\n" if number else "")
            for style, cells in itertools.groupby(zip(*row), lambda cell: cell[2]):
                text.append(
                    "".join(mark or (chr(_BLANK + bits) if bits else " ") for bits, mark, _ in cells), style
                )
        return text

    def at(self, point: Point) -> Tuple[int, int]:
        """Return column and row of the dot for a point; both may be outside the canvas."""
        column = self.columns + (point[0] - self.view.x_m) * self.view.scale
        row = self.rows * 2 - (point[1] - self.view.y_m) * self.view.scale
        return math.floor(_bounded(column)), math.floor(_bounded(row))


def _bounded(value: float) -> float:
    return max(-1e6, min(1e6, value))


def _multiples(middle: float, half: float, step: float) -> List[float]:
    first, last = math.ceil((middle - half) / step), math.floor((middle + half) / step)
    return [i * step for i in range(first, last + 1)]
