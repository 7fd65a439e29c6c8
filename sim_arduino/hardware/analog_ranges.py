"""Sharp's analog range sensors: a new voltage every 38 ms, by the inverse of the curve of their data sheets.

Closer than the nearest distance of the curve the voltage rises to a peak (figure of the data sheets), and then falls to
0 V, here in a straight line, which is assumed: there an obstacle looks farther than it is.
"""

import random
from typing import Callable, Mapping, Optional

from mrl_driver.geometry import Pose
from mrl_driver.robot.models import RANGE_KINDS, SonarMount
from sim_arduino.world.world import World

from .echo_ranges import HELD, SILENT
from .sonars import SonarErrors

READING_S = 38.3e-3
NOTHING_V = 0.25  # output with nothing in range [V]; assumed
_PEAKS = {"GP2Y0A21": (0.06, 3.1), "GP2Y0A02": (0.15, 2.75)}
"""Distance [m] and voltage [V] of the peak, by type of sensor."""


def volts_at(range_m: float, kind: str) -> float:
    """Output of a type of sensor at a distance [V], between two points linear in the reciprocal of the distance."""
    points = (_PEAKS[kind], *RANGE_KINDS[kind].curve)
    peak_m, peak_v = points[0]
    if range_m > points[-1][0]:
        return NOTHING_V
    if range_m <= peak_m:
        return peak_v * range_m / peak_m
    pairs = zip(points, points[1:])
    (near_m, most_v), (far_m, least_v) = next(pair for pair in pairs if range_m <= pair[1][0])
    return least_v + (most_v - least_v) * (1 / range_m - 1 / far_m) / (1 / near_m - 1 / far_m)


class AnalogRange:
    """One sensor of a robot, on an input of the board such as `range_1`; it gives 0 V if its mount is not analog.

    If `failed` has a state of `echo_ranges.STATES` for the input, it gives 0 V, or keeps its voltage.
    """

    def __init__(
        self,
        given: str,
        mount: Optional[SonarMount],
        world: World,
        pose_at: Callable[[float], Pose],
        name: str,
        errors: SonarErrors,
        seed: int,
        failed: Mapping[str, str],
    ) -> None:
        self._input, self._mount, self._failed = given, mount, failed
        self._world, self._pose_at, self._name = world, pose_at, name
        self._errors, self._rng = errors, random.Random(f"{given} {seed}")
        self._volts, self._due_s = NOTHING_V, 0.0

    def volts(self, time_s: float) -> float:
        """Output voltage [V]."""
        state = self._failed.get(self._input)
        if state == SILENT or self._mount is None or not self._mount.kind.curve:
            return 0.0
        if time_s >= self._due_s and state != HELD:
            self._volts, self._due_s = self._measure(self._mount, time_s), time_s + READING_S
        return self._volts

    def _measure(self, mount: SonarMount, time_s: float) -> float:
        sensor, pose = mount.kind, self._pose_at(time_s).compose(*mount.pose)
        range_m = self._world.nearest(pose, 0.5 * sensor.field_of_view_rad, sensor.farthest_m, self._name)
        missed, noise = self._rng.random(), self._rng.gauss(0.0, 1.0)
        if missed < self._errors.missed:
            return NOTHING_V
        return volts_at(max(0.0, range_m + self._errors.noise * noise), mount.type)
