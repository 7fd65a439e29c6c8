"""The frames that the table allows in each direction, prepared for the decoder."""

from struct import Struct
from typing import Any, Dict, NamedTuple, Sequence, Tuple

from .repeated_frames import Narrow, Run
from .table import COMMANDS, INT16_MAX, INT16_MIN, STAMP, WRAP, Command, Field


class Shape(NamedTuple):
    """The rules of the table for one frame: the number of arguments and the range of each."""

    code: int
    least: int
    most: int
    ranges: Tuple[Tuple[int, int], ...]
    guarded: bool
    turns: bool
    stamped: bool


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
