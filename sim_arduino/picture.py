"""`mrl-sim --plot`: the world from above with the robot's path, as PNG, PDF or SVG.  Needs matplotlib."""

import os
from typing import Any

from mrl_driver.errors import ConfigError

from .shapes import Wall
from .trail import Trail, frame

_ENDINGS = (".png", ".pdf", ".svg")
_BLUE, _ORANGE, _GREY = "#0072b2", "#d55e00", "#999999"
"""Okabe and Ito's colours, told apart by everybody and in print."""
_SOURCES = {"heat": "#d55e00", "gas": "#009e73", "dust": "#999999", "light": "#e69f00"}


def demand(path: str) -> None:
    """Refuses early what cannot be drawn at the end.

    Raises:
        ConfigError: no matplotlib, another ending, or a folder that is not there.
    """
    if os.path.splitext(path)[1] not in _ENDINGS:
        raise ConfigError(f"--plot {path}: expected a file that ends in {', '.join(_ENDINGS)}")
    folder = os.path.dirname(path) or "."
    if not os.access(folder, os.W_OK):
        raise ConfigError(f"--plot {path}: folder {folder} cannot be written, expected one that can")
    try:
        import matplotlib  # noqa: F401 - looked for, not used
    except ImportError:
        raise ConfigError(
            "--plot needs matplotlib; install it with: pip install 'mrl-driver[plot]'"
        ) from None


def draw(trail: Trail, path: str) -> None:
    """Draws world, things to sense, path and robots to `path`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    left, bottom, right, top = frame(trail.plant, trail.poses)
    height = 6.0 * min(2.0, max(0.4, (top - bottom) / (right - left)))
    figure = Figure(figsize=(7.0, height + 0.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set(xlim=(left, right), ylim=(bottom, top), xlabel="x [m]", ylabel="y [m]", aspect="equal")
    _draw_world(axes, trail)
    if trail.poses:
        _draw_robots(axes, trail)
    axes.legend(loc="upper right", fontsize="small")
    figure.savefig(path, dpi=150)


def _draw_world(axes: Any, trail: Trail) -> None:
    world = trail.plant.world
    for number, wall in enumerate(world.walls):
        _line(axes, wall, "black", "wall" if number == 0 else None)
    for kind, colour in _SOURCES.items():
        for number, source in enumerate(getattr(world.scene, kind)):
            label = kind if number == 0 else None
            at = {"xy": (source.x_m, source.y_m), "radius": source.reach_m}
            axes.add_patch(_circle(**at, color=colour, alpha=0.25, label=label))


def _circle(**options: Any) -> Any:
    from matplotlib.patches import Circle

    return Circle(**options)


def _draw_robots(axes: Any, trail: Trail) -> None:
    plant, poses = trail.plant, trail.poses
    label = f"path of {plant.name}, {trail.way_m():.2f} m"
    axes.plot([p.x_m for p in poses], [p.y_m for p in poses], color=_BLUE, linewidth=1.2, label=label)
    axes.plot(*poses[0][:2], "o", color=_BLUE, markersize=5, label="start")
    if plant.footprint:
        for side in plant.footprint.outline(plant.true_pose):
            _line(axes, side, _ORANGE)
    tip = plant.true_pose.beside(0.15, 0.0)
    axes.annotate("", tip[:2], plant.true_pose[:2], arrowprops={"arrowstyle": "->", "color": _ORANGE})
    for mover in plant.world.robots(plant.name):
        for side in mover.footprint.outline(mover.pose):
            _line(axes, side, _GREY)


def _line(axes: Any, wall: Wall, colour: str, label: Any = None) -> None:
    axes.plot([wall.x1, wall.x2], [wall.y1, wall.y2], color=colour, linewidth=1.5, label=label)
