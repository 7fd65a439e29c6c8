"""The environment in a world: heat, gas, dust and light around their sources, and the direction of north.

The field falls from a source's value to ambient as exp(-(d / reach)^2) with the distance d.  The thermopile sees heat
pixel by pixel, along lines of sight.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Callable, Dict, NamedTuple, Tuple

from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.protocol.table import SENSORS, Sensor

OWN_KIND = ("alcohol", "dust", "thermopile", "light", "compass")
"""Sensors that the emulator models in more detail than their row of the table."""
OTHERS: Tuple[Sensor, ...] = tuple(row for row in SENSORS if row.name not in OWN_KIND)
"""Sensors that are emulated from their row of the table: one number at the robot's position."""
PIXELS = 8
PIXEL_RAD = math.radians(5.12)  # width of one of the TPA81's eight pixels, side by side (data sheet)


@dataclass
class Environment:
    """The environment values at the robot's position."""

    alcohol_count: int = 900  # ADC count of the MQ303A; falls with concentration
    light_count: int = 500  # ADC count of the LDR
    dust_pcs_l: float = 300.0  # particles of 1 um and larger per litre
    ambient_c: float = 22.0
    pixels_c: Tuple[float, ...] = (22.0,) * 8  # temperatures of the eight pixels of the TPA81 [degC]
    others: Dict[str, float] = field(default_factory=lambda: {row.name: row.usual for row in OTHERS})
    """Values of all other sensors of the table, by name, in the unit of their fields."""


class Source(NamedTuple):
    """A source of heat, gas, dust, light or another value."""

    x_m: float
    y_m: float
    value: float  # value at the centre, in the unit of the sensor
    reach_m: float
    """Distance at which 1/e of the value is left [m]; for heat, the radius of the hot object [m]."""


Sources = Tuple[Source, ...]
Sight = Callable[[float, float, float, float], bool]


class Scene(NamedTuple):
    """All sources of a world.  Units: heat [degC], gas and light [ADC count], dust [pcs/l]."""

    ambient: Environment = Environment()
    heat: Sources = ()
    gas: Sources = ()
    dust: Sources = ()
    light: Sources = ()
    north_rad: float = math.pi / 2  # direction of north, counter-clockwise from x
    others: Dict[str, Sources] = {}  # noqa: RUF012 - never changed
    """Sources for all other sensors of the table, by name, in the unit of their fields."""

    def sensed(self, base: Environment, pose: Pose, sees: Sight) -> Environment:
        """The environment values at a pose; `base` holds the values far from all sources.

        `sees` says whether two points see each other: x, y of one, x, y of the other [m].
        """
        if not (self.heat or self.gas or self.dust or self.light or self.others):
            return base
        return replace(
            base,
            alcohol_count=_adc_count(_field(self.gas, base.alcohol_count, pose)),
            light_count=_adc_count(_field(self.light, base.light_count, pose)),
            dust_pcs_l=_field(self.dust, base.dust_pcs_l, pose),
            pixels_c=self._pixels(base, pose, sees),
            others={
                name: _field(self.others.get(name, ()), value, pose) for name, value in base.others.items()
            },
        )

    def _pixels(self, base: Environment, pose: Pose, sees: Sight) -> Tuple[float, ...]:
        """Temperature of each pixel, mixed from the objects that fill it; pixel 1 is the leftmost."""
        pixels = list(base.pixels_c)
        for source in self.heat:
            dx, dy = source.x_m - pose.x_m, source.y_m - pose.y_m
            if not sees(pose.x_m, pose.y_m, source.x_m, source.y_m):
                continue
            middle = wrap_angle(math.atan2(dy, dx) - pose.yaw_rad)
            half = math.atan2(source.reach_m, math.hypot(dx, dy))
            for i in range(PIXELS):
                left = (PIXELS / 2 - i) * PIXEL_RAD
                covered = min(left, middle + half) - max(left - PIXEL_RAD, middle - half)
                pixels[i] += max(0.0, covered / PIXEL_RAD) * (source.value - pixels[i])
        return tuple(pixels)


def _adc_count(value: float) -> int:
    """The value as an ADC count; larger sums saturate the converter."""
    return max(0, min(1023, round(value)))


def _field(sources: Sources, base: float, pose: Pose) -> float:
    value = base
    for source in sources:
        squared = (source.x_m - pose.x_m) ** 2 + (source.y_m - pose.y_m) ** 2
        value += (source.value - base) * math.exp(-squared / source.reach_m**2)
    return value
