"""The interface of every board on the emulator's port."""

from typing import Protocol


class Engine(Protocol):
    """A board.  Times are seconds since its start; they never decrease."""

    @property
    def next_event_s(self) -> float:
        """Time of the next call of `advance` if no bytes come [s]; may be infinite."""

    def receive(self, data: bytes) -> None:
        """Bytes from the host; the first byte starts on the line at the time of the last `advance`."""

    def advance(self, to_s: float) -> bytes:
        """Runs the board to a time; returns the bytes that left its serial port until then."""

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The board did not run from the last `advance` to `to_s`; `waiting` holds the bytes sent meanwhile."""

    def reset(self) -> None:
        """The reset button, or DTR when a host opens the port."""

    def close(self) -> None:
        """Frees the engine's resources."""
        return
