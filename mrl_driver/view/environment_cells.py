"""A map of the environment in cells: what is mapped, from which levels on, in which colours.  No I/O.

The levels of alert are those of (Araujo 2012; Araujo et al. 2015) for heat and dust.  The others are assumed: none is
published for alcohol, whose alert is a quarter more than in clean air, and none below an alert.
"""

import math
from typing import Dict, List, NamedTuple, Sequence, Tuple

from mrl_driver import figures

CELL_M, MOST_CELLS = 0.2, 10_000
"""Size of a cell [m], about that of the robots, and largest number of cells of a variable: 400 m2."""
HIGHEST, LATEST = "highest", "latest"
SHOWN = (HIGHEST, LATEST)
"""What a cell shows.  The highest reading is what an alert is about: a draught takes gas away, and it comes back."""
Cell = Tuple[int, int]


class Variable(NamedTuple):
    """A variable that is mapped; its value is the mean of its sensor's fields.

    A lamp heats one pixel of the thermopile from afar, and the more of them the closer it is.
    """

    title: str
    sensor: str  # name in the command table
    notice: float
    alert: float
    """Values from here on are drawn: small and pale from `notice`, large from `alert`."""
    low: float
    high: float
    """Readings outside are those of a sensor that is missing, or not calibrated."""
    unit: str
    colour: str
    third: int  # the part of each cell that it is drawn in: left -1, middle 0, right 1

    def value(self, fields: Sequence[float]) -> float:
        """Return the value of a reading; raise ValueError if the sensor cannot have measured it."""
        if not (fields and all(self.low <= each <= self.high for each in fields)):
            got = ", ".join(f"{each:g}" for each in fields) or "nothing"
            raise ValueError(
                f"got {got}, expected {self.low:g} to {self.high:g} {self.unit}; connect or calibrate the sensor "
                f"{self.sensor}"
            )
        return sum(fields) / len(fields)


HEAT = Variable("heat", "thermopile", 32.0, 39.0, 1.0, 254.0, "degC", figures.ORANGE, -1)
DUST = Variable("dust", "dust", 2750.0, 5500.0, 0.0, 1e6, "pcs/l", figures.BLUE, 0)
ALCOHOL = Variable("alcohol", "alcohol", 140.0, 154.0, 1.0, 1022.0, "counts", figures.GREEN, 1)
VARIABLES = (HEAT, DUST, ALCOHOL)


class Cells:
    """The cells of one variable: the highest or the latest reading in each."""

    def __init__(self, size_m: float = CELL_M, shown: str = HIGHEST) -> None:
        self.size_m, self._shown = size_m, shown
        self.values: Dict[Cell, float] = {}

    def put(self, x_m: float, y_m: float, value: float) -> None:
        """Take a reading at a place; raise ValueError or OverflowError if its cell is one too many, or nowhere."""
        cell = math.floor(x_m / self.size_m), math.floor(y_m / self.size_m)
        if cell not in self.values and len(self.values) >= MOST_CELLS:
            raise ValueError(f"the map has {MOST_CELLS} cells, expected no more; take larger ones")
        before = self.values.get(cell, -math.inf)
        self.values[cell] = max(before, value) if self._shown == HIGHEST else value

    def centre(self, cell: Cell) -> Tuple[float, float]:
        """Return the middle of a cell [m]."""
        return (cell[0] + 0.5) * self.size_m, (cell[1] + 0.5) * self.size_m

    def between(self, low: float, high: float = math.inf) -> List[Tuple[float, float]]:
        """Return the middles of the cells with a value of at least `low`, and below `high` [m]."""
        return [self.centre(cell) for cell, value in self.values.items() if low <= value < high]

    @property
    def peak(self) -> Tuple[float, float]:
        """The middle of the cell with the largest value [m]."""
        return self.centre(max(self.values, key=lambda cell: self.values[cell]))
