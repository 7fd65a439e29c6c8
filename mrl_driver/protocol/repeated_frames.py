"""Fast decoding of a run: equal frames in a row, as a stream sends them.  C code of the library processes each byte.

Either every byte of a run is right, or nothing of it is used and the decoder reads each frame by itself.
"""

from binascii import crc_hqx
from itertools import repeat
from json import JSONDecoder
from struct import error as StructError
from struct import pack
from typing import Iterable, Iterator, List, Optional, Tuple

from .frames import Frame, Stamp
from .table import STAMP

Narrow = Tuple[Tuple[int, int, int], ...]
"""Index, lowest and highest value of each argument whose range is smaller than int16."""

_new = tuple.__new__
_array = JSONDecoder().raw_decode
"""A third faster than `split` and `int`.  From digits, '-' and ',' it reads only canonical integers and `-0`."""


class Run:
    """Decodes frames of one row, each on its own line, with at least one argument.

    After the arguments come the stamp if `stamped`, and the checksum if `checked`.
    """

    def __init__(self, code: int, arguments: int, narrow: Narrow, checked: bool, stamped: bool) -> None:
        self._code, self._narrow, self._checked, self._stamped = code, narrow, checked, stamped
        self._width = arguments + len(STAMP) * stamped + checked
        self._head = b"@%d," % code
        self._between = b"e\r\n" + self._head
        self._skeleton = b"@%be\r\n" % (b"," * self._width)
        self._seed = crc_hqx(self._head, 0xFFFF)

    def frames(self, data: bytes) -> Optional[Iterable[Frame]]:
        """Return the frames in `data`, which runs from the first '@' to the last 'e'; None unless all are valid."""
        skeleton = data.translate(None, b"0123456789-") + b"\r\n"
        count = len(skeleton) // len(self._skeleton)
        if skeleton != self._skeleton * count or not data.startswith(self._head) or b"-0" in data:
            return None
        inside = data[len(self._head) : -1]
        try:
            values = self._numbers(inside, count)
        except (ValueError, StructError):
            return None
        columns = [values[i :: self._width] for i in range(self._width)]
        if any(min(columns[i]) < low or max(columns[i]) > high for i, low, high in self._narrow):
            return None
        if self._checked and not self._intact(inside, columns.pop()):
            return None
        return self._join(columns)

    def _numbers(self, inside: bytes, count: int) -> List[int]:
        """Return all numbers; raise ValueError or StructError if one is not a canonical int16.

        Two frames may only be separated by `_between`; otherwise an '@' is left, which is not a number.
        """
        values, _ = _array(f"[{inside.replace(self._between, b',').decode()}]")
        pack(f"{count * self._width}h", *values)
        return values

    def _intact(self, inside: bytes, checks: List[int]) -> bool:
        bodies = [frame.rpartition(b",")[0] for frame in inside.split(self._between)]
        found = map(crc_hqx, bodies, repeat(self._seed))
        return pack(f"{len(checks)}H", *found) == pack(f"{len(checks)}h", *checks)

    def _join(self, columns: List[List[int]]) -> Iterator[Frame]:
        stamps: Iterable[Optional[Stamp]] = repeat(None)
        if self._stamped:
            stamps = map(_new, repeat(Stamp), zip(*columns[-2:]))
            columns = columns[:-2]
        return map(_new, repeat(Frame), zip(repeat(self._code), zip(*columns), stamps))
