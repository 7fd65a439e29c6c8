"""HC-SR04 on trigger and echo pins.

A trigger of at least 10 us is followed by the ping, and then by an echo pulse as long as the sound is under way.
Without an obstacle in range the pulse ends by itself.  Source: data sheet of the HC-SR04 (ElecFreaks): 2 cm to 4 m,
15 deg; the times of the ping, and of a pulse without an obstacle, are assumed.
"""

import math
import random
from typing import Callable, Dict, Mapping, NamedTuple, Optional, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.robot.models import SonarMount
from sim_arduino.world.world import World

from .sonars import SonarErrors

TRIGGER_S = 9e-6  # shorter triggers start nothing; the board's lasts 10 us
PING_S = 450e-6  # from the trigger's end to the echo's begin
NOTHING_S = 38e-3  # length of the echo with nothing in range
AIR_C = 20.0  # air temperature [degC]
SILENT, HELD = "silent", "held"
STATES = (SILENT, HELD)
"""How a sensor fails: it does not answer, or its echo stays high."""
Echo = Tuple[float, float]


def sound_m_s(air_c: float) -> float:
    """Speed of sound in air of a temperature [degC]."""
    return 331.3 + 0.606 * air_c


class Wires(NamedTuple):
    """Pins of a sensor (Arduino numbers)."""

    trigger: int
    echo: int


class EchoRanges:
    """The sensors of one robot, by input of the board, such as `range_1`.

    Attributes:
        failed: One of `STATES` by input of each sensor that has failed.
    """

    def __init__(
        self,
        wires: Mapping[str, Wires],
        mounts: Mapping[str, SonarMount],
        world: World,
        pose_at: Callable[[float], Pose],
        name: str,
        errors: SonarErrors,
        seed: int,
    ) -> None:
        self.wires = dict(wires)
        self.failed: Dict[str, str] = {}
        self._mounts, self._world, self._pose_at, self._name = mounts, world, pose_at, name
        self._errors, self._rng = errors, random.Random(f"ranges {seed}")
        self._high_s = dict.fromkeys(self.wires, math.inf)  # when the trigger has become high
        self._echoes: Dict[str, Echo] = {}

    def input_of(self, pin: int) -> str:
        """The input with this trigger or echo pin; empty if there is none."""
        return next((each for each, wires in self.wires.items() if pin in wires), "")

    def pin_changed(self, pin: int, level: int, time_s: float) -> None:
        """The board drives a pin, perhaps a trigger."""
        found = self.input_of(pin)
        if not found or pin != self.wires[found].trigger:
            return
        high_s, self._high_s[found] = self._high_s[found], time_s if level else math.inf
        if not level and time_s - high_s >= TRIGGER_S:
            self._fire(found, time_s)

    def echo(self, pin: int) -> Optional[Echo]:
        """Begin and end of the last echo on a pin [s], which may still lie ahead; None if there was none."""
        found = self.input_of(pin)
        return (0.0, math.inf) if self.is_held(found) else self._echoes.get(found)

    def is_held(self, found: str) -> bool:
        """The echo of an input stays high."""
        return self.failed.get(found) == HELD

    def _fire(self, found: str, time_s: float) -> None:
        mount, last = self._mounts.get(found), self._echoes.get(found)
        if mount is None or (last and time_s < last[1]):
            return
        self._echoes.pop(found, None)
        if self.failed.get(found) == SILENT:
            return
        begin_s = time_s + PING_S
        self._echoes[found] = begin_s, begin_s + self._length_s(mount, time_s)

    def _length_s(self, mount: SonarMount, time_s: float) -> float:
        sensor = mount.kind
        half_rad = 0.5 * sensor.field_of_view_rad
        pose = self._pose_at(time_s).compose(*mount.pose)
        range_m = self._world.nearest(pose, half_rad, sensor.farthest_m, self._name)
        missed, noise = self._rng.random(), self._rng.gauss(0.0, 1.0)
        if missed < self._errors.missed or range_m > sensor.farthest_m:
            return NOTHING_S
        return 2.0 * max(sensor.nearest_m, range_m + self._errors.noise * noise) / sound_m_s(AIR_C)
