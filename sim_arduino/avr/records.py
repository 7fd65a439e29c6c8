"""Records that a simulated board reports, and the Uno's pin numbers."""

from typing import Dict, Iterable, NamedTuple

PORT_B, PORT_C, PORT_D = 0, 1, 2
PINS = 20  # D0..D13, A0..A5 as 14..19
FIRST_PIN = {PORT_D: 0, PORT_B: 8, PORT_C: 14}


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


def port_of(pin: int) -> int:
    """Port number of an Arduino pin.

    Raises:
        ValueError: the Uno has no such pin.
    """
    if not 0 <= pin < PINS:
        raise ValueError(f"pin {pin} is not one of the Uno's 0..{PINS - 1}")
    return PORT_D if pin < 8 else (PORT_B if pin < 14 else PORT_C)


def bit_of(pin: int) -> int:
    """Bit of an Arduino pin within its port."""
    return pin - FIRST_PIN[port_of(pin)]


def pin_of(port: int, bit: int) -> int:
    """Arduino number of a port's bit."""
    return bit + FIRST_PIN[port]


def pin_masks(pins: Iterable[int]) -> Dict[int, int]:
    """Bit masks of all three ports that select `pins`."""
    masks = {PORT_B: 0, PORT_C: 0, PORT_D: 0}
    for pin in pins:
        masks[port_of(pin)] |= 1 << bit_of(pin)
    return masks
