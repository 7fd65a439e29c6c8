"""Bytes to frames and back, without I/O: no port, clock, thread or logger.

`FrameDecoder.feed` takes any bytes and returns frames and garbage, each garbage with its reason.  It never raises
on input and never blocks.  Its C++ twin is `firmware/mrl_firmware/frame_decoder.cpp`.

Grammar: `'@' command { ',' argument } 'e'`; integers are canonical decimals of int16 (`-1` is one, `+5`, `007`, `-0`
and the empty string are not).  A '@' inside a frame restarts it.
"""

from binascii import crc_hqx
from struct import Struct
from struct import error as StructError
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union

from .errors import FrameError
from .table import (
    BY_CODE,
    COMMANDS,
    INT16_MAX,
    INT16_MIN,
    MAX_ARGUMENTS,
    MAX_FRAME,
    MAX_NOISE,
    STAMP,
    STOP_CODE,
    Command,
    Field,
)

_AT, _END, _CR, _LF = b"@e\r\n"
_QUIET = (b"", b"\r\n")
"""What a feed may end with and say nothing by it, between frames."""
_PRINTABLE = range(0x20, 0x7F)


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


def _parse(token: bytes) -> int:
    """The canonical int16 in `token`; ValueError if it is none."""
    value = int(token) if len(token) <= 6 else INT16_MAX + 1
    if token != b"%d" % value or not INT16_MIN <= value <= INT16_MAX:
        raise ValueError(token)
    return value


class _Shape(NamedTuple):
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
    narrow: Tuple[Tuple[int, int, int], ...]
    """Index and range of the arguments that may not be every int16."""
    stamped: bool


def _shape(row: Command, fields: Sequence[Field], optional: int, guarded: bool, stamped: bool) -> _Shape:
    ranges = [(f.low, f.high) for f in fields]
    return _Shape(row.code, len(fields) - optional, len(fields), tuple(ranges), guarded, stamped)


def _form(shape: _Shape, checked: bool, lead: bytes) -> _Form:
    count = shape.most + (len(STAMP) * shape.stamped + 1 if checked else 0)
    narrow = [(i, *limits) for i, limits in enumerate(shape.ranges) if limits != (INT16_MIN, INT16_MAX)]
    spelling = b"%s@%d" % (lead, shape.code) + b",%d" * count
    pack = Struct(f"{count}h").pack
    return _Form(shape.code, spelling, len(lead), pack, tuple(narrow), checked and shape.stamped)


class Direction:
    """The shapes of all frames that travel one way; `lines` if each stands on a line of its own.

    `forms` finds a form by whether frames are checked, and by all that stands before the first argument.  They are
    plain tuples, for those unpack three times as fast.
    """

    def __init__(self, shapes: Sequence[_Shape], lines: bool) -> None:
        self.shapes = {shape.code: shape for shape in shapes}
        self.lines = lines
        self.forms: Dict[bool, Dict[bytes, Tuple[Any, ...]]] = {
            checked: {
                b"%s@%d" % (lead, shape.code): tuple(_form(shape, checked, lead))
                for shape in shapes
                for lead in (b"", b"\r\n")
                if checked or not shape.guarded
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


def check_value(body: bytes) -> int:
    """CRC-16 of `body` as signed int16: polynomial 0x1021, initial 0xFFFF, unreflected (CRC-16/IBM-3740)."""
    crc = crc_hqx(body, 0xFFFF)
    return crc - 65536 if crc > 32767 else crc


class FrameDecoder:
    """Turns bytes into frames and garbage.

    With a `direction` (`REPLIES` or `REQUESTS`) a frame must also match its row of the table.  While `checked`, each
    frame must end in its check value, and stamped replies carry sequence and board time.
    """

    def __init__(self, direction: Optional[Direction] = None, checked: bool = False) -> None:
        self.checked = checked
        self._shapes = direction.shapes if direction else {}
        self._forms = direction.forms if direction else {False: {}, True: {}}
        self._tabled = direction is not None
        self._lines = bool(direction and direction.lines)
        self._frame = bytearray()
        self._noise = bytearray()
        self._text = self._strange = False

    def feed(self, data: bytes) -> List[Event]:
        """Frames and garbage completed by `data`, in the order of the wire."""
        events: List[Event] = []
        *pieces, rest = data.split(b"e")
        waiting, tidy = iter(pieces), _tidy(data)
        odd: Optional[bytes] = b""
        while odd is not None:
            between = not (self._frame or self._noise or self._text)
            odd = self._quick(waiting, tidy, events) if between else next(waiting, None)
            if odd is not None or rest not in _QUIET or self._frame or self._noise or self._text:
                self._scan(rest if odd is None else odd + b"e", events)
        return events

    def _quick(self, waiting: Iterator[bytes], tidy: bool, events: List[Event]) -> Optional[bytes]:
        """Takes plainly good frames that start a line; returns the first piece that is none, for `_scan`."""
        checked = self.checked
        forms, append = self._forms[checked], events.append
        for piece in waiting:
            tokens = piece.split(b",")
            try:
                code, spelling, begin, pack, narrow, stamped = forms[tokens.pop(0)]
                values = tuple(map(int, tokens))
                pack(*values)
            except (KeyError, ValueError, StructError):
                return piece
            if not tidy and spelling % values != piece:
                return piece
            for i, low, high in narrow:
                if not low <= values[i] <= high:
                    return piece
            if checked:
                if values[-1] & 0xFFFF != crc_hqx(piece[begin : -1 - len(tokens[-1])], 0xFFFF):
                    return piece
                stamp = _new(Stamp, values[-3:-1]) if stamped else None
                append(_new(Frame, (code, values[:-3] if stamped else values[:-1], stamp)))
            else:
                append(_new(Frame, (code, values, None)))
        return None

    def _scan(self, data: bytes, events: List[Event]) -> None:
        """The whole grammar, byte by byte."""
        for byte in data:
            if byte == _AT and (self.checked or not self._text):
                self._start(events)
            elif self._frame:
                self._frame.append(byte)
                if byte == _END:
                    self._end(events)
                elif len(self._frame) >= MAX_FRAME:
                    events.append(Garbage(bytes(self._frame), "too_long"))
                    self._frame.clear()
            else:
                self._skip(byte, events)

    def _start(self, events: List[Event]) -> None:
        self._drop_noise(events)
        if self._frame:
            events.append(Garbage(bytes(self._frame), "restarted"))
        self._frame[:] = b"@"

    def _end(self, events: List[Event]) -> None:
        data = bytes(self._frame)
        self._frame.clear()
        event = self._judge(data)
        if self._text and (type(event) is not Frame or _may_be_echo(event)):
            event = Garbage(data, "text")
        events.append(event)

    def _skip(self, byte: int, events: List[Event]) -> None:
        """One byte outside a frame: line ends are silent, anything else is noise or text."""
        if byte in (_CR, _LF):
            self._drop_noise(events)
            self._text = self._strange = False
            return
        self._strange = self._strange or byte not in _PRINTABLE
        self._text = self._lines and not self._strange
        self._noise.append(byte)
        if len(self._noise) >= MAX_NOISE:
            self._drop_noise(events)

    def _drop_noise(self, events: List[Event]) -> None:
        if self._noise:
            events.append(Garbage(bytes(self._noise), "text" if self._text else "noise"))
            self._noise.clear()

    def _judge(self, data: bytes) -> Event:
        """Frame or garbage: `data` runs from '@' to 'e' and has neither inside."""
        values: List[int] = []
        for token in data[1:-1].split(b","):
            try:
                values.append(_parse(token))
            except ValueError:
                return Garbage(data, _refuse(token))
        if len(values) > MAX_ARGUMENTS + 1:
            return Garbage(data, "argument_count")
        code, args = values[0], values[1:]
        shape = self._shapes.get(code)
        if self._must_check(code, args, shape) and not (
            args and check_value(data[: data.rindex(b",")]) == args.pop()
        ):
            return Garbage(data, "bad_check")
        if not self._tabled:
            return Frame(code, tuple(args))
        if shape is None:
            return Garbage(data, "unknown_command")
        return self._fit(data, code, args, shape)

    def _must_check(self, code: int, args: Sequence[int], shape: Optional[_Shape]) -> bool:
        if self._tabled and not self._lines and code == STOP_CODE and not args:
            return False
        return self.checked or bool(shape and shape.guarded)

    def _fit(self, data: bytes, code: int, args: List[int], shape: _Shape) -> Event:
        stamp = None
        if self.checked and shape.stamped and len(args) >= len(STAMP):
            stamp = Stamp(*args[-2:])
            args = args[:-2]
        elif self.checked and shape.stamped:
            return Garbage(data, "argument_count")
        if not shape.least <= len(args) <= shape.most:
            return Garbage(data, "argument_count")
        if not all(low <= value <= high for (low, high), value in zip(shape.ranges, args)):
            return Garbage(data, "argument_range")
        return Frame(code, tuple(args), stamp)


def _may_be_echo(frame: Frame) -> bool:
    """A request looks just like it."""
    shape = REQUESTS.shapes.get(frame.code)
    return shape is not None and shape.least <= len(frame.args) <= shape.most


def _tidy(data: bytes) -> bool:
    """Whatever `int` reads in `data` is spelt as it should be: there are no signs, spaces and zeros that it would
    forgive, and line ends stand only behind an 'e'.
    """
    rare = data.translate(None, b"0123456789,-@e")
    return len(rare) == 2 * data.count(b"e\r\n") and b",0" not in data and b"-0" not in data


def _refuse(token: bytes) -> str:
    """Why a token is no int16: digits that go beyond it, or no canonical integer at all."""
    digits = token[1:] if token[:1] == b"-" else token
    canonical = digits.isdigit() and (digits[:1] != b"0")
    return "beyond_int16" if canonical else "not_integer"


def encode_request(code: int, *args: int, checked: bool = False) -> bytes:
    """The bytes of a request, host to board.

    Raises:
        FrameError: the table has no such request, or forbids its arguments.
    """
    row = _row(code)
    _demand(row, row.request, row.optional, args)
    return _frame(code, args, checked or row.guarded)


def encode_reply(code: int, *args: int, stamp: Optional[Stamp] = None, checked: bool = False) -> bytes:
    """The bytes of a reply or stream frame, board to host, with its line end.

    `stamp` is put into stamped rows while `checked`, and nowhere else.

    Raises:
        FrameError: the table has no such reply, or forbids its arguments.
    """
    row = _row(code)
    _demand(row, row.reply, row.optional_reply, args)
    if checked and row.stamped:
        if stamp is None:
            raise FrameError(f"reply {code} ({row.name}) is stamped, got no stamp")
        args = args + stamp
    return _frame(code, args, checked) + b"\r\n"


def describe(garbage: Garbage) -> str:
    """One line for people: the reason, and what the table expected where that is known."""
    return f"{garbage.reason.replace('_', ' ')}: {garbage.data!r}"


def _row(code: int) -> Command:
    try:
        return BY_CODE[code]
    except KeyError:
        raise FrameError(f"command {code} is not in the table, expected 1 to {max(BY_CODE)}") from None


def _demand(row: Command, fields: Sequence[Field], optional: int, args: Sequence[int]) -> None:
    if not len(fields) - optional <= len(args) <= len(fields):
        raise FrameError(
            f"command {row.code} ({row.name}) takes {len(fields)} arguments, got {len(args)}: {args}"
        )
    for field, value in zip(fields, args):
        if not field.low <= value <= field.high:
            raise FrameError(
                f"{row.name}: {field.name} is {value}, expected {field.low} to {field.high} {field.unit}"
            )


def _frame(code: int, args: Sequence[int], checked: bool) -> bytes:
    body = (b"@%d" + b",%d" * len(args)) % (code, *args)
    return b"%s,%de" % (body, check_value(body)) if checked else body + b"e"


_new = tuple.__new__
