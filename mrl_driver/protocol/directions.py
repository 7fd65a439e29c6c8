"""The frames that the table allows in each direction, prepared for the decoder."""

from binascii import crc_hqx
from itertools import repeat
from json import JSONDecoder
from struct import Struct, pack
from struct import error as StructError
from typing import Any, Dict, Iterable, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from .frames import Frame, Stamp
from .table import COMMANDS, INT16_MAX, INT16_MIN, STAMP, WRAP, Command, Field

Narrow = Tuple[Tuple[int, int, int], ...]
"""Index, lowest and highest value of each argument whose range is smaller than int16."""

_new = tuple.__new__
_array = JSONDecoder().raw_decode
"""A third faster than `split` and `int`.  From digits, '-' and ',' it reads only canonical integers and `-0`."""


class Shape(NamedTuple):
    """The rules of the table for one frame: the number of arguments and the range of each."""

    code: int
    least: int
    most: int
    ranges: Tuple[Tuple[int, int], ...]
    guarded: bool
    turns: bool
    stamped: bool


class Run:
    """Decodes a run of frames of one row, as a stream sends them, each on its own line and with at least one argument.

    Library code in C processes each byte.  Either every byte of a run is right, or nothing of it is used and the
    decoder reads each frame by itself.

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


def _shape(row: Command, fields: Sequence[Field], optional: int, request: bool) -> Shape:
    ranges = tuple((f.low, f.high) for f in fields)
    guarded, turns, stamped = row.guarded and request, row.turns and request, row.stamped and not request
    return Shape(row.code, len(fields) - optional, len(fields), ranges, guarded, turns, stamped)


def _narrow(shape: Shape) -> Narrow:
    limits = enumerate(shape.ranges)
    return tuple((i, low, high) for i, (low, high) in limits if (low, high) != (INT16_MIN, INT16_MAX))


def _form(shape: Shape, checked: bool, lead: bytes) -> Tuple[Any, ...]:
    """The wire form of a frame with all its arguments, for the fast path of the decoder.

    It has the code, the format for the numbers after it (with a checksum also stamp and checksum), the position of the
    '@', a function that raises unless the count of numbers is right and all are int16, the narrow arguments, and
    whether it has a stamp.
    """
    count = shape.most + (len(STAMP) * shape.stamped + 1 if checked else 0)
    spelling = b"%s@%d" % (lead, shape.code) + b",%d" * count
    pack = Struct(f"{count}h").pack
    return shape.code, spelling, len(lead), pack, _narrow(shape), checked and shape.stamped


class Direction:
    """The shapes of all frames in one direction; with `lines` each frame has its own line.

    With `wrapped`, requests to boards of 2013 are frames too, see `WRAP`; `codes` gives the usual code of theirs.
    `forms[checked]` gives the form of a frame by the bytes before its first argument.  The forms are plain tuples,
    because these unpack three times as fast.  `runs[checked]` gives the `Run` for frames on consecutive lines.
    """

    def __init__(self, shapes: Sequence[Shape], lines: bool = False, wrapped: bool = False) -> None:
        self.shapes = {shape.code: shape for shape in shapes}
        self.lines = lines
        self.codes = {b"%d" % (shape.code + WRAP): b"%d" % shape.code for shape in shapes if wrapped}
        self.forms: Dict[bool, Dict[bytes, Tuple[Any, ...]]] = {
            checked: {
                b"%s@%d" % (lead, shape.code): _form(shape, checked, lead)
                for shape in shapes
                for lead in (b"", b"\r\n", b"\n")
                if checked or not shape.guarded
            }
            for checked in (False, True)
        }
        self.runs: Dict[bool, Dict[bytes, Run]] = {
            checked: {
                b"@%d" % shape.code: Run(
                    shape.code, shape.most, _narrow(shape), checked, checked and shape.stamped
                )
                for shape in shapes
                if lines
            }
            for checked in (False, True)
        }


_REQUESTS = [_shape(row, row.request, row.optional, True) for row in COMMANDS if row.name != "xbee_text"]
REQUESTS = Direction(_REQUESTS)  # host to a board with our firmware
REQUESTS_TO_ANY = Direction(_REQUESTS, wrapped=True)
"""Host to any board, as recordings have it: those of 2013 get other codes, see `WRAP`."""
# Board to host.  Boards also print free text, which may repeat requests.  So a frame after text on the same line counts
# only if it has a checksum and cannot be a request.  A line with unprintable bytes is noise.
REPLIES = Direction(
    [_shape(row, row.reply, row.optional_reply, False) for row in COMMANDS if row.reply], lines=True
)
