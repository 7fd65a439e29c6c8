"""Which waypoint a robot drives to next: laps, waits, failures, pauses, claims.  Times are arguments; no I/O."""

import math
from typing import Container, List, NamedTuple, Optional

from .claims import NAMESAKE, SILENT_S, Claim

IDLE, DRIVING, WAITING, PAUSED, DONE = "idle", "driving", "waiting", "paused", "done"
CLAIMING = "claiming"


class Idleness:
    """Idleness of `count` waypoints of a robot or a team: the time since the last visit of each (Machado et al. 2002).

    At the start it is 0.
    """

    def __init__(self, count: int, now_s: float) -> None:
        self._start_s = now_s
        self._last_s: List[float] = [now_s] * count
        self._area_s2 = self._worst_s = 0.0
        self.visits = 0  # number of visits of all waypoints

    def visit(self, place: int, now_s: float) -> None:
        """A robot has reached the waypoint at this place, from 0."""
        away_s = now_s - self._last_s[place]
        self._last_s[place] = now_s
        self._area_s2 += 0.5 * away_s**2
        self._worst_s = max(self._worst_s, away_s)
        self.visits += 1

    def mean_s(self, now_s: float) -> float:
        """Idleness as the mean of all waypoints and of the time since the start [s]; 0 at the start."""
        area_s2 = self._area_s2 + sum(0.5 * (now_s - last_s) ** 2 for last_s in self._last_s)
        return area_s2 / ((now_s - self._start_s) * len(self._last_s)) if area_s2 else 0.0

    def worst_s(self, now_s: float) -> float:
        """Longest time that a waypoint was not visited [s]."""
        return max([self._worst_s, *(now_s - last_s for last_s in self._last_s)])


class Target(NamedTuple):
    """A waypoint to drive to."""

    attempt: int  # a number that no other attempt has; reports about earlier attempts do not count
    place: int  # the waypoint's place in the list, from 0


class WaypointTour:
    """A list of waypoints, and how far the robot has come.

    It stands at each waypoint for `wait_s`, and begins again after the last one if it has to `repeat`.  If a waypoint
    cannot be reached, it pauses there, or with `skip_failed` continues with the next one.  It drives to the `shared`
    waypoints (places in the list, from 0) while it holds the `claim` of their place, and releases it when it reached
    a waypoint that is not shared.

    Attributes:
        state: `idle` without waypoints, `claiming` until it holds the claim, `driving`, `waiting` at a waypoint,
            `paused`, or `done`.
        reason: Why the tour is paused, or what went wrong last; empty if nothing did.
        lap: Number of the lap, from 1; 0 while there are no waypoints.
    """

    def __init__(
        self,
        repeat: bool = False,
        skip_failed: bool = False,
        wait_s: float = 0.0,
        claim: Optional[Claim] = None,
        shared: Container[int] = (),
    ) -> None:
        self._repeat, self._skip_failed, self._wait_s = repeat, skip_failed, wait_s
        self._claim, self._shared = claim, shared
        self.idleness = Idleness(0, 0.0)
        self.state, self.reason = IDLE, ""
        self.count = self.lap = 0
        self._index = self._attempt = self._failed = 0
        self._due_s = math.inf

    @property
    def target(self) -> Optional[Target]:
        """Where the robot drives now; None if it stands."""
        return Target(self._attempt, self._index) if self.state == DRIVING else None

    @property
    def number(self) -> int:
        """Number of the waypoint to which the robot drives, or at which it waits or is paused; from 1, 0 if none."""
        return self._index + 1 if self.count else 0

    def begin(self, count: int, now_s: float) -> None:
        """Drive to the first of `count` waypoints; an earlier list is given up."""
        self._withdraw()
        self.idleness = Idleness(count, now_s)
        self.count, self._failed = count, 0
        self._index, self.lap = 0, 1
        self._drive("")

    def end(self) -> None:
        """Give the list up.  The robot keeps a claim that it holds, because it may be at the shared waypoint."""
        self._withdraw()
        self.state, self.reason = IDLE, ""
        self.count = self._index = self.lap = 0

    def reached(self, attempt: int, now_s: float) -> None:
        """The robot has arrived."""
        if self._is_current(attempt):
            self._failed = 0
            self.idleness.visit(self._index, now_s)
            if self._claim and self._index not in self._shared:
                self._claim.release()
            self.state, self.reason, self._due_s = WAITING, "", now_s + self._wait_s
            self.tick(now_s)

    def failed(self, attempt: int, why: str) -> None:
        """The waypoint cannot be reached: skip it or pause.  A whole lap of failures pauses in any case."""
        if self._is_current(attempt):
            self._fail(why)

    def _fail(self, why: str) -> None:
        self._failed += 1
        if self._skip_failed and self._failed < self.count:
            self._next(why)
        else:
            self.state, self.reason = PAUSED, why
            self._failed = 0

    def interrupt(self, attempt: int, why: str) -> None:
        """The robot does something else: pause."""
        if self._is_current(attempt):
            self.state, self.reason = PAUSED, why

    def pause(self, why: str = "paused") -> bool:
        """Stand still, here; False if there is nothing to pause."""
        if self.state not in (CLAIMING, DRIVING, WAITING):
            return False
        self._withdraw()
        self.state, self.reason = PAUSED, why
        return True

    def resume(self) -> bool:
        """Drive on to the same waypoint; False if the tour is not paused."""
        if self.state != PAUSED:
            return False
        self._drive("")
        return True

    def skip(self) -> bool:
        """Drive to the next waypoint, also from a pause; False if there is no waypoint to skip."""
        if self.state not in (CLAIMING, DRIVING, WAITING, PAUSED):
            return False
        self._withdraw()
        self._next("")
        return True

    def tick(self, now_s: float) -> None:
        """Drive on if the wait at a waypoint is over, or the claim is held; pause while another robot has the name."""
        if self._claim is not None and self._claim.has_namesake:
            self.pause(NAMESAKE.format(self._claim.name))
        if self.state == WAITING and now_s >= self._due_s:
            self._next("")
        if self.state == CLAIMING:
            self._wait_for_claim(now_s)

    def _wait_for_claim(self, now_s: float) -> None:
        """Drive if the claim is held.  If it cannot be, because a robot is silent, the waypoint has failed."""
        assert self._claim is not None
        silent = self._claim.silent(now_s)
        self.reason = f"no message from {', '.join(silent)} for {SILENT_S:g} s" if silent else ""
        if self._claim.held:
            self.state, self.reason = DRIVING, ""
        elif silent and self._skip_failed:
            self._withdraw()
            self._fail(self.reason)

    def _withdraw(self) -> None:
        """Release a claim for which the robot has waited; it has not driven to the shared waypoint yet."""
        if self.state == CLAIMING and self._claim is not None:
            self._claim.release()

    def _is_current(self, attempt: int) -> bool:
        return self.state == DRIVING and attempt == self._attempt

    def _next(self, reason: str) -> None:
        if self._index + 1 < self.count:
            self._index += 1
        elif self._repeat:
            self._index, self.lap = 0, self.lap + 1
        else:
            self.state, self.reason = DONE, reason
            return
        self._drive(reason)

    def _drive(self, reason: str) -> None:
        self.state, self.reason = DRIVING, reason
        self._attempt += 1
        if self._claim is not None and self._index in self._shared:
            self._claim.want()
            self.state = DRIVING if self._claim.held else CLAIMING
