"""Integers as the firmware's C++ has them."""

INT16_MAX = 32767
UINT16_MAX = 65535


def uint16(value: int) -> int:
    """The value in 16 bits, unsigned."""
    return value & UINT16_MAX


def divide(value: int, by: int) -> int:
    """The quotient, rounded towards zero; `by` is positive."""
    return value // by if value >= 0 else -(-value // by)


def sign(value: int) -> int:
    """-1, 0 or 1."""
    return (value > 0) - (value < 0)


def limit(value: int, least: int, most: int) -> int:
    """The value, or the limit that it exceeds."""
    return least if value < least else most if value > most else value
