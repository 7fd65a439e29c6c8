"""Judges how late the commands of operators arrive at the robot.  No ROS."""

import threading
from typing import Callable, Dict

from mrl_driver.safety.operator_delay import Lateness, delay_text

MOST_OPERATORS = 16
"""The operator silent for longest is forgotten beyond this number; each start of a teleop node is another operator."""


class Operators:
    """The operators that have sent something; any thread may ask.

    Args:
        most_s: a command is refused if it arrives later than the fastest of its operator by more than this [s]; 0 for
            no limit.
        clock: our clock [s], which must not jump.

    Attributes:
        refused: number of late commands.
    """

    def __init__(self, most_s: float, clock: Callable[[], float]) -> None:
        self._most_s, self._clock = most_s, clock
        self._lock = threading.Lock()
        self._lateness: Dict[str, Lateness] = {}
        self.refused = 0

    def late_s(self, name: str, stamp_s: float) -> float:
        """How much later than the operator's fastest message this one arrives [s]; `stamp_s` is on his clock."""
        with self._lock:
            lateness = self._lateness.pop(name, None) or Lateness()
            self._lateness[name] = lateness  # the last one: it is silent for the shortest time
            if len(self._lateness) > MOST_OPERATORS:
                del self._lateness[next(iter(self._lateness))]
            return lateness.of(stamp_s, self._clock())

    def refusal(self, name: str, stamp_s: float) -> str:
        """Why a command must not be followed; empty if it may."""
        late_s = self.late_s(name, stamp_s)
        if not self._most_s or late_s <= self._most_s:
            return ""
        with self._lock:
            self.refused += 1
        return (
            f"a command arrived {delay_text(late_s)} late, expected at most {delay_text(self._most_s)} "
            f"(~max_command_delay): not followed, {self.refused} so far; look for what slows the network, "
            "and restart the teleop node if a machine was paused"
        )
