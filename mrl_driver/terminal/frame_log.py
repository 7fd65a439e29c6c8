"""The list of frames in the live view: one line per kind of frame with a count, so that repeats do not fill the
screen.  No I/O.
"""

import re
from typing import Dict, List, NamedTuple, Tuple

from mrl_driver.lock_order import new_lock
from mrl_driver.protocol.table import BY_CODE, MAX_FRAME, WRAP

MOST_LINES = 40
_PIECE = re.compile(rb"@(\d{1,5})[^@e]*e|[^@]+|@[^@e]*")
_BLANK = b" \r\n\t"


class Line(NamedTuple):
    """One kind of frame, or text that is not a frame."""

    direction: str  # `>` to the board, `<` from it
    name: str  # name of the command, or `text` if it is not a frame
    text: str  # content of the newest one
    times: int
    time_s: float  # time of the newest one [s]


class FrameLog:
    """Keeps the latest kinds of frames; `add_bytes` and `lines` may be called from different threads."""

    def __init__(self) -> None:
        self._lock = new_lock("frame log")
        self._lines: Dict[Tuple[str, str], Line] = {}
        self._rest: Dict[str, bytes] = {}

    def add_bytes(self, direction: str, data: bytes, now_s: float) -> None:
        """Add bytes that were sent in `direction`."""
        with self._lock:
            data = self._rest.get(direction, b"") + data
            end = data.rfind(b"e") + 1
            self._rest[direction] = data[end:][-MAX_FRAME:]
            for piece in _PIECE.finditer(data[:end]):
                code = int(piece.group(1)) % WRAP if piece.group(1) else -1
                self._add(direction, piece.group().strip(_BLANK), code, now_s)

    def _add(self, direction: str, piece: bytes, code: int, now_s: float) -> None:
        if not piece:
            return
        name = BY_CODE[code].name if code in BY_CODE else "text" if code < 0 else f"command {code}"
        text = piece.decode("ascii", "backslashreplace")
        text = "".join(each if each.isprintable() else "." for each in text)
        key = (direction, name)
        count = self._lines[key].times if key in self._lines else 0
        self._lines[key] = Line(direction, name, text, count + 1, now_s)
        while len(self._lines) > MOST_LINES:
            del self._lines[min(self._lines, key=lambda each: self._lines[each].time_s)]

    def lines(self) -> List[Line]:
        """Return all lines, in the order of the first frame of each kind."""
        with self._lock:
            return list(self._lines.values())
