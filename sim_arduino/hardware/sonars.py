"""Three MB1300 sonars in a chain: power, trigger, firing order, echo, output voltage.

Dead zone, range, cone and 100 ms per reading are from the data sheet and (Araujo 2012).  The voltage is the inverse
of that thesis's calibration: its curve applied to the ADC count gives the true distance, unless `SonarErrors` has
another curve.
"""

import math
import random
from typing import Callable, Dict, List, NamedTuple, Sequence

from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.robot.models import SonarMount
from sim_arduino.world.world import World

_ORDER = ("front", "left", "right")
READING_S = 0.1
START_S = 0.25  # time from power on to the first possible reading [s]
SOUND_M_S = 343.0
HALF_CONE_RAD = math.radians(18.0)
DEAD_ZONE_M, RANGE_M = 0.15, 6.45
FULL_COUNT = 645  # ADC count of a sensor with nothing in range
_A, _B, _C = 1.1767, 0.94657, -0.3759
VOLTS_PER_COUNT = 5.0 / 1024.0


class SonarErrors(NamedTuple):
    """Errors of the readings; none by default."""

    noise: float = 0.0  # standard deviation of the range [m]
    missed: float = 0.0  # share of readings whose echo is lost, so that nothing seems to be in range
    crosstalk: float = 0.0
    """Share of foreign pings that count as the echo if they come first.

    Foreign pings are echoes of the previous sensor in the chain, and pings that other robots' sonars send directly into
    this one at random times."""
    gain: float = 1.0  # factor of the curve that gives this sensor's distances, divided by the thesis's
    exponent: float = 1.0  # exponent of this curve, divided by the thesis's
    offset: float = 0.0  # constant of this curve, minus the thesis's [m]


FLAWLESS = SonarErrors()
OF_CHAIN = ("crosstalk", "gain", "exponent", "offset")
"""Errors of MB1300 sonars alone; those of an HC-SR04 or analog range sensor are the others."""
DEAD, STUCK, DEAF = "dead", "stuck", "deaf"
STATES = (DEAD, STUCK, DEAF)
"""How a sonar fails: its output is 0 V, keeps its voltage, or shows that nothing is in range."""


def count_of(range_m: float, errors: SonarErrors = FLAWLESS) -> int:
    """ADC count with which a sonar with this curve reports a distance [m]; other errors are left out."""
    if range_m > RANGE_M:
        return FULL_COUNT
    centimetres = 100.0 * (max(DEAD_ZONE_M, range_m) - errors.offset)
    base = max(0.0, centimetres - _C) / (_A * errors.gain)
    return min(FULL_COUNT, round(base ** (1.0 / (_B * errors.exponent))))


class SonarChain:
    """The sensors `names` in their firing order; those of the robot `name` in the world ignore its own body.

    A trigger makes each sensor fire once, one every 100 ms, at the robot's pose of that time.  While the trigger is
    high, rounds follow each other.
    """

    def __init__(
        self,
        mounts: Dict[str, SonarMount],
        world: World,
        pose_at: Callable[[float], Pose],
        name: str = "",
        errors: SonarErrors = FLAWLESS,
        seed: int = 0,
    ) -> None:
        order = sorted(mounts, key=lambda name: _ORDER.index(name) if name in _ORDER else len(_ORDER))
        self._mounts: Sequence[SonarMount] = [mounts[name] for name in order]
        self.names = tuple(order)
        self.failed: Dict[str, str] = {}  # one of `STATES` by name of each sonar that has failed
        self._world = world
        self._pose_at = pose_at
        self._powered_s = math.inf
        self._turn_s = math.inf
        self._turn = 0
        self._held = False
        self._measured = 0
        self._counts = dict.fromkeys(order, 0)
        self._name, self._errors = name, errors
        self._rng = random.Random(f"sonars {seed}")
        self._before_m = math.inf

    def power(self, on: bool, time_s: float) -> None:
        """Level of pin D13: without power all outputs are 0 V."""
        self.advance(time_s)
        if on and self._powered_s == math.inf:
            self._powered_s = time_s
            self._begin(time_s)
        if not on:
            self._powered_s = self._turn_s = math.inf
            self._counts = dict.fromkeys(self.names, 0)

    def trigger(self, time_s: float) -> None:
        """A pulse on pin D12: starts a round, unless a round runs or the sensors are not ready yet."""
        self.hold(True, time_s)
        self.hold(False, time_s)

    def hold(self, high: bool, time_s: float) -> None:
        """Level of pin D12: while it is high, a round starts as soon as the sensors are ready and no round runs."""
        self.advance(time_s)
        self._held = high
        self._begin(time_s)
        if not high and self._turn == 0 and self._turn_s > time_s:
            self._turn_s = math.inf

    def _begin(self, time_s: float) -> None:
        if self._held and self._turn_s == math.inf and self._mounts:
            self._turn_s, self._turn = max(time_s, self._powered_s + START_S), 0

    @property
    def next_s(self) -> float:
        """Time of the next event in the chain [s]."""
        return self._turn_s

    def advance(self, time_s: float) -> None:
        """Lets the sensors fire until `time_s` [s]."""
        while self._turn_s <= time_s:
            if self._turn:
                self._finish(self._turn - 1)
            if self._turn == len(self._mounts):
                self._turn = 0
                if not self._held:
                    self._turn_s = math.inf
                    return
            self._measured = self._fire(self._mounts[self._turn], self._turn_s)
            self._turn += 1
            self._turn_s += READING_S

    def _finish(self, index: int) -> None:
        """Puts the reading of a sensor on its output."""
        name = self.names[index]
        state = self.failed.get(name)
        if state != STUCK:
            self._counts[name] = FULL_COUNT if state == DEAF else self._measured

    def volts(self, channel: int, time_s: float) -> float:
        """Output voltage of the front (0), left (1) or right sensor (2) [V]: its last finished reading.

        0 without the sensor, and without power.
        """
        self.advance(time_s)
        name = _ORDER[channel] if channel < len(_ORDER) else ""
        count = self._counts.get(name, 0)
        if self.failed.get(name) == DEAD:
            return 0.0
        return (count + 0.5) * VOLTS_PER_COUNT if count else 0.0

    def _fire(self, mount: SonarMount, time_s: float) -> int:
        pose = self._pose_at(time_s).compose(*mount.pose)
        range_m = self._world.nearest(pose, HALF_CONE_RAD, RANGE_M, self._name)
        return count_of(self._spoilt(range_m, pose) if self._errors != FLAWLESS else range_m, self._errors)

    def _spoilt(self, range_m: float, pose: Pose) -> float:
        missed, confused, noise = self._rng.random(), self._rng.random(), self._rng.gauss(0.0, 1.0)
        measured_m = min(range_m, self._before_m) if confused < self._errors.crosstalk else range_m
        self._before_m = range_m
        if self._errors.crosstalk:
            measured_m = min([measured_m, *self._strangers(pose)])
        return math.inf if missed < self._errors.missed else measured_m + self._errors.noise * noise

    def _strangers(self, pose: Pose) -> List[float]:
        """False distances from pings of other robots.

        Other robots carry the same sonars; the phase of their rounds is random.
        """
        found = []
        for mover in self._world.robots(self._name):
            for mount in self._mounts:
                sender = mover.pose.compose(*mount.pose)
                if not (_in_cone(pose, sender) and _in_cone(sender, pose)):
                    continue
                if not self._world.sees(pose.x_m, pose.y_m, sender.x_m, sender.y_m):
                    continue
                arrives_s = self._rng.uniform(0.0, READING_S * len(self._mounts))
                if self._rng.random() < self._errors.crosstalk:
                    found.append(0.5 * SOUND_M_S * arrives_s)
        return [range_m for range_m in found if range_m < RANGE_M]


def _in_cone(sonar: Pose, other: Pose) -> bool:
    dx, dy = other.x_m - sonar.x_m, other.y_m - sonar.y_m
    off = wrap_angle(math.atan2(dy, dx) - sonar.yaw_rad)
    return abs(off) <= HALF_CONE_RAD and math.hypot(dx, dy) <= RANGE_M
