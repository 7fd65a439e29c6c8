"""`mrl-sim --view`: the world from above, live in a terminal, drawn with braille dots."""

import math
from typing import Any, List, Tuple

from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.geometry import Wall

from .travelled_path import Trail, frame

VIEW_S = 0.1
_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of a braille character by dot row and column."""


class Canvas:
    """Dots on a grid of `columns` x `rows` characters, each of 2 x 4 dots."""

    def __init__(self, columns: int, rows: int, around: Tuple[float, float, float, float]) -> None:
        left, bottom, right, top = around
        self._dots_x, self._dots_y = 2 * columns, 4 * rows
        self._per_m = min((self._dots_x - 1) / (right - left), (self._dots_y - 1) / (top - bottom))
        self._left, self._top = left, top
        self._cells = [[0] * columns for _ in range(rows)]

    def dot(self, x: float, y: float) -> None:
        """Sets the dot at a position [m]; positions outside are ignored."""
        column = round((x - self._left) * self._per_m)
        row = round((self._top - y) * self._per_m)
        if 0 <= column < self._dots_x and 0 <= row < self._dots_y:
            self._cells[row // 4][column // 2] |= _BITS[row % 4][column % 2]

    def line(self, wall: Wall) -> None:
        """Sets the dots along a wall."""
        length = math.hypot(wall.x2 - wall.x1, wall.y2 - wall.y1)
        count = min(10000, max(1, math.ceil(length * self._per_m)))
        for i in range(count + 1):
            t = i / count
            self.dot(wall.x1 + t * (wall.x2 - wall.x1), wall.y1 + t * (wall.y2 - wall.y1))

    def text(self) -> List[str]:
        """The canvas as lines of text."""
        return ["".join(chr(0x2800 + cell) if cell else " " for cell in row).rstrip() for row in self._cells]


def draw(trail: Trail, columns: int, rows: int) -> List[str]:
    """World, path and robots as `rows` lines of `columns` characters; the last line has the numbers."""
    plant = trail.plant
    canvas = Canvas(columns, max(1, rows - 1), frame(plant, trail.poses[-1:]))
    for wall in plant.world.walls:
        canvas.line(wall)
    for pose in trail.poses:
        canvas.dot(pose.x_m, pose.y_m)
    for mover in plant.world.robots():
        for side in mover.footprint.outline(mover.pose):
            canvas.line(side)
    tip = plant.true_pose.compose(0.2, 0.0)
    canvas.line(Wall(*plant.true_pose[:2], *tip[:2]))
    return [*canvas.text(), _numbers(plant)]


def _numbers(plant: Plant) -> str:
    pose, state = plant.true_pose, plant.robot.state
    bumped = "  against something" if state.bumped else ""
    return (
        f"x {pose.x_m:+.2f} m  y {pose.y_m:+.2f} m  yaw {math.degrees(pose.yaw_rad):+.0f} deg  "
        f"battery {state.battery_v:.1f} V{bumped}"
    )


class View:
    """Draws a trail on stderr, ten times a second, until it is closed."""

    def __init__(self, trail: Trail) -> None:
        from rich.console import Console
        from rich.live import Live

        self._trail = trail
        self._console = Console(stderr=True)
        self._live: Any = Live(console=self._console, auto_refresh=False, transient=True)
        self._live.start()
        self.due_s = 0.0

    def look(self, now_s: float) -> None:
        """Draws the present state."""
        from rich.text import Text

        self.due_s = now_s + VIEW_S
        lines = draw(self._trail, self._console.width - 1, min(40, self._console.height - 1))
        self._live.update(Text("\n".join(lines), no_wrap=True), refresh=True)

    def close(self) -> None:
        """Restores the terminal."""
        self._live.stop()
