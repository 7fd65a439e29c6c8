"""Texts by which one robot holds another: what a holder sends to a board by radio, and what the board answers."""

from typing import NamedTuple, Optional

from .frames import to_int16
from .table import HOLD_MARK, HOLD_TEXTS

_LETTERS = {name: ord(letter) for name, letter, _ in HOLD_TEXTS}
_NAMES = {letter: name for name, letter in _LETTERS.items()}
SIZE = 4


class HoldText(NamedTuple):
    """One hold text."""

    kind: str  # "hold" or "free" to a board, "held" or "freed" from it; see `table.HOLD_TEXTS`
    number: int  # number of the hold, 0 to 65535; a later hold of the same holder has a larger one

    @property
    def data(self) -> bytes:
        """The four bytes of the text; KeyError if the kind is unknown."""
        return bytes((HOLD_MARK, _LETTERS[self.kind], self.number >> 8 & 0xFF, self.number & 0xFF))

    @classmethod
    def parse(cls, data: bytes) -> Optional["HoldText"]:
        """The hold text of these bytes, or None if they are another text."""
        if len(data) != SIZE or data[0] != HOLD_MARK or data[1] not in _NAMES:
            return None
        return cls(_NAMES[data[1]], data[2] << 8 | data[3])


def is_newer(number: int, than: int) -> bool:
    """Whether `number` belongs to a later hold of the same holder than the other number."""
    return to_int16(number - than) > 0
