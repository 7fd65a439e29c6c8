"""Warning and protective zones: how fast the robot may be towards what its sonars or its laser see.  Pure.

Both zones reach from the body's edge into the direction of motion, as wide as the body and a clearance on either side.
They grow with the speed v by the way to a standstill, v * reaction + v^2 / (2 * braking).  What stands in the warning
zone slows the robot until the zone has shrunk clear of it, or down to the slow speed; what stands in the protective
zone slows it further, so that it stands where that zone is shortest.  There it may turn and drive away, but not come
nearer, until the way is free by the hysteresis more.

Speeds are lowered, never raised or turned around, and only along x: the yaw rate stays, for turning is how a planner
gets away.  What cannot be known is taken so:

- A sonar without a valid reading (NaN), and a direction that no sensor looks in, such as backwards on a robot with
  three sonars in front: the slow speed.
- A sonar or a laser of which nothing is heard any more: a standstill in the direction it looks in.
- A range of -inf (too near, REP-117): a standstill as well; of a laser, the nearest that it can measure.
- A scan without a valid range: as a sonar without one.
"""

import math
import threading
from collections import deque
from typing import Deque, Dict, List, Mapping, NamedTuple, Sequence, Tuple

from .errors import ConfigError
from .robots import Body, SonarMount
from .sonar import FIELD_OF_VIEW_RAD

AHEAD, BEHIND = 1, -1
"""Directions of motion."""
STALE_S = 1.0
"""A sensor is silent when nothing was heard of it for so long: three cycles of the sonars, ten scans."""
LEAST_M_S = 0.02
"""Where no more than this is allowed the robot stands, instead of creeping on for ever."""
LASER = "laser"

Point = Tuple[float, float]


class Settings(NamedTuple):
    """The zones of a robot that stands, and how they grow."""

    warning_m: float = 0.5
    protective_m: float = 0.2
    slow_m_s: float = 0.1
    """Never slowed below this by the warning zone."""
    braking_m_s2: float = 0.2
    """Slowing down that the robot surely does."""
    reaction_s: float = 0.5
    """Twice the delays of sensors and commands together."""
    hysteresis_m: float = 0.05
    clearance_m: float = 0.05
    """Counts as in the way although it is so far beside the body."""

    def growth_m(self, speed_m_s: float) -> float:
        """What a speed adds to both zones: the way to a standstill."""
        return abs(speed_m_s) * self.reaction_s + speed_m_s**2 / (2 * self.braking_m_s2)

    def speed_m_s(self, room_m: float) -> float:
        """The greatest speed whose way to a standstill fits in a room; 0 where there is none."""
        if room_m <= 0:
            return 0.0
        lost = self.braking_m_s2 * self.reaction_s
        return math.sqrt(lost**2 + 2 * self.braking_m_s2 * room_m) - lost


_RANGES = {
    "warning_m": (0.0, 10.0),
    "protective_m": (0.0, 10.0),
    "slow_m_s": (0.01, 10.0),
    "braking_m_s2": (0.01, 100.0),
    "reaction_s": (0.0, 10.0),
    "hysteresis_m": (0.0, 1.0),
    "clearance_m": (0.0, 1.0),
}


def demand(settings: Settings) -> None:
    """Check zones before anything is opened.

    Raises:
        ConfigError: a number is out of range or NaN, or the zones contradict each other.
    """
    for name, (low, high) in _RANGES.items():
        value = getattr(settings, name)
        if not low <= value <= high:
            raise ConfigError(f"zones: {name} is {value:g}, expected a number from {low:g} to {high:g}")
    least_m = settings.protective_m + settings.hysteresis_m
    if settings.warning_m <= least_m:
        raise ConfigError(
            f"zones: warning_m is {settings.warning_m:g}, expected more than {least_m:g}, which is protective_m "
            f"{settings.protective_m:g} and hysteresis_m {settings.hysteresis_m:g}"
        )


class _Sight(NamedTuple):
    """What a sensor last said of a direction."""

    heard_s: float
    known_s: float
    room_m: float
    """Free way when the robot had come as far as `way_m`."""
    way_m: float


_UNHEARD = _Sight(-math.inf, -math.inf, math.inf, 0.0)


class Scan(NamedTuple):
    """Ranges of a laser [m], the angle of the first and between two (counter-clockwise), and where it sits."""

    ranges: Sequence[float]
    first_rad: float
    step_rad: float
    near_m: float
    mount: Tuple[float, float, float]
    """x, y, yaw in base_link [m m rad]."""

    @property
    def valid(self) -> bool:
        """Some ray has a reading; nothing in range is one."""
        return any(range_m >= self.near_m or range_m == -math.inf for range_m in self.ranges)

    def points(self) -> List[Point]:
        """What the rays hit (x, y) in base_link [m].

        -inf is as near as the laser can measure; other ranges below that, and NaN, are no readings.
        """
        x, y, yaw = self.mount
        points = []
        for number, range_m in enumerate(self.ranges):
            if self.near_m <= range_m < math.inf or range_m == -math.inf:
                range_m, angle = max(range_m, self.near_m), yaw + self.first_rad + number * self.step_rad
                points.append((x + range_m * math.cos(angle), y + range_m * math.sin(angle)))
        return points

    def looks(self) -> Tuple[int, ...]:
        """Directions of motion that lie in the fan of its rays."""
        first = self.first_rad + self.mount[2]
        low, high = sorted((first, first + self.step_rad * (len(self.ranges) - 1)))
        ways = ((AHEAD, 0.0), (BEHIND, math.pi))
        return tuple(way for way, angle in ways if low + (angle - low) % (2 * math.pi) <= high + 1e-9)


class Zones:
    """The zones of one robot; any thread may call.  Times are seconds of one clock, given by the caller."""

    def __init__(
        self, settings: Settings, body: Body, sonars: Mapping[str, SonarMount], laser: bool = False
    ) -> None:
        """`sonars` are those to listen to; with `laser` scans are expected, which look ahead at least.

        Raises:
            ConfigError: see `demand`.
        """
        demand(settings)
        self.settings = settings
        self._sonars = sonars
        self._front_m, self._half_m = body.length_m / 2, body.width_m / 2 + settings.clearance_m
        self._lock = threading.Lock()
        self._sights: Dict[int, Dict[str, _Sight]] = {AHEAD: {}, BEHIND: {}}
        for name, mount in sonars.items():
            for direction in looks(math.radians(mount.yaw_deg)):
                self._sights[direction][name] = _UNHEARD
        if laser:
            self._sights[AHEAD][LASER] = _UNHEARD
        self._way_m = 0.0
        self._ways: Deque[Tuple[float, float]] = deque()
        self._held = {AHEAD: False, BEHIND: False}
        self._warned = {AHEAD: False, BEHIND: False}
        self._direction = AHEAD

    @property
    def warning_clear(self) -> bool:
        """Nothing is in the warning zone of the direction that was last asked for."""
        return not self._warned[self._direction]

    @property
    def protective_clear(self) -> bool:
        """The robot may move in the direction that was last asked for."""
        return not self._held[self._direction]

    def moved(self, way_m: float, now: float) -> None:
        """The robot has gone so far along its x since the last call [m], negative backwards."""
        with self._lock:
            self._way_m += way_m
            self._ways.append((now, self._way_m))
            while self._ways[0][0] < now - self.settings.reaction_s:
                self._ways.popleft()

    def on_range(self, name: str, range_m: float, now: float) -> None:
        """A sonar's reading (REP-117)."""
        mount = self._sonars.get(name)
        if mount is None:
            return
        yaw = math.radians(mount.yaw_deg)
        for direction in looks(yaw):
            room_m = math.nan if math.isnan(range_m) else self._room_before(mount, yaw, range_m, direction)
            self._hear(direction, name, room_m, now)

    def on_scan(self, scan: Scan, now: float) -> None:
        """A laser's scan."""
        points = scan.points()
        for direction in scan.looks():
            ways = [
                direction * x - self._front_m
                for x, y in points
                if abs(y) <= self._half_m and direction * x > 0
            ]
            room_m = min(ways, default=math.inf) if scan.valid else math.nan
            self._hear(direction, LASER, room_m, now)

    def limit(self, linear_m_s: float, now: float) -> float:
        """The speed that is allowed of one that is asked for [m/s]."""
        with self._lock:
            direction = BEHIND if linear_m_s < 0 else AHEAD
            self._direction = direction
            return direction * min(abs(linear_m_s), self._cap(direction, abs(linear_m_s), now))

    def _cap(self, direction: int, asked_m_s: float, now: float) -> float:
        settings = self.settings
        room_m, certain = self._room(direction, now)
        edge_m = settings.protective_m + settings.growth_m(LEAST_M_S)
        edge_m += settings.hysteresis_m if self._held[direction] else 0.0
        self._held[direction] = room_m < edge_m
        far_m = settings.warning_m + settings.growth_m(asked_m_s)
        far_m += settings.hysteresis_m if self._warned[direction] else 0.0
        self._warned[direction] = room_m < far_m or not certain
        if self._held[direction]:
            return 0.0
        cap = max(settings.slow_m_s, settings.speed_m_s(room_m - settings.warning_m) if certain else 0.0)
        return min(cap, settings.speed_m_s(room_m - settings.protective_m))

    def _room(self, direction: int, now: float) -> Tuple[float, bool]:
        """Free way, and whether each sensor that looks there has told it; 0 where one is silent."""
        rooms_m: List[float] = []
        sights = self._sights[direction]
        certain = bool(sights)
        for sight in sights.values():
            if now - sight.heard_s > STALE_S:
                return 0.0, False
            certain = certain and sight.known_s == sight.heard_s
            if now - sight.known_s <= STALE_S:
                rooms_m.append(sight.room_m - direction * (self._way_m - sight.way_m))
        return min(rooms_m, default=math.inf), certain

    def _hear(self, direction: int, name: str, room_m: float, now: float) -> None:
        with self._lock:
            if math.isnan(room_m):
                before = self._sights[direction].get(name, _UNHEARD)
                self._sights[direction][name] = before._replace(heard_s=now)
            else:
                # the reading may be as old as the reaction, and where the robot was then is not known exactly
                then = min if direction == AHEAD else max
                way_m = then((way for _, way in self._ways), default=self._way_m)
                self._sights[direction][name] = _Sight(now, now, room_m, way_m)

    def _room_before(self, mount: SonarMount, yaw: float, range_m: float, direction: int) -> float:
        """Free way where something is at that range, anywhere in the sonar's cone."""
        if math.isinf(range_m):
            return math.inf if range_m > 0 else 0.0
        first, last = yaw - FIELD_OF_VIEW_RAD / 2, yaw + FIELD_OF_VIEW_RAD / 2
        ways = [
            direction * (mount.x_m + range_m * math.cos(angle)) - self._front_m
            for angle in (first, last, *self._crossings(mount, range_m))
            if first <= angle <= last and abs(mount.y_m + range_m * math.sin(angle)) <= self._half_m + 1e-9
        ]
        if not ways and abs(mount.y_m + range_m * math.sin(yaw)) <= self._half_m:
            ways = [direction * (mount.x_m + range_m * math.cos(yaw)) - self._front_m]
        return min(ways, default=math.inf)

    def _crossings(self, mount: SonarMount, range_m: float) -> List[float]:
        """Angles at which an arc around a sonar meets the edges of the way."""
        sines = [(edge - mount.y_m) / range_m for edge in (self._half_m, -self._half_m) if range_m > 0]
        flat = [math.asin(sine) for sine in sines if abs(sine) <= 1]
        return flat + [math.remainder(math.pi - angle, 2 * math.pi) for angle in flat]


def looks(yaw_rad: float) -> Tuple[int, ...]:
    """Directions of motion that a sonar of that yaw looks in; none where its cone reaches across the side."""
    along, least = math.cos(yaw_rad), math.sin(FIELD_OF_VIEW_RAD / 2)
    return (AHEAD,) if along > least else (BEHIND,) if along < -least else ()
