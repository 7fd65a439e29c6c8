"""One line of a recording."""

from typing import NamedTuple

TO_BOARD, FROM_BOARD, REMARK = ">", "<", "!"
LONGEST_LINE = 1 << 20


class Entry(NamedTuple):
    """One line: time [s since the start], direction (`>`, `<` or `!`), and the bytes."""

    time_s: float
    direction: str
    data: bytes
