"""Chooses among sources of velocity commands by priority, with locks.  Pure: times are arguments, no ROS.

The rules are those of twist_mux, whose configuration works here too, and four more.  The robot gets a stop if the
source that drives it falls silent or is locked.  A command that is not finite is a stop.  What never stops or never
drives with twist_mux is refused: a source without a timeout, priority 0, two sources with one priority.  After a stop
of the robot, a source that was sending must pause before it may take over: the robot cannot see what is held back here.
"""

import math
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.yaml_file import is_number
from ros1_bridge.control.velocity_sources import Source, VelocitySources
from ros1_bridge.node.robot_parameters import PAUSE_S

HIGHEST = 255
LONGEST_S, LONGEST_PAUSE_S = 60.0, 5.0
_KEYS = ("name", "topic", "timeout", "priority")
_PAUSE = "cmd_vel_pause"
_NAMES = ("topics", "locks", _PAUSE)


class Input(NamedTuple):
    """A source of commands, or a lock.

    Attributes:
        timeout_s: A source that is silent for this long no longer drives; a lock that is silent for this long is
            locked, and 0 means that it keeps its last state.
        priority: Of sources, the highest drives.  A lock holds the sources with a lower priority than its own.
    """

    name: str
    topic: str
    timeout_s: float
    priority: int


class VelocityMux:
    """Which source drives; names and priorities differ, and a lock with a timeout is locked until its first message."""

    def __init__(
        self, sources: Sequence[Input], locks: Sequence[Input] = (), pause_s: float = PAUSE_S
    ) -> None:
        """`pause_s`: see `distrust`."""
        self._trust = VelocitySources(pause_s)
        self.unpaused: Set[str] = set()
        """Sources whose last command was refused, because they must pause."""
        self._sources = {source.name: source for source in sources}
        self._locks = {lock.name: lock for lock in locks}
        self._commanded_s: Dict[str, float] = {}
        self._locked: Dict[str, Tuple[bool, float]] = {}
        self._driver = ""  # whose command passed last
        self._moves = ""  # the same if it moves the robot, perhaps with a zero between two moves

    def command(self, name: str, numbers: Sequence[float], now_s: float) -> Optional[Sequence[float]]:
        """What to publish after a source's command: its numbers, zeros if one is not finite.

        None if another drives, or if this one must pause.
        """
        finite = all(map(math.isfinite, numbers))
        moves = finite and any(numbers)
        if moves and self._must_pause(name, now_s):
            self.unpaused.add(name)
            return None
        self.unpaused.discard(name)
        self._commanded_s[name] = now_s
        if self.active(now_s) != name:
            return None
        self._driver, self._moves = name, name if moves or name == self._moves else ""
        return numbers if finite else (0.0,) * len(numbers)

    def _must_pause(self, name: str, now_s: float) -> bool:
        refused = self._trust.may_move(Source("", name), now_s) is not StopReason.NONE
        return refused and name != self._moves

    def distrust(self) -> None:
        """Let the sources that send already take over only after they were silent or zero for `pause_s`.

        For stops of the robot, and their releases.  The robot itself judges the source that drives now.
        """
        self._trust.distrust()

    def lock(self, name: str, locked: bool, now_s: float) -> None:
        """Take note of a lock's state."""
        self._locked[name] = locked, now_s

    def stops(self, now_s: float) -> bool:
        """Whether the robot must be stopped now: the source that drove it has fallen silent, or is locked.

        It is true once, until a command passes again.
        """
        if not self._driver or self._may_drive(self._sources[self._driver], now_s):
            return False
        self._driver = self._moves = ""
        return True

    def active(self, now_s: float) -> str:
        """Name of the source that may drive; empty if there is none."""
        able = [source for source in self._sources.values() if self._may_drive(source, now_s)]
        return max(able, key=lambda source: source.priority).name if able else ""

    def _may_drive(self, source: Input, now_s: float) -> bool:
        silent_s = now_s - self._commanded_s.get(source.name, -math.inf)
        return silent_s <= source.timeout_s and not any(
            source.priority < lock.priority and self._is_locked(lock, now_s) for lock in self._locks.values()
        )

    def _is_locked(self, lock: Input, now_s: float) -> bool:
        locked, told_s = self._locked.get(lock.name, (False, -math.inf))
        return locked or (lock.timeout_s > 0 and now_s - told_s > lock.timeout_s)


def read_inputs(given: Dict[str, Any], namespace: str) -> Tuple[List[Input], List[Input], float]:
    """Sources and locks, `topics` and `locks` in twist_mux's format, and the pause after a stop [s].

    ConfigError if one is wrong, or there twice.
    """
    unknown = [name for name in given if name not in _NAMES]
    if unknown:
        raise ConfigError(f"parameter {namespace}/{unknown[0]} is unknown, expected {', '.join(_NAMES)}")
    sources = _inputs(f"{namespace}/topics", given.get("topics"), "topics")
    locks = _inputs(f"{namespace}/locks", given.get("locks", []), "locks")
    if not sources:
        raise ConfigError(
            f"parameter {namespace}/topics is {given.get('topics')!r}, expected at least one source"
        )
    _require_different(f"{namespace}/topics", sources, ("name", "topic", "priority"))
    _require_different(f"{namespace}/locks", locks, ("name", "topic"))
    pause_s = given.get(_PAUSE, PAUSE_S)
    if not is_number(pause_s, 0, LONGEST_PAUSE_S):
        raise ConfigError(
            f"parameter {namespace}/{_PAUSE} is {pause_s!r}, expected a number from 0 to {LONGEST_PAUSE_S:g} s"
        )
    return sources, locks, float(pause_s)


def _inputs(key: str, rows: Any, kind: str) -> List[Input]:
    if not isinstance(rows, list):
        raise ConfigError(f"parameter {key} is {rows!r}, expected a list of {{{', '.join(_KEYS)}}}")
    return [_input(f"{key}[{index}]", row, kind) for index, row in enumerate(rows)]


def _input(key: str, row: Any, kind: str) -> Input:
    if not isinstance(row, dict) or set(row) != set(_KEYS):
        raise ConfigError(f"parameter {key} is {row!r}, expected the keys {', '.join(_KEYS)}")
    drives, priority, timeout_s = kind == "topics", row["priority"], row["timeout"]
    least = 1 if drives else 0
    whole = isinstance(priority, int) and is_number(priority, least, HIGHEST)
    ends = is_number(timeout_s, 0, LONGEST_S) and (timeout_s or not drives)
    checks = {
        "name": (isinstance(row["name"], str) and row["name"], "a name"),
        "topic": (isinstance(row["topic"], str) and row["topic"], "a name"),
        "priority": (whole, f"a whole number from {least} to {HIGHEST}"),
        "timeout": (ends, f"a number from {'more than 0' if drives else '0'} to {LONGEST_S:g} s"),
    }
    for name, (fits, expected) in checks.items():
        if not fits:
            raise ConfigError(f"parameter {key}/{name} is {row[name]!r}, expected {expected}")
    return Input(row["name"], row["topic"], float(timeout_s), priority)


def _require_different(key: str, inputs: Sequence[Input], fields: Sequence[str]) -> None:
    for field in fields:
        values = [getattr(each, field) for each in inputs]
        for value in values:
            if values.count(value) > 1:
                raise ConfigError(f"parameter {key} has the {field} {value!r} twice, expected each once")
