"""The tip-over margin over one quantity that changes: the arm's angle or height, an acceleration, a force.  No I/O."""

import math
from typing import Callable, Dict, List, NamedTuple, Tuple

from mrl_driver.errors import ConfigError

from .margin import MOST_M_S2, MOST_N, Margin, Situation, bisect
from .vehicle_file import RANGES

POINTS = 61  # values of a sweep


class Quantity(NamedTuple):
    """A quantity that can be swept."""

    unit: str
    low: float
    high: float
    change: Callable[[Situation, float], Situation]


QUANTITIES: Dict[str, Quantity] = {
    "arm-angle": Quantity("deg", *RANGES["angle_deg"], lambda now, value: now.with_arm(angle_deg=value)),
    "arm-height": Quantity("m", *RANGES["height_m"], lambda now, value: now.with_arm(height_m=value)),
    "acceleration": Quantity(
        "m/s2", 0.0, MOST_M_S2, lambda now, value: now._replace(acceleration_m_s2=value)
    ),
    "force": Quantity("N", 0.0, MOST_N, Situation.with_force),
}


class Range(NamedTuple):
    """Values of a quantity, from the first to the last."""

    name: str
    first: float
    last: float

    @property
    def quantity(self) -> Quantity:
        """The quantity."""
        return QUANTITIES[self.name]


def parse(text: str) -> Range:
    """Return the range in a text such as `force=0:900`; raise ConfigError for another quantity, or other values."""
    name, _, values = text.partition("=")
    if name not in QUANTITIES:
        raise ConfigError(f"sweep is {text!r}, expected QUANTITY=FROM:TO with {', '.join(QUANTITIES)}")
    quantity = QUANTITIES[name]
    try:
        first, last = map(float, values.split(":"))
    except ValueError:
        first = last = math.nan
    if not quantity.low <= first < last <= quantity.high:
        raise ConfigError(
            f"sweep is {text!r}, expected {name}=FROM:TO with two rising numbers from {quantity.low:g} to "
            f"{quantity.high:g} {quantity.unit}"
        )
    return Range(name, first, last)


def sweep(situation: Situation, over: Range, points: int = POINTS) -> List[Tuple[float, Margin]]:
    """Return the values of the quantity, and the least margin at each."""
    step = (over.last - over.first) / (points - 1)
    values = [over.first + step * number for number in range(points - 1)] + [over.last]
    return [(value, over.quantity.change(situation, value).margin()) for value in values]


def crossings(situation: Situation, over: Range, found: List[Tuple[float, Margin]]) -> List[float]:
    """Return the values between the points of a sweep at which the vehicle begins or ceases to tip over."""

    def tips(value: float) -> bool:
        return over.quantity.change(situation, value).margin().angle_rad < 0

    made = []
    for (low, before), (high, after) in zip(found, found[1:]):
        if (before.angle_rad < 0) != (after.angle_rad < 0):
            made.append(bisect(lambda value: tips(value) == (before.angle_rad < 0), low, high))  # noqa: B023
    return made
