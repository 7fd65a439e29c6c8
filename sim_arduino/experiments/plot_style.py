"""Common style of all pictures: sizes, equal scales, and colours that everybody can distinguish, also in print."""

import os
from typing import Any, Iterable, Sequence, Tuple

from mrl_driver import figures
from mrl_driver.figures import BLUE, GREEN, GREY, ORANGE, PINK, SKY
from sim_arduino.view.world_view import draw_walls
from sim_arduino.world.grid_map import FREE, UNKNOWN, GridMap

__all__ = ["BLUE", "GREEN", "GREY", "ORANGE", "PINK", "SKY", "draw_walls"]
LINES = ("-", "--", ":", "-.")


def figure(columns: int = 1, width_in: float = 7.0, height_in: float = 4.5) -> Tuple[Any, Sequence[Any]]:
    """A figure and its axes, side by side."""
    made = figures.figure(width_in, height_in)
    axes = made.subplots(1, columns, squeeze=False)[0]
    for each in axes:
        each.grid(True, color="#dddddd", linewidth=0.6)
        each.set_axisbelow(True)
    return made, axes


def floor(axes: Any, title: str = "") -> None:
    """Labels the axes as a floor plan with equal scales."""
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title=title)


def path(axes: Any, points: Sequence[Sequence[float]], colour: str, label: str, *style: Any) -> None:
    """Draws a path of poses or points, as `paths` does."""
    paths(axes, [points], colour, label, *style)


def paths(
    axes: Any, each: Iterable[Any], colour: str, label: str, line: str = "-", width: float = 1.3
) -> None:
    """Draws paths of one kind, each of poses or points, with one label."""
    for points in each:
        x, y = ([point[axis] for point in points] for axis in (0, 1))
        axes.plot(x, y, line, color=colour, linewidth=width, label=label)
        label = ""


def grid(axes: Any, made: GridMap) -> None:
    """Draws a map: walls black, free cells white, unknown ones grey."""
    height, width = made.cells.shape
    left, bottom = made.origin.x_m, made.origin.y_m
    extent = (left, left + width * made.resolution_m, bottom, bottom + height * made.resolution_m)
    shade = (made.cells == UNKNOWN) * 0.75 + (made.cells == FREE) * 1.0
    axes.imshow(shade, origin="lower", extent=extent, cmap="gray", vmin=0, vmax=1)


def save(made: Any, folder: str, name: str) -> str:
    """Writes the picture; returns the file name."""
    file = f"{name}.png"
    figures.save(made, os.path.join(folder, file), dpi=130)
    return file
