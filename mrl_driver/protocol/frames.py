"""What travels: frames, the garbage between them, and the check value that tells one from the other."""

from binascii import crc_hqx
from typing import NamedTuple, Optional, Tuple, Union


class Stamp(NamedTuple):
    """Sequence number and board time [64 us] of a frame, both int16 that wrap."""

    sequence: int
    time: int


class Frame(NamedTuple):
    """One accepted frame: its code and its arguments, check value and stamp taken off."""

    code: int
    args: Tuple[int, ...]
    stamp: Optional[Stamp] = None


class Garbage(NamedTuple):
    """Bytes that are no frame, and the name of the reason (a row of `table.REASONS`, or `text`)."""

    data: bytes
    reason: str


Event = Union[Frame, Garbage]


def check_value(body: bytes) -> int:
    """CRC-16 of `body` as signed int16: polynomial 0x1021, initial 0xFFFF, unreflected (CRC-16/IBM-3740)."""
    crc = crc_hqx(body, 0xFFFF)
    return crc - 65536 if crc > 32767 else crc
