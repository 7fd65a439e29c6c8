"""Warning and protective zones: limit the speed towards obstacles seen by sonars or a laser.  No I/O.

The zones start at the body's edge and extend in the direction of motion (forward, back or to any side).  They are as
wide as the body across that direction, plus a clearance on each side.  They grow with the speed v by the stopping
distance, v * reaction + v^2 / (2 * braking).  An obstacle in the outer warning zone is only reported, unless that zone
has its own speed.  An obstacle in the warning zone slows the robot until the zone no longer contains it, or down to
the slow speed.  An obstacle in the protective zone slows it further, so that it stops at the standing length of that
zone.  There the robot may turn and drive away, but not come closer, until the free distance has grown by the
hysteresis.  No speed is so low that the zones do not apply.

The zones only lower speeds.  The direction stays the same, and so does the yaw rate, because a planner must be able to
turn away.  Unknown readings are treated as follows:

- A direction that sonars see only at an angle: an echo counts as a wall across the path, and the slow speed applies.
- A sonar without a valid reading (NaN), or a direction that no sensor covers, such as backwards on a robot with three
  sonars in front: the slow speed applies.
- A sonar that sees nothing: an obstacle may be where its range ends.
- A sonar or a laser that is silent: the robot stops in its direction.
- A range of -inf (too near, REP 117): the robot stops as well; for a laser it counts as the shortest range.
- Rays of a scan that cross the path without a reading, in a gap (`Scan.gaps`): as a sonar without a valid reading.
- A scan whose geometry is not finite, or with no or too many rays (`Scan.trouble`): as if the laser were silent.
"""

import math
from collections import deque
from functools import partial
from typing import Deque, Dict, List, Mapping, NamedTuple, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.lock_order import new_lock
from mrl_driver.robot.models import Body, SonarMount, cycle_s

from .free_distance import (
    AHEAD,
    Point,
    Scan,
    Sight,
    covers,
    looks,
    outline_of,
    scan_gap,
    scan_room,
    slant_room,
    sonar_room,
)

STALE_S = 1.0  # a sensor without a message for this time is silent [s]: ten scans, or three rounds of MB1300
LEAST_M_S = 0.02  # if only this speed or less is allowed, the robot stops instead of creeping on
LASER = "laser"
SECTORS = 8  # the hysteresis of the zones is kept for this number of sectors around the robot


def stale_s(sonars: Mapping[str, SonarMount]) -> float:
    """Return the time without a message after which one of these sonars is silent [s]: three of their rounds."""
    return max(STALE_S, 3 * cycle_s(sonars))


class ZoneSettings(NamedTuple):
    """Lengths of the zones at standstill, and how they grow with speed."""

    warning_m: float = 0.5
    protective_m: float = 0.2
    slow_m_s: float = 0.1  # the warning zone does not slow the robot below this
    braking_m_s2: float = 0.2  # braking deceleration that the robot always reaches
    reaction_s: float = 0.5  # twice the sum of the delays of sensors and commands
    hysteresis_m: float = 0.05
    clearance_m: float = 0.05  # obstacles within this distance of the swept path count as in the way
    outer_m: float = 0.0  # length of the outer warning zone; 0 for twice `warning_m`
    outer_slow_m_s: float = 0.0
    """The outer warning zone slows the robot as the warning zone does, but not below this; 0: it only warns."""

    @property
    def outer_edge_m(self) -> float:
        """Length of the outer warning zone at standstill [m]."""
        return self.outer_m or 2 * self.warning_m

    def growth_m(self, speed_m_s: float) -> float:
        """Return the length that a speed adds to each zone: the stopping distance [m]."""
        return abs(speed_m_s) * self.reaction_s + speed_m_s**2 / (2 * self.braking_m_s2)

    def speed_m_s(self, room_m: float) -> float:
        """Return the largest speed with a stopping distance of at most `room_m`; 0 if there is no room [m/s]."""
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
    "outer_m": (0.0, 20.0),
    "outer_slow_m_s": (0.0, 10.0),
}


def require_settings(settings: ZoneSettings) -> None:
    """Raise ConfigError if a number of the settings is out of range or NaN, or the zones contradict each other."""
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
    if settings.outer_edge_m <= settings.warning_m:
        raise ConfigError(
            f"zones: outer_m is {settings.outer_m:g}, expected more than warning_m {settings.warning_m:g}, or 0"
        )
    if 0 < settings.outer_slow_m_s < settings.slow_m_s:
        raise ConfigError(
            f"zones: outer_slow_m_s is {settings.outer_slow_m_s:g}, expected at least slow_m_s "
            f"{settings.slow_m_s:g}, or 0"
        )


class Zones:
    """The zones of one robot; any thread may call its methods.  Times are seconds of one clock, which the caller reads.

    A turn of the robot since a reading is ignored: the next reading comes before it matters.
    """

    def __init__(
        self, settings: ZoneSettings, body: Body, sonars: Mapping[str, SonarMount], laser: bool = False
    ) -> None:
        """`sonars` are the sonars to use; with `laser` scans are expected, which must at least cover the path ahead.

        Raises:
            ConfigError: see `require_settings`.
        """
        require_settings(settings)
        self.settings = settings
        self._sonars, self._outline = sonars, outline_of(body, settings.clearance_m)
        self._lock = new_lock("zones")
        self._stale_s = stale_s(sonars)
        self._sights = {name: Sight() for name in (*sonars, *([LASER] if laser else []))}
        self._scan: Optional[Scan] = None
        self._hits: Dict[float, Tuple[Point, Point, float]] = {}
        """For rays of the last scan: the point, the place of the robot then, and the time."""
        self._place: Point = (0.0, 0.0)
        self._places: Deque[Tuple[float, Point]] = deque()
        self._held: Dict[int, bool] = {}
        self._warned: Dict[int, bool] = {}
        self._outer: Dict[int, bool] = {}
        self._sector = 0

    def areas(self, velocity: Point) -> List[List[Point]]:
        """Corners of the warning, the outer warning and the protective zone at a velocity in base_link [m/s]; [m].

        The zones of a robot that stands are those ahead.
        """
        speed_m_s = math.hypot(*velocity)
        direction = AHEAD if speed_m_s < LEAST_M_S else (velocity[0] / speed_m_s, velocity[1] / speed_m_s)
        lengths_m = self.settings.warning_m, self.settings.outer_edge_m, self.settings.protective_m
        growth_m = self.settings.growth_m(speed_m_s)
        return [self._outline.strip(direction, length_m + growth_m) for length_m in lengths_m]

    @property
    def warning_clear(self) -> bool:
        """The warning zone in the direction of the last request is free; False before the first request."""
        return not self._warned.get(self._sector, True)

    @property
    def outer_clear(self) -> bool:
        """The same for the outer warning zone."""
        return not self._outer.get(self._sector, True)

    @property
    def protective_clear(self) -> bool:
        """The robot may move in the direction of the last request; False before the first request."""
        return not self._held.get(self._sector, True)

    def moved(self, forward_m: float, now: float, left_m: float = 0.0) -> None:
        """Add the distance moved along the robot's x and y axes since the last call [m]."""
        with self._lock:
            self._place = self._place[0] + forward_m, self._place[1] + left_m
            self._places.append((now, self._place))
            while self._places[0][0] < now - self.settings.reaction_s:
                self._places.popleft()

    def on_range(self, name: str, range_m: float, now: float) -> None:
        """Process a sonar's reading (REP 117)."""
        mount = self._sonars.get(name)
        if mount is None:
            return
        with self._lock:
            if math.isnan(range_m):
                self._sights[name].hear(now)
            else:
                arguments = self._outline, mount, min(range_m, mount.kind.farthest_m)
                rooms = partial(sonar_room, *arguments), partial(slant_room, *arguments)
                self._sights[name].know(*rooms, self._recent(), now)

    def on_scan(self, scan: Scan, now: float) -> str:
        """Process a laser's scan; returns why it is ignored, or an empty string."""
        trouble = scan.trouble
        if trouble:
            return trouble
        points, gaps = scan.points(), scan.gaps()
        with self._lock:
            kept = self._kept(scan, gaps, now)
            self._scan, here = scan, self._place
            self._hits = {**{number: (point, here, now) for number, point in points.items()}, **kept}
            moved = ((hit, here[0] - place[0], here[1] - place[1]) for hit, place, _ in kept.values())
            seen = [*points.values(), *((x - ahead_m, y - left_m) for (x, y), ahead_m, left_m in moved)]
            room = partial(scan_room, self._outline, seen)
            gap = partial(scan_gap, self._outline, scan, gaps)
            self._sights.setdefault(LASER, Sight()).know(room, room, self._recent(), now, gap)
        return trouble

    def _kept(self, scan: Scan, gaps: List[int], now: float) -> Dict[float, Tuple[Point, Point, float]]:
        """Return what the rays in the gaps of a scan have hit before, unless that is stale."""
        before = self._scan
        if before is None:
            return {}
        found = ((number, self._hits.get(before.number_at(scan.angle_rad(number)))) for number in gaps)
        return {number: hit for number, hit in found if hit is not None and now - hit[2] <= self._stale_s}

    def limit(self, linear_m_s: float, now: float) -> float:
        """Return the allowed speed for a requested speed along x [m/s]."""
        return self.limited((linear_m_s, 0.0), now)[0]

    def limited(self, velocity_m_s: Point, now: float) -> Point:
        """Return the allowed velocity for a requested one, forward and to the left [m/s]; never faster.

        A velocity of 0, as in a turn on the spot, is always allowed; it updates the zones ahead.  A velocity that is
        not finite is returned unchanged, and the driver refuses it.
        """
        speed_m_s = math.hypot(*velocity_m_s)
        if not math.isfinite(speed_m_s):
            return velocity_m_s
        direction = (velocity_m_s[0] / speed_m_s, velocity_m_s[1] / speed_m_s) if speed_m_s > 0 else AHEAD
        with self._lock:
            self._sector = round(math.atan2(direction[1], direction[0]) / (2 * math.pi) * SECTORS) % SECTORS
            cap_m_s = self._cap(direction, self._sector, speed_m_s, now)
        return velocity_m_s if cap_m_s >= speed_m_s else (cap_m_s * direction[0], cap_m_s * direction[1])

    def allowed_ahead_m_s(self, now: float) -> float:
        """Return the largest speed that the zones allow forward; infinite if a laser sees nothing ahead [m/s].

        For planners, which can choose a path with a speed that is allowed.  It changes nothing.
        """
        with self._lock:
            room_m, certain = self._room(AHEAD, now)
            return 0.0 if self._held.get(0) else self._speed_m_s(room_m, certain)

    def _cap(self, direction: Point, sector: int, asked_m_s: float, now: float) -> float:
        settings = self.settings
        room_m, certain = self._room(direction, now)
        edge_m = settings.protective_m + settings.growth_m(LEAST_M_S)
        edge_m += settings.hysteresis_m if self._held.get(sector) else 0.0
        self._held[sector] = room_m < edge_m
        for entered, length_m in ((self._warned, settings.warning_m), (self._outer, settings.outer_edge_m)):
            far_m = length_m + settings.growth_m(asked_m_s)
            far_m += settings.hysteresis_m if entered.get(sector) else 0.0
            entered[sector] = room_m < far_m or not certain
        return 0.0 if self._held[sector] else self._speed_m_s(room_m, certain)

    def _speed_m_s(self, room_m: float, certain: bool) -> float:
        """Return the allowed speed for this free distance."""
        settings = self.settings
        cap = max(settings.slow_m_s, settings.speed_m_s(room_m - settings.warning_m) if certain else 0.0)
        if settings.outer_slow_m_s:
            cap = min(cap, max(settings.outer_slow_m_s, settings.speed_m_s(room_m - settings.outer_edge_m)))
        return min(cap, settings.speed_m_s(room_m - settings.protective_m))

    def _room(self, direction: Point, now: float) -> Tuple[float, bool]:
        """Return the free distance [m], and whether the direction is covered and all its sensors have valid readings.

        The distance is 0 if one of its sensors is silent.
        """
        views = {name: self._view(name, direction) for name in self._sights}
        watched, known = any(covered for _, covered in views.values()), True
        rooms_m: List[float] = []
        for name, sight in self._sights.items():
            if not views[name][0]:
                continue
            if now - sight.heard_s > self._stale_s:
                return 0.0, False
            known = known and sight.knows(direction)
            if now - sight.known_s <= self._stale_s:
                rooms_m.append(sight.room_m(direction, watched, self._place))
        return min(rooms_m, default=math.inf), watched and known

    def _view(self, name: str, direction: Point) -> Tuple[bool, bool]:
        """Return whether a sensor looks ahead for motion in this direction, and whether it covers the direction."""
        if name in self._sonars:
            mount = self._sonars[name]
            return looks(mount, direction), covers(mount, direction)
        seen = self._scan.looks(direction) if self._scan is not None else direction[0] > 0
        return seen, seen

    def _recent(self) -> Tuple[Point, ...]:
        """Return the places of the robot within the last `reaction_s`: a reading may be that old."""
        return tuple(place for _, place in self._places) or (self._place,)
