"""Which sources of velocity commands may move the robot.  Pure: times are arguments.

A program that did not notice a stop goes on sending, and must not move the robot when the stop is over, nor when this
node has started again.  So after a stop that stays, and at the start, a source may move the robot only once it has been
silent, or has sent zero, for a while.

Commands that a network held back arrive at once when it is there again, and nobody may want them any more.  Those of
operators have an age of their own.
"""

import math
from typing import Dict, Iterable, NamedTuple, Tuple

from mrl_driver.lock_order import new_lock
from mrl_driver.protocol.stop_reason import StopReason
from ros1_bridge.node.robot_parameters import PAUSE_S

SILENCE_S, BEGINNING_S, BURST_S, APART = 0.2, 0.5, 0.001, 3
"""In the time `BEGINNING_S` after a silence, a command that comes within `BURST_S` of the end of the one before it was
held back [s], as are those after it, until this many have come apart.
"""


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
        self._rhythms: Dict[str, _Rhythm] = {}  # of nodes whose commands have no age

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
        """Take note of a command to move; `NONE` if the robot may follow it, or why it may not.

        `done` must follow, unless it is of an operator.
        """
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
            held_back = not source.operator and self._held_back(source.node, now_s)
            if stops != self._stops:
                return StopReason.COMMANDS_UNPAUSED
            return StopReason.COMMAND_TOO_LATE if held_back else StopReason.NONE

    def _held_back(self, node: str, now_s: float) -> bool:
        if node not in self._rhythms:
            heard = {each: one for each, one in self._rhythms.items() if now_s - one.ended_s < SILENCE_S}
            self._rhythms = {**heard, node: _Rhythm()}
        return self._rhythms[node].held_back(now_s)

    def done(self, source: Source, now_s: float) -> None:
        """Take note that a command was carried out, or refused: how long that took says nothing about the network."""
        with self._lock:
            if source.node in self._rhythms:
                self._rhythms[source.node].ended_s = now_s


class _Rhythm:
    """When the commands of one node come."""

    def __init__(self) -> None:
        self.ended_s = -math.inf
        self._began_s = -math.inf
        self._apart = 0  # how many commands must come apart before one is followed

    def held_back(self, now_s: float) -> bool:
        """Take note of a command; whether it is one of several that a network held back."""
        gap_s = now_s - self.ended_s
        if gap_s >= SILENCE_S:
            self._began_s, self._apart = now_s, 0
        elif gap_s < BURST_S and (self._apart or now_s - self._began_s < BEGINNING_S):
            self._apart = APART
        elif self._apart:
            self._apart -= 1
        return self._apart > 0
