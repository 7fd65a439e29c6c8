"""Bytes to frames and back, without I/O: no port, clock, thread or logger.

`FrameDecoder.feed` takes any bytes and returns frames and garbage, each garbage with its reason.  It never raises
on input and never blocks.  Its C++ twin is `firmware/mrl_firmware/frame_decoder.cpp`.

Grammar: `'@' command { ',' argument } 'e'`; integers are canonical decimals of int16 (`-1` is one, `+5`, `007`, `-0`
and the empty string are not).  A '@' inside a frame restarts it.
"""
from binascii import crc_hqx
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

from .errors import FrameError
from .table import BY_CODE, COMMANDS, MAX_ARGUMENTS, MAX_FRAME, MAX_NOISE, STAMP, STOP_CODE, Command, Field

_AT, _END, _CR, _LF = b"@e\r\n"
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


class _Shape(NamedTuple):
    """What the table asks of one frame: argument count, and the ranges that are narrower than int16."""

    least: int
    most: int
    narrow: Tuple[Tuple[int, int, int], ...]
    guarded: bool
    stamped: bool


class Direction:
    """The shapes of all frames that travel one way; `lines` if each stands on a line of its own."""

    def __init__(self, shapes: Dict[int, _Shape], lines: bool) -> None:
        self.shapes = shapes
        self.lines = lines


def _shape(fields: Sequence[Field], optional: int, guarded: bool = False, stamped: bool = False) -> _Shape:
    narrow = tuple((i, f.low, f.high) for i, f in enumerate(fields) if (f.low, f.high) != (-32768, 32767))
    return _Shape(len(fields) - optional, len(fields), narrow, guarded, stamped)


REQUESTS = Direction({row.code: _shape(row.request, row.optional, guarded=row.guarded)
                      for row in COMMANDS if row.name != "xbee_text"}, lines=False)
"""Host to board."""
REPLIES = Direction({row.code: _shape(row.reply, row.optional_reply, stamped=row.stamped)
                     for row in COMMANDS if row.reply}, lines=True)
"""Board to host.  Boards also print free text, so a '@' behind text on the same line starts no frame."""


class _Integers(Dict[bytes, int]):
    """Canonical int16 tokens seen so far, at most 65536; looking one up is parsing, range check and strictness."""

    def __missing__(self, token: bytes) -> int:
        if len(token) > 6:
            raise KeyError(token)
        try:
            value = int(token)
        except ValueError:
            raise KeyError(token) from None
        if token != b"%d" % value or not -32768 <= value <= 32767:
            raise KeyError(token)
        self[token] = value
        return value


_integer = _Integers().__getitem__


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
        self._tabled = direction is not None
        self._lines = bool(direction and direction.lines)
        self._frame = bytearray()
        self._noise = bytearray()
        self._text = False

    def feed(self, data: bytes) -> List[Event]:
        """Frames and garbage completed by `data`, in the order of the wire."""
        events: List[Event] = []
        pieces = data.split(b"e")
        rest = pieces.pop()
        quick = self._quick_checked if self.checked else self._quick
        for piece in pieces:
            frame = None if self._frame or self._noise or self._text else quick(piece)
            if frame is not None:
                events.append(frame)
            else:
                self._scan(piece + b"e", events)
        self._scan(rest, events)
        return events

    def _quick(self, piece: bytes) -> Optional[Frame]:
        """The frame in `piece` if it is a good plain one that starts a line; None leaves the verdict to `_scan`."""
        start = 3 if piece[:3] == b"\r\n@" else 1
        if piece[start - 1:start] != b"@":
            return None
        try:
            code, *args = map(_integer, piece[start:].split(b","))
        except KeyError:
            return None
        shape = self._shapes.get(code)
        if shape is None or len(args) != shape.most or shape.guarded:
            return None
        for i, low, high in shape.narrow:
            if not low <= args[i] <= high:
                return None
        return _new(Frame, (code, tuple(args), None))

    def _quick_checked(self, piece: bytes) -> Optional[Frame]:
        """As `_quick`, for frames that end in a check value."""
        body, _, token = piece.rpartition(b",")
        start = 2 if body[:2] == b"\r\n" else 0
        if body[start:start + 1] != b"@":
            return None
        try:
            if _integer(token) & 0xFFFF != crc_hqx(body[start:], 0xFFFF):
                return None
            code, *args = map(_integer, body[start + 1:].split(b","))
        except KeyError:
            return None
        shape = self._shapes.get(code)
        if shape is None or len(args) != shape.most + 2 * shape.stamped:
            return None
        for i, low, high in shape.narrow:
            if not low <= args[i] <= high:
                return None
        if shape.stamped:
            return _new(Frame, (code, tuple(args[:-2]), _new(Stamp, args[-2:])))
        return _new(Frame, (code, tuple(args), None))

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
                values.append(_integer(token))
            except KeyError:
                return Garbage(data, _refuse(token))
        if len(values) > MAX_ARGUMENTS + 1:
            return Garbage(data, "argument_count")
        code, args = values[0], values[1:]
        shape = self._shapes.get(code)
        if self._must_check(code, args, shape):
            if not args or check_value(data[:data.rindex(b",")]) != args.pop():
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
        if any(i < len(args) and not low <= args[i] <= high for i, low, high in shape.narrow):
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
        raise FrameError(f"command {row.code} ({row.name}) takes {len(fields)} arguments, got {len(args)}: {args}")
    for field, value in zip(fields, args):
        if not field.low <= value <= field.high:
            raise FrameError(f"{row.name}: {field.name} is {value}, expected {field.low} to {field.high} {field.unit}")


def _frame(code: int, args: Sequence[int], checked: bool) -> bytes:
    body = b"@" + b",".join(b"%d" % value for value in (code, *args))
    return b"%s,%de" % (body, check_value(body)) if checked else body + b"e"


_new = tuple.__new__
