"""Records that a simulated board reports, and the Uno's pin numbers."""

from typing import NamedTuple, Tuple

PORTS = PORT_B, PORT_C, PORT_D = 0, 1, 2
PLACES = [(port, bit) for port, bits in ((PORT_D, 8), (PORT_B, 6), (PORT_C, 6)) for bit in range(bits)]
"""Port and bit of each pin by its Arduino number: D0 to D13, A0 to A5 as 14 to 19."""
PIN_AT = {place: pin for pin, place in enumerate(PLACES)}


class SentByte(NamedTuple):
    """A byte that left the board: start of its start bit and end of its stop bit [cycle]."""

    data: int
    start_cycle: int
    end_cycle: int


class PinChange(NamedTuple):
    """A watched pin (Arduino number, A0 = 14) took a new level at a cycle."""

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


def place_of(pin: int) -> Tuple[int, int]:
    """Port and bit of an Arduino pin; raises ValueError if the Uno has no such pin."""
    if not 0 <= pin < len(PLACES):
        raise ValueError(f"pin {pin} is not one of the Uno's 0..{len(PLACES) - 1}")
    return PLACES[pin]
