"""What the table allows to travel each way, made ready for the decoder."""

from struct import Struct
from typing import Any, Callable, Dict, NamedTuple, Sequence, Tuple

from .repeated_frames import Narrow, Run
from .table import COMMANDS, INT16_MAX, INT16_MIN, STAMP, Command, Field


class Shape(NamedTuple):
    """What the table asks of one frame: how many arguments, and each one's range; the stamp's two come last."""

    code: int
    least: int
    most: int
    ranges: Tuple[Tuple[int, int], ...]
    guarded: bool
    stamped: bool


class _Form(NamedTuple):
    """How a frame with all its arguments reads on the wire, for those that plainly match."""

    code: int
    spelling: bytes
    """Takes the numbers behind the code: arguments, and with a check value also the stamp and that value."""
    begin: int
    """Where the '@' stands."""
    pack: Callable[..., bytes]
    """Raises unless there are as many numbers as there should be, and all are int16."""
    narrow: Narrow
    """Index and range of the arguments that may not be every int16."""
    stamped: bool


def _shape(row: Command, fields: Sequence[Field], optional: int, guarded: bool, stamped: bool) -> Shape:
    ranges = [(f.low, f.high) for f in fields]
    return Shape(row.code, len(fields) - optional, len(fields), tuple(ranges), guarded, stamped)


def _narrow(shape: Shape) -> Narrow:
    limits = enumerate(shape.ranges)
    return tuple((i, low, high) for i, (low, high) in limits if (low, high) != (INT16_MIN, INT16_MAX))


def _form(shape: Shape, checked: bool, lead: bytes) -> _Form:
    count = shape.most + (len(STAMP) * shape.stamped + 1 if checked else 0)
    spelling = b"%s@%d" % (lead, shape.code) + b",%d" * count
    pack = Struct(f"{count}h").pack
    return _Form(shape.code, spelling, len(lead), pack, _narrow(shape), checked and shape.stamped)


class Direction:
    """The shapes of all frames that travel one way; `lines` if each stands on a line of its own.

    `forms` finds a form by whether frames are checked, and by all that stands before the first argument.  They are
    plain tuples, for those unpack three times as fast.  `runs` does so for frames on lines that follow each other.
    """

    def __init__(self, shapes: Sequence[Shape], lines: bool) -> None:
        self.shapes = {shape.code: shape for shape in shapes}
        self.lines = lines
        self.forms: Dict[bool, Dict[bytes, Tuple[Any, ...]]] = {
            checked: {
                b"%s@%d" % (lead, shape.code): tuple(_form(shape, checked, lead))
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


REQUESTS = Direction(
    [
        _shape(row, row.request, row.optional, row.guarded, False)
        for row in COMMANDS
        if row.name != "xbee_text"
    ],
    lines=False,
)
"""Host to board."""
REPLIES = Direction(
    [_shape(row, row.reply, row.optional_reply, False, row.stamped) for row in COMMANDS if row.reply],
    lines=True,
)
"""Board to host.  Boards also print free text, in which they repeat requests: a frame behind text on the same line
counts only with a check value, and if it cannot be a request.  A line with bytes that nobody prints is noise.
"""
