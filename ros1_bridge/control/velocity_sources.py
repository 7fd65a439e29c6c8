"""Which sources of velocity commands may move the robot.  Pure: times are arguments.

A program that did not notice a stop goes on sending, and must not move the robot when the stop is over, nor when this
node has started again.  So after a stop that stays, and at the start, a source may move the robot only once it has been
silent, or has sent zero, for a while.
"""

import math
from typing import Dict, Iterable, NamedTuple, Tuple

from mrl_driver.lock_order import new_lock
from ros1_bridge.node.robot_parameters import PAUSE_S


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
        self._moves: Dict[Source, Tuple[int, float]] = {}
        """For each source, how many stops there were before it began to move the robot, and its last such command."""

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

    def may_move(self, source: Source, now_s: float) -> bool:
        """Take note of a command to move; whether the robot may follow it."""
        with self._lock:
            silent_since_s = min(self._early.get(source.node, -math.inf), now_s)
            stops, last_s = self._moves.get(source, (-1, silent_since_s))
            if now_s - last_s >= self.pause_s:
                stops = self._stops
                # sources that have paused may begin like new ones
                self._moves = {
                    each: move for each, move in self._moves.items() if now_s - move[1] < self.pause_s
                }
            self._moves[source] = stops, now_s
            return stops == self._stops
