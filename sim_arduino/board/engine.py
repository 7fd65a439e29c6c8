"""What a board on the emulator's port can do, whatever runs it."""

from typing import Protocol


class Engine(Protocol):
    """A board.  Times are seconds since its start and never run backwards."""

    @property
    def next_event_s(self) -> float:
        """When `advance` should be called next if no bytes come [s]; may be infinite."""

    def receive(self, data: bytes) -> None:
        """Bytes from the host; the first of them is on the wire from the last `advance` on."""

    def advance(self, to_s: float) -> bytes:
        """Runs the board to a time; returns the bytes that left its serial port until then."""

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The board did not run from the last `advance` to `to_s`; `waiting` is what the host sent meanwhile."""

    def reset(self) -> None:
        """The reset button, or DTR when a host opens the port."""

    def close(self) -> None:
        """Frees what the engine holds."""
