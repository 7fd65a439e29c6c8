"""Judges how late the commands of operators arrive at the robot.  No ROS."""

import math
from typing import Callable, Dict, Tuple

from mrl_driver.lock_order import new_lock
from mrl_driver.safety.operator_delay import Lateness, delay_text
from mrl_driver.yaml_file import short

MOST_OPERATORS = 16
"""As many operators have a place at a time; each start of a teleop node is another operator."""
SILENT_S = 60.0  # An operator that is silent for this time may lose its place to a new one [s]


class Operators:
    """The operators that have sent something; any thread may ask.

    Args:
        most_s: a command is refused if it arrives later than the fastest of its operator by more than this [s]; 0 for
            no limit.
        clock: our clock [s], which must not jump.

    Attributes:
        refused: number of refused commands.
    """

    def __init__(self, most_s: float, clock: Callable[[], float]) -> None:
        self._most_s, self._clock = most_s, clock
        self._lock = new_lock("operators")
        # with the last arrival of each; the one that is silent for longest comes first
        self._known: Dict[str, Tuple[Lateness, float]] = {}
        self.refused = 0

    def late_s(self, name: str, stamp_s: float) -> float:
        """How much later than the operator's fastest message this one arrives [s]; `stamp_s` is on his clock.

        Infinite for a new operator while all places are taken.
        """
        with self._lock:
            now_s = self._clock()
            if name not in self._known and len(self._known) >= MOST_OPERATORS:
                first, (_, heard_s) = next(iter(self._known.items()))
                if now_s - heard_s < SILENT_S:
                    return math.inf
                del self._known[first]
            lateness, _ = self._known.pop(name, (Lateness(), now_s))
            self._known[name] = lateness, now_s
            return lateness.of(stamp_s, now_s)

    def refusal(self, name: str, stamp_s: float) -> str:
        """Why a command must not be followed; empty if it may."""
        late_s = self.late_s(name, stamp_s) if stamp_s else math.nan
        if not self._most_s or late_s <= self._most_s:
            return ""
        with self._lock:
            self.refused += 1
        if not stamp_s:
            return f"a command of {short(name)} has the stamp 0, expected the time of the input: not followed"
        if math.isinf(late_s):
            return (
                f"a command of {short(name)} is not followed: {MOST_OPERATORS} other operators have sent something in "
                f"the last {SILENT_S:g} s, expected fewer; end those teleop nodes, or wait"
            )
        return (
            f"a command arrived {delay_text(late_s)} late, expected at most {delay_text(self._most_s)} "
            f"(~max_command_delay): not followed, {self.refused} so far; look for what slows the network, "
            "and restart the teleop node if a machine was paused"
        )
