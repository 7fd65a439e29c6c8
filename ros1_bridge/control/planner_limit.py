"""Lowers the highest speed of a planner while a zone is entered, and gives its own speed back.  No ROS.

The zones slow a command that is too fast.  A planner that does not know it expects more speed than it gets, takes the
robot for stuck, and chooses among paths that the slowed robot does not drive.
"""

import math
from typing import Any, Callable, Dict, Mapping, Optional, Tuple

from mrl_driver.errors import ConfigError

STEP_M_S = 0.05  # speeds that set here are multiples of this, so that they seldom change
RAISE_S = 1.0  # a speed is raised when it has been allowed for this long; it is lowered at once
FASTEST, SLOWEST = "max_vel_x", "min_vel_x"  # parameters of the local planners of move_base

Configure = Callable[[Dict[str, float]], Mapping[str, Any]]
"""Sets parameters of the planner, and returns all that it has then."""
Store = Callable[[Optional[Tuple[float, float]]], None]
"""Keeps the speed set and the planner's own, for a node that starts after this one was killed; None for nothing."""


class PlannerLimit:
    """The highest speed of one planner; one thread calls it some times a second.

    Whatever `configure` and `store` raise is raised, and ConfigError if the planner has no such parameter.
    """

    def __init__(self, configure: Configure, store: Store, stored: Any = None) -> None:
        """`stored`: what a node before this one has stored."""
        self._configure, self._store = configure, store
        self._set, self._own = _pair(stored)
        self._slowest = STEP_M_S
        self._allowed_since_s = self._looked_s = -math.inf

    def step(self, allowed_m_s: float, now: float) -> str:
        """Set the planner's speed, if that is needed; infinity lets it have its own.

        Returns a line for the log when a limit begins or ends, otherwise an empty text.
        """
        if not self._due(allowed_m_s, now):
            return ""
        self._looked_s = now
        self._look()
        assert self._own is not None
        speed = self._speed(allowed_m_s)
        if speed >= self._own:
            return self.give_back()
        begins = self._set is None
        self._store((speed, self._own))
        self._set, self._allowed_since_s = float(self._configure({FASTEST: speed})[FASTEST]), now
        return f"a zone is entered: the planner drives at {speed:g} m/s at most" if begins else ""

    def give_back(self) -> str:
        """Let the planner have its own speed; returns a line for the log, empty if it has it."""
        if self._set is None:
            return ""
        self._look()
        if self._set is None:
            return ""
        assert self._own is not None
        self._configure({FASTEST: self._own})
        self._set = None
        self._store(None)
        return f"the planner has its own highest speed again, {self._own:g} m/s"

    def _due(self, allowed_m_s: float, now: float) -> bool:
        """Whether the planner has to be asked; remembers since when a higher speed has been allowed."""
        if self._set is None:
            known = self._own is not None and allowed_m_s >= self._own and now - self._looked_s < RAISE_S
            return allowed_m_s < math.inf and not known
        speed = self._speed(allowed_m_s)
        if speed <= self._set:
            self._allowed_since_s = now
            return speed < self._set
        return now - self._allowed_since_s >= RAISE_S

    def _look(self) -> None:
        """Ask for the planner's parameters; a speed that was not set here is the planner's own."""
        config = self._configure({})
        if FASTEST not in config:
            raise ConfigError(
                f"the planner has no parameter {FASTEST}, expected one of move_base's local planners"
            )
        fastest, self._slowest = float(config[FASTEST]), max(float(config.get(SLOWEST, 0.0)), STEP_M_S)
        if self._set is not None and not math.isclose(fastest, self._set):
            self._set = None  # another program has set it, or the planner is a new one
            self._store(None)
        if self._set is None:
            self._own = fastest

    def _speed(self, allowed_m_s: float) -> float:
        assert self._own is not None
        if allowed_m_s >= self._own:
            return self._own
        steps = math.floor(allowed_m_s / STEP_M_S + 1e-9)
        return min(max(round(steps * STEP_M_S, 6), self._slowest), self._own)


def _pair(stored: Any) -> Tuple[Optional[float], Optional[float]]:
    if isinstance(stored, (list, tuple)) and len(stored) == 2 and all(isinstance(v, float) for v in stored):
        return stored[0], stored[1]
    return None, None
