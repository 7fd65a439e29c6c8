"""How all pictures look: sizes, colours that everybody tells apart and that print, metres of equal length."""

import os
from typing import Any, Iterable, Optional, Sequence, Tuple

from mrl_driver.errors import ConfigError

from ..shapes import Wall

BLUE, ORANGE, GREEN, PINK, SKY, GREY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#777777"
"""Okabe and Ito's colours."""
LINES = ("-", "--", ":", "-.")


def demand_matplotlib() -> None:
    """Refuses early what cannot be drawn.

    Raises:
        ConfigError: there is no matplotlib.
    """
    try:
        import matplotlib  # noqa: F401 - looked for, not used
    except ImportError:
        raise ConfigError(
            "experiments end in pictures and need matplotlib; install it with: pip install 'mrl-driver[plot]'"
        ) from None


def figure(columns: int = 1, width_in: float = 7.0, height_in: float = 4.5) -> Tuple[Any, Sequence[Any]]:
    """A figure and its axes, side by side."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    made = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(made)
    axes = made.subplots(1, columns, squeeze=False)[0]
    for each in axes:
        each.grid(True, color="#dddddd", linewidth=0.6)
        each.set_axisbelow(True)
    return made, axes


def floor(axes: Any, title: str = "") -> None:
    """Makes the axes a plan: metres of equal length."""
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title=title)


def walls(axes: Any, each: Iterable[Wall], label: str = "walls") -> None:
    """Draws walls."""
    for number, wall in enumerate(each):
        axes.plot(
            [wall.x1, wall.x2],
            [wall.y1, wall.y2],
            color="black",
            linewidth=1.5,
            label=label if number == 0 else None,
        )


def path(axes: Any, points: Sequence[Sequence[float]], colour: str, label: str, line: str = "-") -> None:
    """Draws a path of poses or points."""
    axes.plot([p[0] for p in points], [p[1] for p in points], line, color=colour, linewidth=1.3, label=label)


def circle(radius: float, colour: str, label: Optional[str]) -> Any:
    """A dashed circle about the origin."""
    from matplotlib.patches import Circle

    return Circle((0.0, 0.0), radius, fill=False, linestyle="--", color=colour, label=label)


def save(made: Any, folder: str, name: str) -> str:
    """Writes the picture; its file's name."""
    file = f"{name}.png"
    made.savefig(os.path.join(folder, file), dpi=130)
    return file
