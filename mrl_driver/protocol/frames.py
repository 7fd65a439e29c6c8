"""Frames, the garbage between them, and the checksum that tells them apart."""

from binascii import crc_hqx
from typing import NamedTuple, Optional, Tuple, Union


class Stamp(NamedTuple):
    """Sequence number and board time [64 us] of a frame; both are int16 and wrap."""

    sequence: int
    time: int


class Frame(NamedTuple):
    """One accepted frame: its code, its arguments without checksum and stamp, and its stamp."""

    code: int
    args: Tuple[int, ...]
    stamp: Optional[Stamp] = None


class Garbage(NamedTuple):
    """Bytes that are not a frame, and the name of the reason (a row of `table.REASONS`, or `text`)."""

    data: bytes
    reason: str


Event = Union[Frame, Garbage]


def to_int16(value: int) -> int:
    """Return the lower 16 bits of `value` as a signed number."""
    return ((value + 0x8000) & 0xFFFF) - 0x8000


def check_value(body: bytes) -> int:
    """Checksum of `body`: CRC-16/IBM-3740 (polynomial 0x1021, initial 0xFFFF, unreflected) as signed int16."""
    crc = crc_hqx(body, 0xFFFF)
    return crc - 65536 if crc > 32767 else crc
