"""Records that a simulated board reports."""

from typing import NamedTuple


class SentByte(NamedTuple):
    """A byte that left the board: start of its start bit and end of its stop bit [cycle]."""

    data: int
    start_cycle: int
    end_cycle: int


class PinChange(NamedTuple):
    """A watched pin (Arduino number) took a new level at a cycle."""

    pin: int
    level: int
    cycle: int


class Transfer(NamedTuple):
    """An I2C transfer: `kind` is "write", "read" or "nack" (no device at the address).

    `cycle` is the end of a write (STOP or repeated START), or the acknowledge of a read's address.
    """

    kind: str
    address: int
    data: bytes
    cycle: int
