"""Visits all sequences of events up to a depth; states that are alike are visited once."""

import math
import mmap
import time
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

from . import memento
from .board import ExploredBoard
from .events import happen
from .judge import Judge
from .world import World

AGE_S, OLDEST_S = 0.02, 1.0
"""Times are in the key as ages in steps of `AGE_S`; ages above `OLDEST_S` are alike, to come as well as gone [s]."""
IGNORED = {
    "what was measured or counted, and decides nothing": """
        Counters Stream BoardClock RoundTrip SensorPoll WheelMotion Odometry RadioQueue NewReadings
        BatteryMonitor Core.replies Session._last Session.last_frame Session.status Session._lost_before
        Session.board RobotState.telemetry RobotState.odometry RobotState.info RobotState.ranges
        RobotState.model RobotState.tracker RobotState._used_s RobotState._counted_s RobotState._primed
        RobotState._late RobotState._new_echoes RobotState._new_readings
        Motion.stops Core.mismatch Handshake._info Handshake._protocol Commander.late_commands Core._options
        Connection._slept_s SpeedLimiter._stepped_s
    """,
    "settings": """
        Motion.timeout_s Motion.lead_s Motion.pace Session.lead_s Session._greeting_s Session._plan
        Poll._lead_s Poll._period_s Handshake._plan Handshake.board Steps.answers
    """,
    "how long the wheel monitor has watched, and its sums": """
        WheelMonitor._time_s WheelMonitor._travel WheelMonitor.next_s WheelMonitor._targets _Wheel._speeds
        _Wheel._expected_m _Wheel._last _Wheel._moved_m _Wheel._reference _Wheel._still Core._monitored
        WheelMonitor._kinematics WheelMonitor._command
    """,
    "the clocks themselves, and what the judge compares in one step": """
        Line.board_s Line.slept_s Line.end_s Judge.x_m Judge.before_s Judge.told
    """,
}
"""Attributes and classes of the driver, and of the harness, that are not in the key, with the reason."""


def age(seconds: float) -> int:
    if seconds >= OLDEST_S:
        return 99
    if seconds > -OLDEST_S:
        return math.floor(seconds / AGE_S + 0.5)
    return -99


class Found(NamedTuple):
    """A sequence of events that violates a property."""

    property: str
    path: str


class Table:
    """The states that were visited, shared by processes: hash and least depth."""

    def __init__(self, bits: int) -> None:
        self._mask = (1 << bits) - 1
        self._memory = mmap.mmap(-1, 8 << bits)
        self._slots = memoryview(self._memory).cast("Q")

    def visit(self, key: int, depth: int) -> int:
        """Note a state; return 2 if it is new, 1 if it was only visited deeper, 0 otherwise."""
        mark = key & 0xFFFFFFFFFFFFFFF0 or 16
        place, slots, mask = (mark >> 4) & self._mask, self._slots, self._mask
        while True:
            slot = slots[place]
            if not slot:
                slots[place] = mark | depth
                return 2
            if slot & 0xFFFFFFFFFFFFFFF0 == mark:
                if slot & 15 <= depth:
                    return 0
                slots[place] = mark | depth
                return 1
            place = (place + 1) & mask

    @property
    def by_depth(self) -> Dict[int, int]:
        """Return the number of states by the least depth at which they were visited."""
        counts: Dict[int, int] = {}
        for slot in self._slots:
            if slot:
                counts[slot & 15] = counts.get(slot & 15, 0) + 1
        return counts


class Explorer:
    """One robot, and the states that it was in."""

    def __init__(
        self,
        board: Optional[ExploredBoard] = None,
        timeout_s: Optional[float] = 0.5,
        table: Optional[Table] = None,
    ) -> None:
        self.world = World(board or ExploredBoard(), timeout_s)
        self.judge = Judge()
        self.world.begin()
        self.judge.settle(self.world)
        world = self.world
        self._roots: Tuple[Any, ...] = (world.driver, world.commander, world.ports, world.line, self.judge)
        self._keys = memento.Keys(frozenset(" ".join(IGNORED.values()).split()), age)
        self.table = table or Table(20)
        self.start = self.save()
        self.transitions = self.states = 0
        self.found: List[Found] = []
        self.most = 20
        self.deadline_s = math.inf

    def save(self) -> Tuple[bytes, memento.Saved]:
        return self.world.board.save(), memento.save(self._roots)

    def restore(self, state: Tuple[bytes, memento.Saved]) -> None:
        self.world.board.restore(state[0])
        memento.restore(state[1])

    def key(self) -> int:
        """Return the hash of the state in the form in which two are alike."""
        world = self.world
        status = world.driver._core.session.status
        return hash(
            (
                world.board.key(),
                self._keys.key(world.driver, world.host_s),
                self._keys.key(world.commander, world.host_s),
                self._keys.key(world.line, world.board_s),
                self._keys.key(self.judge, world.board_s),
                status.stop_reason if status is not None else "",
            )
        )

    def play(self, path: str) -> str:
        """Let events happen from the start; return the property that is violated, or nothing."""
        self.restore(self.start)
        for letter in path:
            broken = happen(self.world, self.judge, letter)
            if broken:
                return broken
        return ""

    def explore(self, alphabet: str, depth: int, prefix: str = "") -> None:
        """Visit all sequences of this many events that begin with the prefix."""
        if self.play(prefix):
            return
        if prefix and not self.table.visit(self.key(), len(prefix)) and len(prefix) > 2:
            return
        self._deeper(alphabet, depth, prefix)

    def _deeper(self, alphabet: str, depth: int, path: str) -> None:
        here = self.save()
        for letter in alphabet:
            if time.monotonic() > self.deadline_s or len(self.found) >= self.most:
                return
            self.restore(here)
            self.transitions += 1
            broken = happen(self.world, self.judge, letter)
            if broken:
                self.found.append(Found(broken, path + letter))
                continue
            news = self.table.visit(self.key(), len(path) + 1)
            self.states += news == 2
            if news and len(path) + 1 < depth:
                self._deeper(alphabet, depth, path + letter)
