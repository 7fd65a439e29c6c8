"""The lines of a recording, read one by one.  Memory does not grow with the file."""

import codecs
import itertools
import re
from collections import deque
from typing import BinaryIO, Callable, Deque, Iterator, NamedTuple, Optional, Tuple

TO_BOARD, FROM_BOARD, REMARK = ">", "<", "!"
LONGEST_LINE = 1 << 20
AHEAD = 7  # a line is later than most of this many lines behind it: its time is damaged, not theirs
_MOST_WAITING = 1000  # a line waits for at most this many behind it: they may all be damaged
_ESCAPE = re.compile(rb"""\\(?:[\\'"abfnrtv]|[0-3][0-7]{2}|[0-7]{1,2}(?![0-7])|x[0-9a-fA-F]{2})""")


class Entry(NamedTuple):
    """One line: time [s since the start], direction (`>`, `<` or `!`), and the bytes."""

    time_s: float
    direction: str
    data: bytes


Skip = Callable[[int, str], None]
_Line = Tuple[int, Optional[Entry], str]
"""Number of a line, and its entry, or what is wrong with it; nothing is wrong with a blank one."""


def read_lines(file: BinaryIO, skip: Skip, line: int = 1) -> Iterator[Entry]:
    """Yield the entries of all lines behind the line of this number, where `file` stands.

    `skip` is called in order with the number of each line that cannot be read and the reason.
    """
    waiting: Deque[_Line] = deque()
    times: Deque[float] = deque()  # of the entries that wait
    last_s = 0.0
    for found in itertools.chain(_lines(file, line), (None,)):
        if found is not None:
            waiting.append(found)
            if found[1] is not None:
                times.append(found[1].time_s)
        ends = found is None
        while waiting and (
            ends or waiting[0][1] is None or len(times) > AHEAD or len(waiting) > _MOST_WAITING
        ):
            number, entry, problem = waiting.popleft()
            if entry is not None:
                problem = _disorder(times.popleft(), last_s, times)
            if entry is None or problem:
                skip(number, problem)
            else:
                last_s = entry.time_s
                yield entry


def _disorder(time_s: float, last_s: float, behind: Deque[float]) -> str:
    """Return what is wrong with the time of a line, by those before and behind it; empty if nothing is."""
    if behind and min(behind) < time_s and sum(each < time_s for each in behind) > AHEAD // 2:
        return f"time {time_s} is after that of most of the {AHEAD} lines behind it"
    return f"time {time_s} is before {last_s} of an earlier line" if time_s < last_s else ""


def _lines(file: BinaryIO, number: int) -> Iterator[_Line]:
    """Yield all lines that are not blank behind the line of this number."""
    while True:
        text = file.readline(LONGEST_LINE + 1)
        number += 1
        if not text:
            return
        if len(text) > LONGEST_LINE:
            while text and not text.endswith(b"\n"):
                text = file.readline(LONGEST_LINE)
            yield number, None, f"longer than {LONGEST_LINE} bytes"
        elif not text.strip():
            continue
        elif not text.endswith(b"\n"):
            yield number, None, "incomplete"
        else:
            yield (number, *_parse(text))


def _parse(line: bytes) -> Tuple[Optional[Entry], str]:
    """The entry on a line, or None and what is wrong with it."""
    stamp, _, rest = line.strip(b"\r\n").partition(b" ")
    direction, _, text = rest.partition(b" ")
    try:
        time_s = float(stamp)
    except ValueError:
        return None, f"time is {stamp[:20]!r}, expected seconds"
    if not 0.0 <= time_s < 1e9:
        return None, f"time is {time_s}, expected 0 or more seconds"
    if direction not in (b">", b"<", b"!"):
        return None, f"direction is {direction[:20]!r}, expected '>', '<' or '!'"
    if b"\\" in text:
        if b"\\" in _ESCAPE.sub(b"", text):
            return None, f"bytes {text[:20]!r} are not escaped as in a Python string"
        text = codecs.escape_decode(text)[0]
    return Entry(time_s, direction.decode(), text), ""
