"""What there is to sense where a robot stands, in the units of the sensors."""

from dataclasses import dataclass, field
from typing import Dict, Tuple

from mrl_driver.protocol.table import SENSORS, Sensor

OWN_KIND = ("alcohol", "dust", "thermopile", "light", "compass")
"""Sensors that the emulator knows more of than their row tells."""
OTHERS: Tuple[Sensor, ...] = tuple(row for row in SENSORS if row.name not in OWN_KIND)
"""Sensors that are emulated as their row says: one number where the robot stands."""
PIXELS = 8


@dataclass
class Environment:
    """What there is to sense where the robot stands."""

    alcohol_count: int = 900
    """ADC count of the MQ303A; falls with concentration."""
    light_count: int = 500
    """ADC count of the LDR."""
    dust_pcs_l: float = 300.0
    """Particles of 1 um and larger per litre."""
    ambient_c: float = 22.0
    pixels_c: Tuple[float, ...] = (22.0,) * 8
    """What the eight pixels of the TPA81 see [degC]."""
    others: Dict[str, float] = field(default_factory=lambda: {row.name: row.usual for row in OTHERS})
    """What all other sensors of the table sense, by name, in the unit of their fields."""
