"""Bytes to frames, without I/O: no port, clock, thread or logger.

`FrameDecoder.feed` takes any bytes and returns frames and garbage; each piece of garbage has a reason.  It never raises
on input and never blocks.  The C++ version is `firmware/mrl_firmware/src/serial/frame_decoder.cpp`.

Grammar: `'@' command { ',' argument } 'e'`.  Integers are int16 in canonical decimal form: `-1` is valid; `+5`, `007`,
`-0` and the empty string are not.  A '@' inside a frame restarts the frame.
"""

from binascii import crc_hqx
from struct import error as StructError
from typing import List, Optional, Sequence

from .directions import REQUESTS, Direction, Shape
from .frames import Event, Frame, Garbage, Stamp, check_value
from .table import BY_NAME, INT16_MAX, INT16_MIN, MAX_ARGUMENTS, MAX_FRAME, MAX_NOISE, STAMP, STOP_CODE

_AT, _END, _CR, _LF = b"@e\r\n"
_CALIBRATE = BY_NAME["calibrate"].code
_PRINTABLE = range(0x20, 0x7F)
LEAST_RUN = 400
"""Shortest feed that is checked for a run of frames [byte]; with fewer bytes the check costs more than it saves."""


def _parse(token: bytes) -> int:
    """Return the canonical int16 in `token`; raise ValueError if it is none."""
    value = int(token)
    if token != b"%d" % value or not INT16_MIN <= value <= INT16_MAX:
        raise ValueError(token)
    return value


class FrameDecoder:
    """Turns bytes into frames and garbage.

    With a `direction` (`REPLIES` or `REQUESTS`) a frame must also match its row of the table.  While `checked` is set,
    each frame must end with its checksum, and stamped replies carry a sequence number and board time.

    Attributes:
        asked: Requests that turn motors need a checksum: the host has turned checksums on, and not off.
        plain_calibrate: Before that, a bare `calibrate` needs none.
    """

    def __init__(self, direction: Optional[Direction] = None, checked: bool = False) -> None:
        self.checked = checked
        self.asked = self.plain_calibrate = False
        self._shapes = direction.shapes if direction else {}
        self._forms = direction.forms if direction else {False: {}, True: {}}
        self._runs = direction.runs if direction else {False: {}, True: {}}
        self._tabled = direction is not None
        self._codes = direction.codes if direction else {}
        self._lines = bool(direction and direction.lines)
        self._frame = bytearray()
        self._noise = bytearray()
        self._line = ""  # content of the current line outside frames: empty, `text` or `noise`

    @property
    def pending(self) -> bytes:
        """Bytes that were fed and have not become an event yet: the start of a frame, or of noise."""
        return bytes(self._noise + self._frame)

    @property
    def idle(self) -> bool:
        """Whether the next frame depends only on its own bytes: none is pending, and no text shares its line."""
        return not (self._frame or self._noise or (self._line and self._lines))

    def drop(self) -> None:
        """Forget the bytes that have not become an event yet."""
        self._frame.clear()
        self._noise.clear()
        self._line = ""

    def feed(self, data: bytes) -> List[Event]:
        """Return the frames and garbage completed by `data`, in the order of the wire."""
        events: List[Event] = []
        if self._frame or len(data) >= LEAST_RUN:
            data = self._whole(data, events)
        *pieces, rest = data.split(b"e")
        checked = self.checked
        forms = {} if self.asked and not checked else self._forms[checked]
        for piece in pieces:
            tokens = piece.split(b",")
            try:
                if self._frame or self._line:
                    raise ValueError
                code, spelling, begin, pack, narrow, stamped = forms[tokens.pop(0)]
                values, stamp = tuple(map(int, tokens)), None
                pack(*values)
                if spelling % values != piece:  # `int` also reads signs, spaces and leading zeros
                    raise ValueError
                for i, low, high in narrow:
                    if not low <= values[i] <= high:
                        raise ValueError
                if checked:
                    if values[-1] & 0xFFFF != crc_hqx(piece[begin : -1 - len(tokens[-1])], 0xFFFF):
                        raise ValueError
                    stamp = _new(Stamp, values[-3:-1]) if stamped else None
                    values = values[:-3] if stamped else values[:-1]
            except (KeyError, ValueError, StructError):
                self._scan(piece + b"e", events)  # not a valid frame that starts a line
            else:
                events.append(_new(Frame, (code, values, stamp)))
        if self._frame or self._line:
            self._scan(rest, events)
        elif rest := rest.lstrip(b"\r\n"):
            self._await(rest, events)
        return events

    def _whole(self, data: bytes, events: List[Event]) -> bytes:
        """Put an incomplete frame in front of `data`, decode a run of frames, and return the rest."""
        if self._frame and self._line != "text" and _END in data:
            data = bytes(self._frame) + data
            self._frame.clear()
        if len(data) < LEAST_RUN or self._frame or self._line:
            return data
        data = data.lstrip(b"\r\n")
        run = self._runs[self.checked].get(data[: data.find(b",")])
        end = data.rfind(b"e") + 1
        frames = run.frames(data[:end]) if run else None
        if frames is None:
            return data
        events += frames
        return data[end:]

    def _await(self, rest: bytes, events: List[Event]) -> None:
        """Keep an incomplete frame (without its 'e') at the start of a line, as `_scan` would."""
        if rest.rfind(b"@") == 0 and len(rest) < MAX_FRAME:
            self._frame += rest
        else:
            self._scan(rest, events)

    def _scan(self, data: bytes, events: List[Event]) -> None:
        """Decode with the whole grammar, byte by byte."""
        for byte in data:
            if byte == _AT and (self.checked or self._line != "text"):
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
        if self._line == "text" and (type(event) is not Frame or _may_be_echo(event)):
            event = Garbage(data, "text")
        events.append(event)

    def _skip(self, byte: int, events: List[Event]) -> None:
        """Process one byte outside a frame: line ends are ignored, any other byte is noise or text."""
        if byte in (_CR, _LF):
            self._drop_noise(events)
            self._line = ""
            return
        if self._line != "noise":
            self._line = "text" if self._lines and byte in _PRINTABLE else "noise"
        self._noise.append(byte)
        if len(self._noise) >= MAX_NOISE:
            self._drop_noise(events)

    def _drop_noise(self, events: List[Event]) -> None:
        if self._noise:
            events.append(Garbage(bytes(self._noise), self._line))
            self._noise.clear()

    def _judge(self, data: bytes) -> Event:
        """Return a frame or garbage; `data` runs from '@' to 'e' and has neither inside."""
        values: List[int] = []
        code_token, *tokens = data[1:-1].split(b",")
        wrapped = self._codes.get(code_token)
        for token in (wrapped or code_token, *tokens):
            try:
                values.append(_parse(token))
            except ValueError:
                return Garbage(data, _refuse(token))
        if len(values) > MAX_ARGUMENTS + 1:
            return Garbage(data, "argument_count")
        code, args = values[0], values[1:]
        shape = self._shapes.get(code)
        if (
            not wrapped
            and self._must_check(code, args, shape)
            and not (args and check_value(data[: data.rindex(b",")]) == args.pop())
        ):
            return Garbage(data, "bad_check")
        if not self._tabled:
            return Frame(code, tuple(args))
        if shape is None:
            return Garbage(data, "unknown_command")
        return self._fit(data, code, args, shape)

    def _must_check(self, code: int, args: Sequence[int], shape: Optional[Shape]) -> bool:
        bare = self._tabled and not self._lines and not args
        plain_calibrate = self.plain_calibrate and not self.asked and code == _CALIBRATE
        if bare and (code == STOP_CODE or plain_calibrate):
            return False
        return self.checked or bool(shape and (shape.guarded or (shape.turns and self.asked)))

    def _fit(self, data: bytes, code: int, args: List[int], shape: Shape) -> Event:
        count = len(args) - len(STAMP) if self.checked and shape.stamped else len(args)
        if not shape.least <= count <= shape.most:
            return Garbage(data, "argument_count")
        if not all(low <= value <= high for (low, high), value in zip(shape.ranges, args[:count])):
            return Garbage(data, "argument_range")
        return Frame(code, tuple(args[:count]), Stamp(*args[count:]) if args[count:] else None)


def _may_be_echo(frame: Frame) -> bool:
    """Return whether a request could look the same."""
    shape = REQUESTS.shapes.get(frame.code)
    return shape is not None and shape.least <= len(frame.args) <= shape.most


def _refuse(token: bytes) -> str:
    """Return why a token is not an int16: it is out of range, or not a canonical integer."""
    digits = token[1:] if token[:1] == b"-" else token
    canonical = digits.isdigit() and (digits[:1] != b"0")
    return "beyond_int16" if canonical else "not_integer"


_new = tuple.__new__
