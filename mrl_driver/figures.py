"""Shared parts of all figures: colours, file formats, and matplotlib, which is an extra of the package."""

import io
import os
import warnings
from typing import Any

from . import files
from .errors import ConfigError, one_line

BLUE, ORANGE, GREEN, PINK, SKY, GREY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#999999"
"""Okabe and Ito's colours, which colour-blind readers can tell apart.  Lines also differ in their dashes, for print."""
ENDINGS = (".png", ".pdf", ".svg")


def require_matplotlib(what: str = "--plot") -> None:
    """Check at the start that figures can be drawn at the end; raise ConfigError if matplotlib is not installed."""
    # a newer matplotlib next to Debian's mplot3d package warns about it; nothing here uses mplot3d
    warnings.filterwarnings("ignore", "Unable to import Axes3D")
    try:
        import matplotlib  # noqa: F401 - looked for, not used
    except ImportError:
        raise ConfigError(
            f"{what} needs matplotlib; install it with: pip install 'mrl-driver[plot]'"
        ) from None


def require_writable(path: str, what: str = "--plot") -> None:
    """Check at the start that a figure can be drawn at the end; raise ConfigError as `files.require_writable`, or if
    matplotlib is not installed.
    """
    files.require_writable(path, what, ENDINGS)
    require_matplotlib(what)


def plain(text: str) -> str:
    """Return a text of a file as a figure shows it: matplotlib would read what is between two `$` as a formula."""
    return one_line(text).replace("$", r"\$")


def figure(width_in: float, height_in: float) -> Any:
    """Return an empty figure that does not need a screen."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    made = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(made)
    return made


def save(figure: Any, path: str, dpi: int = 150) -> None:
    """Write a figure to a file with one of `ENDINGS`, completely, or raise OutputError and leave the file as it was."""
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=dpi, format=os.path.splitext(path)[1][1:].lower())
    files.replace_file(path, drawn.getvalue())
