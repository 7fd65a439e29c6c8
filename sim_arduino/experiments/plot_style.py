"""Common style of all pictures: sizes, equal scales, and colours that everybody can distinguish, also in print."""

import os
from typing import Any, Iterable, Optional, Sequence, Tuple

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


def path(axes: Any, points: Sequence[Sequence[float]], colour: str, label: str, line: str = "-") -> None:
    """Draws a path of poses or points."""
    axes.plot([p[0] for p in points], [p[1] for p in points], line, color=colour, linewidth=1.3, label=label)


def paths(
    axes: Any, each: Iterable[Sequence[Sequence[float]]], colour: str, label: str, line: str = "-"
) -> None:
    """Draws paths of one kind, with one label."""
    for number, points in enumerate(each):
        path(axes, points, colour, "" if number else label, line)


def band(axes: Any, points: Sequence[Sequence[float]], label: Optional[str]) -> None:
    """Draws a path as a pale band below other paths."""
    axes.plot([p[0] for p in points], [p[1] for p in points], color="#d0d0d0", linewidth=4.0, label=label)


def grid(axes: Any, made: GridMap) -> None:
    """Draws a map: walls black, free cells white, unknown ones grey."""
    height, width = made.cells.shape
    left, bottom = made.origin.x_m, made.origin.y_m
    extent = (left, left + width * made.resolution_m, bottom, bottom + height * made.resolution_m)
    shade = (made.cells == UNKNOWN) * 0.75 + (made.cells == FREE) * 1.0
    axes.imshow(shade, origin="lower", extent=extent, cmap="gray", vmin=0, vmax=1)


def circle(radius: float, colour: str, label: Optional[str]) -> Any:
    """A dashed circle about the origin."""
    from matplotlib.patches import Circle

    return Circle((0.0, 0.0), radius, fill=False, linestyle="--", color=colour, label=label)


def save(made: Any, folder: str, name: str) -> str:
    """Writes the picture; returns the file name."""
    file = f"{name}.png"
    figures.save(made, os.path.join(folder, file), dpi=130)
    return file
