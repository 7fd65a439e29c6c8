"""A line in simulated time whose bytes pass through functions of a test."""

import math
from typing import Any, Callable, List, Tuple

Filter = Callable[[bytes], bytes]


class Nobody:
    """A board that hears nothing and says nothing."""

    next_event_s = math.inf

    def receive(self, data: bytes) -> None:
        """Ignores the bytes."""

    def advance(self, to_s: float) -> bytes:
        """Nothing, ever."""
        return b""


class ScriptedLine:
    """An engine behind a line: the same interface, with `to_board` and `to_host` applied to what passes.

    Args:
        engine: The board at the other end; nobody where there is none.
        to_board: What reaches the board of what the host sends.
        to_host: What reaches the host of what the board sends; called at each step, with nothing too.
        start_s: The board starts so much later than the line [s].
        step_s: The longest step of time [s].

    Attributes:
        now_s: The time of the last step [s].
        sent: What the host has sent, each piece with its time [s].
    """

    def __init__(
        self,
        engine: Any = None,
        to_board: Filter = lambda data: data,
        to_host: Filter = lambda data: data,
        start_s: float = 0.0,
        step_s: float = math.inf,
    ) -> None:
        self.engine = engine or Nobody()
        self.to_board, self.to_host = to_board, to_host
        self.now_s, self.start_s, self.step_s = 0.0, start_s, step_s
        self.sent: List[Tuple[float, bytes]] = []

    @property
    def next_event_s(self) -> float:
        """As the engine's, and at least every `step_s`; the start of a board that starts later."""
        if self.now_s < self.start_s:
            return self.start_s
        return min(self.start_s + self.engine.next_event_s, self.now_s + self.step_s)

    def receive(self, data: bytes) -> None:
        """Bytes from the host."""
        self.sent.append((self.now_s, data))
        if self.now_s >= self.start_s:
            self.engine.receive(self.to_board(data))

    def advance(self, to_s: float) -> bytes:
        """Bytes for the host."""
        self.now_s = to_s
        return self.to_host(self.engine.advance(to_s - self.start_s) if to_s >= self.start_s else b"")
