"""Which sources of velocity commands may move the robot.  Pure: times are arguments.

A program that did not notice a stop goes on sending, and must not move the robot when the stop is over, nor when this
node has started again.  So after a stop that stays, and at the start, a source may move the robot only once it has been
silent, or has sent zero, for a while.

Commands that a network held back arrive at once when it is there again, and nobody may want them any more.
"""

import math
from typing import Dict, Iterable, NamedTuple, Tuple

from mrl_driver.lock_order import new_lock
from mrl_driver.protocol.stop_reason import StopReason
from ros1_bridge.node.robot_parameters import PAUSE_S

BURST_S, BURST_LASTS_S = 0.01, 0.1
"""After a silence, commands closer together than this were held back, for at most this time [s]."""


class Source(NamedTuple):
    """Where a command comes from."""

    node: str  # name of the node that sends it
    operator: str = ""
    """Name of the operator, whose commands may come by a node that passes them on; empty if there is none."""


class VelocitySources:
    """The sources of one robot's commands; any thread may call it."""

    def __init__(self, pause_s: float = PAUSE_S) -> None:
        self.pause_s = pause_s  # a source must pause for this long [s]; 0 lets every source move the robot
        self._lock = new_lock("sources")
        self._stops = 0
        self._early: Dict[str, float] = {}
        """Nodes that were there before this one, and since when they are connected; infinite before."""
        self._moves: Dict[Source, Tuple[int, float, float]] = {}
        """For each source, how many stops there were before it began to move the robot, and its first and its last such
        command.
        """

    def distrust(self) -> None:
        """From now on, a source that sends already must pause first."""
        with self._lock:
            self._stops += 1

    def expect(self, nodes: Iterable[str]) -> None:
        """These nodes were there before this one, and may be sending already: they pause after they have connected."""
        with self._lock:
            self._early = dict.fromkeys(nodes, math.inf)

    def connected(self, nodes: Iterable[str], now_s: float) -> bool:
        """Take note of the nodes that are connected; whether all are that were expected."""
        with self._lock:
            for node in self._early.keys() & set(nodes):
                self._early[node] = min(self._early[node], now_s)
            return math.inf not in self._early.values()

    def may_move(self, source: Source, now_s: float) -> StopReason:
        """Take note of a command to move; `NONE` if the robot may follow it, or why it may not."""
        with self._lock:
            silent_since_s = min(self._early.get(source.node, -math.inf), now_s)
            stops, began_s, last_s = self._moves.get(source, (-1, -math.inf, silent_since_s))
            pauses = now_s - last_s >= self.pause_s
            if pauses:
                stops, began_s = self._stops, now_s
                # sources that have paused may begin like new ones
                self._moves = {
                    each: move for each, move in self._moves.items() if now_s - move[-1] < self.pause_s
                }
            self._moves[source] = stops, began_s, now_s
            if stops != self._stops:
                return StopReason.COMMANDS_UNPAUSED
            held_back = not pauses and now_s - last_s < BURST_S and now_s - began_s < BURST_LASTS_S
            return StopReason.COMMAND_TOO_LATE if held_back else StopReason.NONE
