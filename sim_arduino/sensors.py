"""Environment sensors as the board sees them: two I2C slaves and the values of the analog ones."""

import math
from dataclasses import dataclass
from typing import Callable, Tuple

THERMOPILE_ADDRESS, COMPASS_ADDRESS = 0x68, 0x60
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


def _byte(value: float) -> int:
    return max(0, min(255, round(value)))


class _Registers:
    """An I2C slave with one-byte registers: a write sets the pointer, a read goes on from there."""

    def __init__(self) -> None:
        self.present = True
        self._pointer = 0

    def write(self, data: bytes, time_s: float) -> bool:
        """Sets the register pointer; False without an acknowledge."""
        if data and self.present:
            self._pointer = data[0]
        return self.present

    def read(self, count: int, time_s: float) -> bytes:
        """`count` registers from the pointer on; 0xFF past the last."""
        image = self.image(time_s)
        return image[self._pointer : self._pointer + count].ljust(count, b"\xff")

    def image(self, time_s: float) -> bytes:
        """All registers."""
        raise NotImplementedError


class Thermopile(_Registers):
    """TPA81: register 0 version, 1 ambient, 2 to 9 pixels [degC]."""

    def __init__(self, sensed_at: Callable[[float], Environment]) -> None:
        super().__init__()
        self._sensed_at = sensed_at

    def image(self, time_s: float) -> bytes:
        """All registers."""
        around = self._sensed_at(time_s)
        return bytes([7, _byte(around.ambient_c), *map(_byte, around.pixels_c)])


class Compass(_Registers):
    """CMPS10: register 0 version, 1 bearing in 1/256 turn, 2-3 bearing [0.1 deg], 4 pitch, 5 roll.

    Bearings run clockwise from north.
    """

    def __init__(self, yaw_at: Callable[[float], float], north_rad: float = math.pi / 2) -> None:
        super().__init__()
        self._yaw_at, self._north_rad = yaw_at, north_rad

    def image(self, time_s: float) -> bytes:
        """All registers."""
        bearing = math.degrees(self._north_rad - self._yaw_at(time_s)) % 360.0
        tenths = round(bearing * 10.0) % 3600
        return bytes([16, int(bearing / 360.0 * 256.0) & 0xFF, tenths >> 8, tenths & 0xFF, 0, 0])
