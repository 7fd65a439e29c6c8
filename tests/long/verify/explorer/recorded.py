"""Writes a sequence of events as a recording."""

from typing import Optional

from .board import ExploredBoard
from .events import EVENTS, happen
from .judge import Judge
from .world import World

AFTER_S = 0.5  # A recording goes on for this long after the last event [s]


def record(path: str, file: Optional[str], board: Optional[ExploredBoard] = None) -> str:
    """Let the events happen once more; return the property that is violated, or nothing.

    The recording has all bytes of both directions, as that of a driver on a port.
    """
    world, judge = World(board or ExploredBoard()), Judge()
    world.begin(file)
    judge.settle(world)
    broken = ""
    for letter in path:
        world.driver._connection.remark(f"event {EVENTS[letter].name}".encode())
        broken = broken or happen(world, judge, letter)
    if broken:
        world.driver._connection.remark(f"violated {broken}".encode())
    world.run(AFTER_S)
    world.ports.end_recording()
    world.end()
    return broken
