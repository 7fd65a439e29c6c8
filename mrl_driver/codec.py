"""Bytes to frames and back, without I/O: no port, clock, thread or logger.

`FrameDecoder.feed` takes any bytes and returns frames and garbage, each garbage with its reason.  It never raises
on input and never blocks.  Its C++ twin is `firmware/mrl_firmware/frame_decoder.cpp`.

Grammar: `'@' command { ',' argument } 'e'`; integers are canonical decimals of int16 (`-1` is one, `+5`, `007`, `-0`
and the empty string are not).  A '@' inside a frame restarts it.
"""

from binascii import crc_hqx
from operator import getitem
from typing import Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union

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


_MOST_TOKENS = 24576
"""Kept of one range: 3 MB.  All 65536 would take 7 MB after ten minutes of driving."""


class _Integers(Dict[bytes, int]):
    """Canonical tokens of one range, the first seen: looking one up is parsing, strictness and range check in one."""

    def __init__(self, low: int, high: int) -> None:
        self.low, self.high = low, high

    def __missing__(self, token: bytes) -> int:
        value = _parse(token)
        if not self.low <= value <= self.high:
            raise KeyError(token)
        if len(self) < _MOST_TOKENS:
            self[token] = value
        return value


_INT16 = _Integers(INT16_MIN, INT16_MAX)


def _parse(token: bytes) -> int:
    """The canonical int16 in `token`; KeyError if it is none."""
    try:
        value = int(token) if len(token) <= 6 else None
    except ValueError:
        value = None
    if value is None or token != b"%d" % value or not INT16_MIN <= value <= INT16_MAX:
        raise KeyError(token)
    return value


class _Shape(NamedTuple):
    """What the table asks of one frame: how many arguments, each one's range; the stamp's two are parsed last."""

    code: int
    least: int
    most: int
    parsers: Tuple[_Integers, ...]
    guarded: bool
    stamped: bool


def _shape(row: Command, fields: Sequence[Field], optional: int, guarded: bool, stamped: bool) -> _Shape:
    wide = [_INT16] * (len(STAMP) if stamped else 0)
    parsers = [
        _INT16 if (f.low, f.high) == (INT16_MIN, INT16_MAX) else _Integers(f.low, f.high) for f in fields
    ]
    return _Shape(row.code, len(fields) - optional, len(fields), tuple(parsers + wide), guarded, stamped)


class Direction:
    """The shapes of all frames that travel one way; `lines` if each stands on a line of its own.

    `heads` finds a shape by all that stands before the first argument.
    """

    def __init__(self, shapes: Sequence[_Shape], lines: bool) -> None:
        self.shapes = {shape.code: shape for shape in shapes}
        self.heads = {head % shape.code: shape for shape in shapes for head in (b"@%d", b"\r\n@%d")}
        self.lines = lines


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
"""Board to host.  Boards also print free text, so a '@' behind text on the same line starts no frame."""


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
        self._heads = direction.heads if direction else {}
        self._tabled = direction is not None
        self._lines = bool(direction and direction.lines)
        self._frame = bytearray()
        self._noise = bytearray()
        self._text = False

    def feed(self, data: bytes) -> List[Event]:
        """Frames and garbage completed by `data`, in the order of the wire."""
        events: List[Event] = []
        *pieces, rest = data.split(b"e")
        waiting = iter(pieces)
        quick = self._quick_checked if self.checked else self._quick
        odd: Optional[bytes] = b""
        while odd is not None:
            between = not (self._frame or self._noise or self._text)
            odd = quick(waiting, events) if between else next(waiting, None)
            if odd is not None or rest not in _QUIET or self._frame or self._noise or self._text:
                self._scan(rest if odd is None else odd + b"e", events)
        return events

    def _quick(self, waiting: Iterator[bytes], events: List[Event]) -> Optional[bytes]:
        """Takes plainly good frames that start a line; returns the first piece that is none, for `_scan`."""
        heads = self._heads
        for piece in waiting:
            tokens = piece.split(b",")
            shape = heads.get(tokens.pop(0))
            if shape is None or len(tokens) != shape.most or shape.guarded:
                return piece
            try:
                args = tuple(map(getitem, shape.parsers, tokens))
            except KeyError:
                return piece
            events.append(_new(Frame, (shape.code, args, None)))
        return None

    def _quick_checked(self, waiting: Iterator[bytes], events: List[Event]) -> Optional[bytes]:
        """As `_quick`, for frames that end in a check value."""
        heads = self._heads
        for piece in waiting:
            body, _, check = piece.rpartition(b",")
            tokens = body.split(b",")
            shape = heads.get(tokens.pop(0))
            if shape is None or len(tokens) != len(shape.parsers):
                return piece
            try:
                args = tuple(map(getitem, shape.parsers, tokens))
                crc = crc_hqx(body[2:] if body[:1] == b"\r" else body, 0xFFFF)
                if check != b"%d" % (crc - 65536 if crc > 32767 else crc):
                    return piece
            except KeyError:
                return piece
            stamp = None
            if shape.stamped:
                args, stamp = args[:-2], _new(Stamp, args[-2:])
            events.append(_new(Frame, (shape.code, args, stamp)))
        return None

    def _scan(self, data: bytes, events: List[Event]) -> None:
        """The whole grammar, byte by byte."""
        for byte in data:
            if byte == _AT and not self._text:
                self._start(events)
            elif self._frame:
                self._frame.append(byte)
                if byte == _END:
                    events.append(self._judge(bytes(self._frame)))
                    self._frame.clear()
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

    def _skip(self, byte: int, events: List[Event]) -> None:
        """One byte outside a frame: line ends are silent, anything else is noise or text."""
        if byte in (_CR, _LF):
            self._drop_noise(events)
            self._text = False
            return
        self._text = self._text or (self._lines and byte in _PRINTABLE)
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
                values.append(_INT16[token])
            except KeyError:
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
        if not all(parser.low <= value <= parser.high for parser, value in zip(shape.parsers, args)):
            return Garbage(data, "argument_range")
        return Frame(code, tuple(args), stamp)


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
    body = b"@" + b",".join(b"%d" % value for value in (code, *args))
    return b"%s,%de" % (body, check_value(body)) if checked else body + b"e"


_new = tuple.__new__
