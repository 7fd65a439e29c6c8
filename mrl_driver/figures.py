"""What all pictures share: colours, kinds of files, and matplotlib, which is an extra of the package."""

import io
import os
import warnings
from typing import Any

from .errors import ConfigError
from .files import replace_file

BLUE, ORANGE, GREEN, PINK, SKY, GREY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#999999"
"""Okabe and Ito's colours, told apart by everybody; lines differ in dashes too, for print."""
ENDINGS = (".png", ".pdf", ".svg")


def demand_matplotlib(what: str = "--plot") -> None:
    """Refuse early what cannot be drawn at the end.

    Raises:
        ConfigError: there is no matplotlib.
    """
    # a newer matplotlib beside Debian's three-dimensional half warns of that, which draws nothing here
    warnings.filterwarnings("ignore", "Unable to import Axes3D")
    try:
        import matplotlib  # noqa: F401 - looked for, not used
    except ImportError:
        raise ConfigError(
            f"{what} needs matplotlib; install it with: pip install 'mrl-driver[plot]'"
        ) from None


def demand(path: str, what: str = "--plot") -> None:
    """Refuse early what cannot be drawn to `path` at the end.

    Raises:
        ConfigError: no matplotlib, another ending, or a folder that cannot be written.
    """
    if os.path.splitext(path)[1].lower() not in ENDINGS:
        raise ConfigError(f"{what} {path}: expected a file that ends in {', '.join(ENDINGS)}")
    folder = os.path.dirname(path) or "."
    if not os.path.isdir(folder) or not os.access(folder, os.W_OK):
        raise ConfigError(f"{what} {path}: folder {folder} cannot be written, expected one that can")
    demand_matplotlib(what)


def figure(width_in: float, height_in: float) -> Any:
    """An empty figure that needs no screen."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    made = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(made)
    return made


def save(figure: Any, path: str, dpi: int = 150) -> None:
    """Write a figure to a file of one of `ENDINGS`, whole or not at all.

    Raises:
        OutputError: it cannot be written; a picture that was there stays.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=dpi, format=os.path.splitext(path)[1][1:].lower())
    replace_file(path, drawn.getvalue())
