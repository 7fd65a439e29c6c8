"""The environment values at a robot's position, in the units of the sensors."""

from dataclasses import dataclass, field
from typing import Dict, Tuple

from mrl_driver.protocol.table import SENSORS, Sensor

OWN_KIND = ("alcohol", "dust", "thermopile", "light", "compass")
"""Sensors that the emulator models in more detail than their row of the table."""
OTHERS: Tuple[Sensor, ...] = tuple(row for row in SENSORS if row.name not in OWN_KIND)
"""Sensors that are emulated from their row of the table: one number at the robot's position."""
PIXELS = 8


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
