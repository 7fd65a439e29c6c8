"""Environment sensors as the board sees them: I2C slaves, and the pulses of the dust sensor."""

import dataclasses
import math
import random
from typing import Callable, List, NamedTuple, Tuple

from mrl_driver.protocol.table import I2c, Sensor
from sim_arduino.world.scene import PIXELS, Environment

THERMOPILE_ADDRESS, COMPASS_ADDRESS = 0x68, 0x60


def _byte(value: float) -> int:
    return max(0, min(255, round(value)))


class EnvironmentErrors(NamedTuple):
    """Standard deviations of the errors of the environment sensors; none by default."""

    heat_offset_c: float = 0.0  # offset of each pixel of the thermopile, the same for all readings [degC]
    heat_scale: float = 0.0  # its scale
    heat_noise_c: float = 0.0  # its noise, new in each reading [degC]
    dust_scale: float = 0.0  # scale of the dust sensor, the same for all readings
    dust_noise: float = 0.0  # its noise as a share of the value, new in each reading
    alcohol_offset: float = 0.0  # offset of the alcohol sensor, the same for all readings [ADC count]
    alcohol_noise: float = 0.0  # its noise, new in each reading [ADC count]


PERFECT = EnvironmentErrors()


class SpoiltReadings:
    """Adds the errors of one robot's sensors, which `seed` draws, to the values at its place."""

    def __init__(self, errors: EnvironmentErrors, seed: int = 0) -> None:
        self._errors, self._rng = errors, random.Random(f"environment {seed}")
        gauss = self._rng.gauss
        self._offsets_c = [gauss(0.0, errors.heat_offset_c) for _ in range(PIXELS)]
        self._scales = [gauss(1.0, errors.heat_scale) for _ in range(PIXELS)]
        self._dust = gauss(1.0, errors.dust_scale)
        self._alcohol = gauss(0.0, errors.alcohol_offset)

    def reading(self, around: Environment) -> Environment:
        """The values with the errors of one reading."""
        if not any(self._errors):
            return around
        gauss, errors = self._rng.gauss, self._errors
        pixels = (
            scale * pixel + offset + gauss(0.0, errors.heat_noise_c)
            for pixel, scale, offset in zip(around.pixels_c, self._scales, self._offsets_c)
        )
        count = round(around.alcohol_count + self._alcohol + gauss(0.0, errors.alcohol_noise))
        return dataclasses.replace(
            around,
            pixels_c=tuple(pixels),
            dust_pcs_l=max(0.0, around.dust_pcs_l * self._dust * gauss(1.0, errors.dust_noise)),
            alcohol_count=max(0, min(1023, count)),
        )


class Registers:
    """An I2C slave with registers of one byte, `image` at a time [s]: a write sets the pointer, a read starts there."""

    def __init__(self, image: Callable[[float], bytes]) -> None:
        self.present = True
        self._image, self._pointer = image, 0

    def write(self, data: bytes, time_s: float) -> bool:
        """Sets the register pointer; False without an acknowledge."""
        if data and self.present:
            self._pointer = data[0]
        return self.present

    def read(self, count: int, time_s: float) -> bytes:
        """`count` registers from the pointer on; 0xFF past the last."""
        return self._image(time_s)[self._pointer : self._pointer + count].ljust(count, b"\xff")


def thermopile(sensed_at: Callable[[float], Environment]) -> Registers:
    """TPA81: register 0 version, 1 ambient, 2 to 9 pixels [degC]."""

    def image(time_s: float) -> bytes:
        around = sensed_at(time_s)
        return bytes([7, _byte(around.ambient_c), *map(_byte, around.pixels_c)])

    return Registers(image)


def plain_sensor(row: Sensor, where: I2c, sensed_at: Callable[[float], Environment]) -> Registers:
    """A sensor with only the registers of its row in the table; all its fields have the same value."""

    def image(time_s: float) -> bytes:
        count, data = round(sensed_at(time_s).others[row.name] * where.per_unit), bytes(where.register)
        for each in row.fields:
            bits = 8 * where.width
            least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if each.low < 0 else (0, (1 << bits) - 1)
            data += max(least, min(most, count)).to_bytes(where.width, "big", signed=each.low < 0)
        return data

    return Registers(image)


def compass(yaw_at: Callable[[float], float], north_rad: float) -> Registers:
    """CMPS10: register 0 version, 1 bearing in 1/256 turn, 2-3 bearing [0.1 deg], 4 pitch, 5 roll.

    Bearings run clockwise from north.
    """

    def image(time_s: float) -> bytes:
        bearing = math.degrees(north_rad - yaw_at(time_s)) % 360.0
        tenths = round(bearing * 10.0) % 3600
        return bytes([16, int(bearing / 360.0 * 256.0) & 0xFF, tenths >> 8, tenths & 0xFF, 0, 0])

    return Registers(image)


_LITRES = 0.2832  # 0.01 cubic feet [l]: the curve of the PPD42NS counts particles in this volume
_LONGEST_S, _SHORTEST_S, _USUAL_S = 0.09, 0.01, 1.0


def dust_share(pcs_l: float) -> float:
    """Share of the time for which the PPD42NS holds its output low, 0 to 0.4.

    It inverts the sensor's curve p = 1.1 r^3 - 3.8 r^2 + 520 r: p particles per 0.01 cubic feet at r percent.
    """
    low, high = 0.0, 40.0
    for _ in range(40):
        r = 0.5 * (low + high)
        low, high = (r, high) if ((1.1 * r - 3.8) * r + 520.0) * r < pcs_l * _LITRES else (low, r)
    return low / 100.0


class DustPulses:
    """Output of the PPD42NS: low pulses of 10 to 90 ms; their share of the time gives the concentration."""

    def __init__(self, pcs_l_at: Callable[[float], float]) -> None:
        self._pcs_l_at = pcs_l_at
        self._next_s = 0.1 * _USUAL_S

    def edges(self, to_s: float) -> List[Tuple[float, int]]:
        """Times [s] and levels of the edges of all pulses that begin until `to_s`."""
        found: List[Tuple[float, int]] = []
        while self._next_s <= to_s:
            begin_s, share = self._next_s, dust_share(self._pcs_l_at(self._next_s))
            if share < 1e-6:
                self._next_s += _USUAL_S
                continue
            width_s = min(_LONGEST_S, max(_SHORTEST_S, share * _USUAL_S))
            found += [(begin_s, 0), (begin_s + width_s, 1)]
            self._next_s += width_s / share
        return found
