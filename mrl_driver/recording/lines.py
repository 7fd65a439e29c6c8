"""The lines of a recording, many at once: numpy works on blocks of the file, so that hours are read in seconds.

A line as the recorder writes it is read by array operations.  Any other line is read by itself, in `_parse`.
"""

import codecs
import re
from typing import Any, BinaryIO, Callable, Dict, Iterator, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from .entry import FROM_BOARD, LONGEST_LINE, REMARK, TO_BOARD, Entry

BLOCK_BYTES = 1 << 18
AHEAD = 7
"""A line is later than most of this many lines behind it: its time is damaged, not theirs."""
_DIRECTIONS = tuple(ord(direction) for direction in (TO_BOARD, FROM_BOARD, REMARK))
_NEWLINE, _RETURN, _SPACE, _POINT, _BACKSLASH = b"\n\r .\\"
_DECIMALS, _MOST_DIGITS = 6, 9
_SHORT = np.zeros(256, np.uint8)
"""The byte that an escape of two characters stands for, by its second one; 0 if it is read by `_parse`."""
_SHORT[list(b"rnt")] = list(b"\r\n\t")
_ESCAPED = re.compile(rb"""([^\\]|\\([\\'"abfnrtv]|[0-3][0-7]{2}|[0-7]{1,2}(?![0-7])|x[0-9a-fA-F]{2}))*""")
_ZERO = np.uint8(ord("0"))
_HEX = np.full(256, 255, np.uint8)
"""The value of a hexadecimal digit."""
_HEX[list(b"0123456789abcdef")] = range(16)
_HEX[list(b"ABCDEF")] = range(10, 16)


class Block(NamedTuple):
    """Consecutive entries of a recording, as arrays."""

    times_s: Any
    """(N,) [s since the start]."""
    directions: Any
    """(N,) byte values of `>`, `<`, `!`."""
    ends: Any
    """(N,) where the bytes of each entry end in `data`."""
    data: Any
    """The bytes of all entries (uint8)."""

    @property
    def sizes(self) -> Any:
        """(N,) number of bytes of each entry."""
        return np.diff(self.ends, prepend=0)

    def entries(self) -> Iterator[Entry]:
        """Yield the entries."""
        data, start = self.data.tobytes(), 0
        directions = self.directions.tobytes().decode()
        for time_s, direction, end in zip(self.times_s.tolist(), directions, self.ends.tolist()):
            yield Entry(time_s, direction, data[start:end])
            start = end

    def part(self, first: int, last: int) -> "Block":
        """Return the entries from `first` to before `last`."""
        begin = int(self.ends[first - 1]) if first else 0
        end = int(self.ends[last - 1]) if last else 0
        rows = slice(first, last)
        return Block(self.times_s[rows], self.directions[rows], self.ends[rows] - begin, self.data[begin:end])

    def only(self, chosen: Any) -> "Block":
        """Return the entries for which `chosen` (N,) is true."""
        if chosen.all():
            return self
        sizes = self.sizes
        data = self.data[np.repeat(chosen, sizes)]
        return Block(self.times_s[chosen], self.directions[chosen], np.cumsum(sizes[chosen]), data)

    def followed_by(self, other: "Block") -> "Block":
        """Return the entries of both."""
        return Block(
            np.concatenate([self.times_s, other.times_s]),
            np.concatenate([self.directions, other.directions]),
            np.concatenate([self.ends, other.ends + len(self.data)]),
            np.concatenate([self.data, other.data]),
        )


def block_of(entries: Sequence[Entry]) -> Block:
    """Return these entries as arrays."""
    data = b"".join(entry.data for entry in entries)
    return Block(
        np.array([entry.time_s for entry in entries], float),
        np.array([ord(entry.direction) for entry in entries], np.uint8),
        np.cumsum([len(entry.data) for entry in entries], dtype=np.int64),
        np.frombuffer(data, np.uint8),
    )


def read_blocks(file: BinaryIO, skip: Callable[[int, str], None]) -> Iterator[Block]:
    """Yield the entries of all lines from the second one on, where `file` stands.

    `skip` is called in order with the number of each line that cannot be read and the reason.  Memory does not grow
    with the file.
    """
    reader, text, more = _Reader(skip), b"", b"\n"
    while more:
        more = file.read(BLOCK_BYTES)
        text += more
        whole = text.rfind(b"\n") + 1
        too_long = len(text) - whole > LONGEST_LINE
        block, done = reader.read(text[:whole], too_long or not more)
        text = text[done:]
        if len(block.ends):
            yield block
        if too_long:
            reader.number += 1
            skip(reader.number, f"longer than {LONGEST_LINE} bytes")
            text = _after_newline(file)
    if text.strip():
        skip(reader.number + 1, "incomplete")


def _after_newline(file: BinaryIO) -> bytes:
    """Skip the rest of a line, and return the bytes behind it that were read with it."""
    while True:
        more = file.read(BLOCK_BYTES)
        found = more.find(b"\n")
        if found >= 0 or not more:
            return more[found + 1 :]


class _Reader:
    """Reads blocks of whole lines.

    Attributes:
        number: number of the last line that was read.
    """

    def __init__(self, skip: Callable[[int, str], None]) -> None:
        self._skip = skip
        self.number = 1
        self._last_s = 0.0

    def read(self, text: bytes, at_end: bool) -> Tuple[Block, int]:
        """Return the entries of some whole lines, and how many bytes of `text` are done.

        The last lines wait for the ones behind them, unless `at_end`.
        """
        lines = _Lines(text)
        found = np.flatnonzero(lines.good)
        behind = len(found) - (0 if at_end else min(AHEAD, len(found)))
        count = int(found[behind]) if behind < len(found) else len(lines.good)
        self._judge(lines, found, behind)
        for i in np.flatnonzero(~lines.good[:count]).tolist():
            if lines.problems[i]:
                self._skip(self.number + 1 + i, lines.problems[i])
        self.number += count
        return lines.block(count), int(lines.ends[count - 1]) + 1 if count else 0

    def _judge(self, lines: "_Lines", found: Any, count: int) -> None:
        """Skip those of the first `count` lines `found` whose times are out of order."""
        times = np.concatenate([lines.times_s[found], np.full(AHEAD, np.inf)])
        before = times[:count]
        earlier = sum((times[k : count + k] < before).astype(np.int8) for k in range(1, AHEAD + 1))
        ahead = np.asarray(earlier > AHEAD // 2, bool)
        latest = np.maximum.accumulate(np.concatenate([[self._last_s], np.where(ahead, 0.0, before)]))
        for i in np.flatnonzero(ahead | (before < latest[:-1])).tolist():
            line, time_s = int(found[i]), before[i]
            lines.good[line] = False
            lines.problems[line] = (
                f"time {time_s} is after that of most of the {AHEAD} lines behind it"
                if ahead[i]
                else f"time {time_s} is before {latest[i]} of an earlier line"
            )
        self._last_s = float(latest[-1])


class _Lines:
    """A block of whole lines, parsed.

    Attributes:
        ends: (N,) positions of the line ends.
        good: (N,) the line is an entry.
        times_s: (N,) its time.
        problems: what is wrong with other lines; empty for a blank one.
    """

    def __init__(self, text: bytes) -> None:
        self._text = text
        self._bytes = data = np.frombuffer(bytearray(text), np.uint8)
        self.ends = ends = np.flatnonzero(data == _NEWLINE)
        self._starts = np.concatenate([[0], ends[:-1] + 1])[: len(ends)]
        self.times_s = np.zeros(len(ends))
        self._directions = np.zeros(len(ends), np.uint8)
        self._begin, self._stop = np.zeros(len(ends), np.int64), ends.copy()
        self._removed = np.zeros(len(ends), np.int64)
        self.problems: Dict[int, str] = {}
        self.good = self._regular()
        self._kept = np.ones(len(data), bool)
        self._unescape()
        for i in np.flatnonzero(~self.good).tolist():
            self._alone(i)

    def _regular(self) -> Any:
        """Read time and direction of the lines that are as the recorder writes them; return which are."""
        data, ends = self._bytes, self.ends
        spaces = np.append(np.flatnonzero(data == _SPACE), len(data))
        space = spaces[np.searchsorted(spaces, self._starts)]
        width = space - self._starts
        good = (width > _DECIMALS + 1) & (width <= _DECIMALS + 1 + _MOST_DIGITS) & (space + 2 < ends)
        rows = np.flatnonzero(good)
        space, width = space[rows], width[rows]
        direction = data[space + 1]
        right = (data[space - _DECIMALS - 1] == _POINT) & (data[space + 2] == _SPACE)
        right &= np.isin(direction, _DIRECTIONS)
        micros, place = np.zeros(len(rows), np.int64), 1
        for k in range(int(width.max(initial=0))):
            if k == _DECIMALS:
                continue
            within = k < width
            digit = np.where(within, data[np.maximum(space - 1 - k, 0)] - _ZERO, 0)
            right &= digit <= 9
            micros += digit.astype(np.int64) * place
            place *= 10
        self.times_s[rows] = micros / 1e6
        self._directions[rows] = direction
        self._begin[rows] = space + 3
        returned = data[ends[rows] - 1] == _RETURN
        self._stop[rows] -= returned
        right &= ~(returned & (data[np.maximum(ends[rows] - 2, 0)] == _RETURN)) & (
            self._stop[rows] >= self._begin[rows]
        )
        good[rows] = right
        return good

    def _unescape(self) -> None:
        """Replace the escapes of the good lines; a line with others than those of the recorder is read alone."""
        data = self._bytes
        at = np.flatnonzero(data == _BACKSLASH)
        line = np.searchsorted(self.ends, at)
        padded = np.append(data, np.zeros(3, np.uint8))
        second, high, low = padded[at + 1], _HEX[padded[at + 2]], _HEX[padded[at + 3]]
        short = _SHORT[second]
        long = (second == ord("x")) & (high < 16) & (low < 16)
        self.good[line[(short == 0) & ~long]] = False
        chosen = self.good[line]
        short_at, long_at = chosen & (short > 0), chosen & long
        self._kept[at[chosen]] = False
        data[at[short_at] + 1] = short[short_at]
        places = at[long_at]
        self._kept[places + 1] = self._kept[places + 2] = False
        data[places + 3] = high[long_at] * 16 + low[long_at]
        count = len(self.ends)
        self._removed += np.bincount(line[short_at], minlength=count)
        self._removed += 3 * np.bincount(line[long_at], minlength=count)

    def _alone(self, i: int) -> None:
        """Read a line that is not as the recorder writes it."""
        start = int(self._starts[i])
        line = self._text[start : int(self.ends[i])]
        entry, problem = _parse(line) if line.strip() else (None, "")
        self.problems[i] = problem
        if entry is None:
            return
        size = len(entry.data)
        self.good[i], self.times_s[i], self._directions[i] = True, entry.time_s, ord(entry.direction)
        self._bytes[start : start + size] = np.frombuffer(entry.data, np.uint8)
        self._begin[i], self._stop[i] = start, start + size

    def block(self, count: int) -> Block:
        """Return the entries of the first `count` lines."""
        good = self.good[:count]
        begin, stop = self._begin[:count][good], self._stop[:count][good]
        edges = np.zeros(len(self._bytes) + 1, np.int8)
        edges[begin] += 1
        edges[stop] -= 1
        within = np.cumsum(edges[:-1], dtype=np.int8).view(bool)
        ends = np.cumsum(stop - begin - self._removed[:count][good])
        data = self._bytes[within & self._kept]
        return Block(self.times_s[:count][good], self._directions[:count][good], ends, data)


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
    if not _ESCAPED.fullmatch(text):
        return None, f"bytes {text[:20]!r} are not escaped as in a Python string"
    return Entry(time_s, direction.decode(), codecs.escape_decode(text)[0]), ""
