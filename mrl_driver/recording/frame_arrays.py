"""Bytes to frames, many at once: numpy decodes the frames that stand for themselves, `FrameDecoder` all other bytes."""

from binascii import crc_hqx
from collections import Counter
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from mrl_driver.protocol import Frame, FrameDecoder, Garbage, Stamp
from mrl_driver.protocol.directions import Direction
from mrl_driver.protocol.table import INT16_MAX, INT16_MIN, STAMP

_MOST_WAITING = 4096
"""More bytes than this without the end of a frame are noise."""
_DIGITS = 5
_AT, _COMMA, _END, _MINUS, _CR, _LF, _ZERO = b"@,e-\r\n0"
_OTHER = np.ones(256, bool)
"""Bytes that are not inside a frame."""
_OTHER[list(b"0123456789,-e")] = False


class FrameArray(NamedTuple):
    """Frames with the same command and the same number of arguments, in order."""

    code: int
    at: Any
    """(N,) position of each frame's last byte in the bytes that were fed."""
    args: Any
    """(N, K) arguments."""
    stamps: Any
    """(N, 2) sequence number and board time; None without a stamp."""

    def frames(self) -> List[Tuple[int, Frame]]:
        """Return position and frame of each."""
        stamps: List[Optional[Stamp]] = [None] * len(self.at)
        if self.stamps is not None:
            stamps = [Stamp(*row) for row in self.stamps.tolist()]
        rows = zip(self.at.tolist(), self.args.tolist(), stamps)
        return [(at, Frame(self.code, tuple(args), stamp)) for at, args, stamp in rows]


class _Pieces(NamedTuple):
    """Bytes in pieces that each end with an 'e', and the numbers in them."""

    good: Any
    """(N,) the piece is one '@' and canonical int16s."""
    start: Any
    """(N,) position of the '@'."""
    end: Any
    """(N,) position of the 'e'."""
    last_comma: Any
    """(N,) position of the last comma; without one, that of the 'e' before."""
    first: Any
    """(N,) index of the piece's first number."""
    count: Any
    """(N,) how many numbers it has."""
    numbers: Any


class FrameArrayDecoder:
    """Gives the frames that `FrameDecoder` gives, as arrays.

    Attributes:
        garbage: pieces of garbage so far, by reason.
    """

    def __init__(self, direction: Direction) -> None:
        self._direction = direction
        self._decoder = FrameDecoder(direction)
        self._rest = np.zeros(0, np.uint8)
        self.garbage: Counter[str] = Counter()

    @property
    def checked(self) -> bool:
        """As `FrameDecoder.checked`."""
        return self._decoder.checked

    @checked.setter
    def checked(self, checked: bool) -> None:
        self.flush()
        self._decoder.checked = checked

    def flush(self) -> None:
        """Count the garbage in the bytes that wait for the end of a frame."""
        self._feed(self._rest.tobytes())
        self._rest = self._rest[:0]

    def feed(self, data: Any) -> List[FrameArray]:
        """Return the frames completed by `data` (uint8), in no particular order of their commands."""
        offset = len(self._rest)
        data = np.concatenate([self._rest, data])
        ends = np.flatnonzero(data == _END)
        size = int(ends[-1]) + 1 if len(ends) else 0
        self._rest = data[size:]
        if len(self._rest) > _MOST_WAITING and not size:
            self.flush()
        if not size:
            return []
        pieces = _split(data[:size], ends)
        tables = self._tables(data[:size].tobytes(), pieces)
        singles = self._singles(data[:size].tobytes(), pieces)
        return [found._replace(at=found.at - offset) for found in _merge(tables, singles, pieces.good)]

    def _tables(self, data: bytes, pieces: _Pieces) -> List[Tuple[Any, FrameArray]]:
        """Frames that the table allows, by command, with the indices of their pieces; no other piece stays good."""
        found = []
        codes = np.where(pieces.good, pieces.numbers[pieces.first], -1)
        for code in np.unique(codes).tolist():
            rows = np.flatnonzero(codes == code)
            table = self._table(data, pieces, code, rows) if code >= 0 else None
            if table is not None:
                rows, frames = table
                pieces.good[rows] = True
                found.append(table)
        return found

    def _table(self, data: bytes, pieces: _Pieces, code: int, rows: Any) -> Optional[Tuple[Any, FrameArray]]:
        pieces.good[rows] = False
        shape, checked = self._direction.shapes.get(code), self._decoder.checked
        if shape is None or (shape.guarded and not checked):
            return None
        stamped = checked and shape.stamped
        width = shape.most + (len(STAMP) * stamped + 1 if checked else 0)
        rows = rows[pieces.count[rows] == width + 1]
        numbers = pieces.numbers[pieces.first[rows][:, None] + np.arange(1, width + 1)]
        right = np.ones(len(rows), bool)
        for i, (low, high) in enumerate(shape.ranges[: shape.most]):
            right &= (numbers[:, i] >= low) & (numbers[:, i] <= high)
        if checked:
            right &= _checksums(data, pieces.start[rows], pieces.last_comma[rows]) == numbers[:, -1] & 0xFFFF
        rows, numbers = rows[right], numbers[right]
        stamps = numbers[:, shape.most : shape.most + len(STAMP)] if stamped else None
        return rows, FrameArray(code, pieces.end[rows], numbers[:, : shape.most], stamps)

    def _singles(self, data: bytes, pieces: _Pieces) -> List[Tuple[int, Frame]]:
        """Frames, with their positions, of the pieces that are not good, and of those that share a line with them.

        The latter also become not good.
        """
        good, ends = pieces.good, pieces.end
        bad = np.flatnonzero(~good).tolist()
        if not self._decoder.idle:
            bad.insert(0, 0)
        found, done = [], 0
        for i in bad:
            if i < done:
                continue
            idle = False
            while not idle and i < len(ends):
                good[i] = False
                end = int(ends[i]) + 1
                frames = self._feed(data[int(ends[i - 1]) + 1 if i else 0 : end])
                found += [(end - 1, frame) for frame in frames]
                idle, i = self._decoder.idle, i + 1
            done = i
        return found

    def _feed(self, data: bytes) -> List[Frame]:
        frames = []
        for event in self._decoder.feed(data):
            if isinstance(event, Garbage):
                self.garbage[event.reason] += 1
            else:
                frames.append(event)
        return frames


def _split(data: Any, ends: Any) -> _Pieces:
    """Split bytes whose last one is an 'e'."""
    starts = np.concatenate([[0], ends[:-1] + 1])
    padded = np.append(data, np.zeros(2, np.uint8))
    first, second, third = padded[starts], padded[starts + 1], padded[starts + 2]
    lead = np.where((first == _CR) & (second == _LF) & (third == _AT), 2, 9)
    lead = np.where((first == _LF) & (second == _AT), 1, np.where(first == _AT, 0, lead))
    others = np.bincount(np.searchsorted(ends, np.flatnonzero(_OTHER[data])), minlength=len(ends))
    good = others == lead + 1
    minus = np.flatnonzero(data == _MINUS)
    good[np.searchsorted(ends, minus[data[minus - 1] != _COMMA])] = False

    stops = np.flatnonzero((data == _COMMA) | (data == _END))
    last = np.searchsorted(stops, ends)
    count = np.diff(last, prepend=-1)
    begins = np.concatenate([[0], stops[:-1] + 1])
    begins[last - count + 1] = starts + lead * good + 1
    numbers, canonical = _numbers(data, begins, stops)
    good &= np.logical_and.reduceat(canonical, last - count + 1)
    return _Pieces(good, starts + lead * good, ends, stops[last - 1], last - count + 1, count, numbers)


def _numbers(data: Any, begins: Any, stops: Any) -> Tuple[Any, Any]:
    """Return the numbers in these places, and whether each is a canonical int16."""
    negative = data[np.minimum(begins, stops)] == _MINUS
    digits = stops - begins - negative
    value, place = np.zeros(len(stops), np.int32), 1
    for k in range(_DIGITS):
        digit = (data[np.maximum(stops - 1 - k, 0)] - np.uint8(_ZERO)).astype(np.int32)
        value += np.where(k < digits, digit, 0) * place
        place *= 10
    canonical = (digits >= 1) & (digits <= _DIGITS)
    canonical &= (data[np.minimum(begins + negative, stops)] != _ZERO) | ((digits == 1) & ~negative)
    value = np.where(negative, -value, value)
    return value, canonical & (value >= INT16_MIN) & (value <= INT16_MAX)


def _checksums(data: bytes, starts: Any, ends: Any) -> Any:
    """Return the checksums of these parts of `data`, as numbers from 0 to 65535."""
    found = [crc_hqx(data[start:end], 0xFFFF) for start, end in zip(starts.tolist(), ends.tolist())]
    return np.array(found, np.int32)


def _merge(
    tables: List[Tuple[Any, FrameArray]], singles: List[Tuple[int, Frame]], good: Any
) -> List[FrameArray]:
    """Return all frames: those in `tables` whose pieces are good, and `singles`."""
    found: Dict[Tuple[int, int, bool], List[FrameArray]] = {}
    for rows, frames in tables:
        kept, key = good[rows], (frames.code, frames.args.shape[1], frames.stamps is not None)
        stamps = frames.stamps[kept] if frames.stamps is not None else None
        found[key] = [FrameArray(frames.code, frames.at[kept], frames.args[kept], stamps)]
    alike: Dict[Tuple[int, int, bool], List[Tuple[int, Frame]]] = {}
    for at, frame in singles:
        alike.setdefault((frame.code, len(frame.args), frame.stamp is not None), []).append((at, frame))
    for key, group in alike.items():
        code, width, stamped = key
        places = np.array([at for at, _ in group])
        args = np.array([frame.args for _, frame in group], np.int32).reshape(len(group), width)
        stamps = np.array([frame.stamp for _, frame in group], np.int32) if stamped else None
        found.setdefault(key, []).append(FrameArray(code, places, args, stamps))
    joined = [_joined(parts) for parts in found.values()]
    return [frames for frames in joined if len(frames.at)]


def _joined(parts: List[FrameArray]) -> FrameArray:
    if len(parts) == 1:
        return parts[0]
    at = np.concatenate([part.at for part in parts])
    order = np.argsort(at, kind="stable")
    args = np.concatenate([part.args for part in parts])[order]
    stamps = None
    if parts[0].stamps is not None:
        stamps = np.concatenate([part.stamps for part in parts])[order]
    return FrameArray(parts[0].code, at[order], args, stamps)
