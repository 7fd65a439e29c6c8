"""Whole recordings to arrays: the codec's grammar, vectorised with NumPy.

Frames that plainly match their row are parsed all together; whatever else stands between them goes through
`codec.FrameDecoder`, so both give the same frames and the same garbage.
"""

from binascii import crc_hqx
from typing import Dict, Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from mrl_driver.protocol.codec import REPLIES, Frame, FrameDecoder, Garbage
from mrl_driver.protocol.table import BY_CODE, STAMP

_COMMA, _MINUS, _ZERO = b",-0"
_PAD = 8
CHUNK = 1 << 18
_PLACES = 10 ** np.arange(5, dtype=np.int32)
"""Taken as arrays of one: times a scalar, NumPy before 2.0 would stay at the eight bits of a digit."""
"""Bytes decoded at a time: the temporary arrays then fit a processor's cache."""


class LogFrames(NamedTuple):
    """Frames of one code, in the order of the wire.

    `end` (N,) is the offset just behind each frame's 'e' [byte]; `args` (N, fields of the row) int16;
    `stamps` (N, 2) int16, columns sequence and board time [- 64 us], or None when the log is not checked.
    """

    end: np.ndarray
    args: np.ndarray
    stamps: Optional[np.ndarray]


class LogEvents(NamedTuple):
    """What a log holds: frames by code, and garbage in order."""

    frames: Dict[int, LogFrames]
    garbage: List[Garbage]


def decode_log(data: bytes, checked: bool = False) -> LogEvents:
    """Every reply and stream frame in `data`, as `FrameDecoder(REPLIES, checked)` would find them."""
    decoder = LogDecoder(checked)
    for start in range(0, len(data), CHUNK):
        decoder.feed(data[start : start + CHUNK])
    return decoder.events()


class LogDecoder:
    """Decodes a log piece by piece; memory grows only with the frames found."""

    def __init__(self, checked: bool = False) -> None:
        self._scalar = FrameDecoder(REPLIES, checked)
        self._blocks: Dict[int, List[LogFrames]] = {}
        self._garbage: List[Garbage] = []
        self._rest = b""
        self._adrift = False
        self._offset = 0

    def feed(self, data: bytes) -> None:
        """Decodes up to the last 'e' in `data`; what follows waits for more."""
        data = self._rest + data
        if self._adrift:
            data = self._drift(data)
        cut = data.rfind(b"e") + 1
        self._rest = data[cut:]
        if cut:
            self._decode(data[:cut])
            self._offset += cut
        if len(self._rest) > CHUNK:
            self._adrift = True
            self._rest = self._drift(self._rest)

    def _drift(self, data: bytes) -> bytes:
        """Without an 'e' for long nothing may be kept: the scalar decoder takes all up to the next one."""
        cut = data.find(b"e") + 1
        self._adrift = not cut
        cut = cut or len(data)
        self._take(data[:cut], cut)
        self._offset += cut
        return data[cut:]

    def events(self) -> LogEvents:
        """All that was found so far, the rest that no 'e' ends included."""
        self._take(self._rest, 0)
        self._rest = b""
        return LogEvents(
            {code: _join(blocks) for code, blocks in sorted(self._blocks.items())}, self._garbage
        )

    def _decode(self, data: bytes) -> None:
        """Decodes pieces that all end in 'e'."""
        padded = np.frombuffer(data + bytes(_PAD), np.uint8)
        ends = np.flatnonzero(padded == ord("e"))
        starts = np.concatenate(([0], ends[:-1] + 1))
        plain = np.zeros(len(ends), bool)
        for code in _codes(padded, starts):
            found = _with_head(padded, starts, code)
            good, frames = _parse(padded, starts[found], ends[found], code, self._scalar.checked)
            plain[found[good]] = True
            self._add(code, frames)
        self._decode_others(data, plain, starts.tolist(), ends.tolist())

    def _decode_others(self, data: bytes, plain: np.ndarray, starts: List[int], ends: List[int]) -> None:
        """Decodes the pieces that are not plain; of a plain one the decoder has to see no more than its line end."""
        for i in np.flatnonzero(~plain).tolist():
            lead = b"\r\n" if i and plain[i - 1] else b""
            self._take(lead + data[starts[i] : ends[i] + 1], ends[i] + 1)
        if plain[-1]:
            self._take(b"\r\n", 0)

    def _take(self, data: bytes, end: int) -> None:
        for event in self._scalar.feed(data):
            if isinstance(event, Garbage):
                self._garbage.append(event)
            else:
                self._add(event.code, _one(event, end))

    def _add(self, code: int, frames: LogFrames) -> None:
        if len(frames.end):
            self._blocks.setdefault(code, []).append(frames._replace(end=frames.end + self._offset))


def _codes(padded: np.ndarray, starts: np.ndarray) -> Iterator[int]:
    """Codes of the table that stand at the head of some piece."""
    heads = np.unique(padded[starts + 3].astype(np.int32) << 8 | padded[starts + 4])
    texts = {bytes([head >> 8, head & 255]).split(b",")[0] for head in heads.tolist()}
    return (code for code in REPLIES.shapes if b"%d" % code in texts)


def _with_head(padded: np.ndarray, starts: np.ndarray, code: int) -> np.ndarray:
    """Indices of the pieces that begin with CR LF '@' code ','."""
    match = np.ones(len(starts), bool)
    for i, byte in enumerate(b"\r\n@%d," % code):
        match &= padded[starts + i] == byte
    return np.flatnonzero(match)


def _parse(
    padded: np.ndarray, starts: np.ndarray, ends: np.ndarray, code: int, checked: bool
) -> Tuple[np.ndarray, LogFrames]:
    """Indices of the pieces that are good frames of `code`, and those frames."""
    row = BY_CODE[code]
    count = len(row.reply)
    width = count + (len(STAMP) * row.stamped + 1 if checked else 0)
    good, bounds = _bounds(padded, starts, ends, width)
    values, fine = _integers(padded, bounds[:-1] + 1, bounds[1:])
    for value, field in zip(values, row.reply):
        fine &= (value >= field.low) & (value <= field.high)
    if checked:
        fine &= _checks(padded, starts[good] + 2, bounds[-2]) == (values[-1] & 0xFFFF)
    good, values = good[fine], values[:, fine].astype(np.int16)
    stamps = values[count:-1].T if checked and row.stamped else None
    return good, LogFrames(ends[good] + 1, values[:count].T, stamps)


def _bounds(
    padded: np.ndarray, starts: np.ndarray, ends: np.ndarray, width: int
) -> Tuple[np.ndarray, np.ndarray]:
    """Pieces with `width` commas (M,), and the positions of those and of the 'e' (width + 1, M)."""
    commas = np.flatnonzero(padded == _COMMA)
    first = np.searchsorted(commas, starts)
    good = np.flatnonzero(np.searchsorted(commas, ends) - first == width)
    bounds = np.empty((width + 1, len(good)), np.int64)
    bounds[:-1] = commas[first[good] + np.arange(width)[:, None]]
    bounds[-1] = ends[good]
    return good, bounds


def _integers(padded: np.ndarray, begin: np.ndarray, end: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Values of the tokens [begin, end) (K, M), and which columns hold nothing but canonical int16 (M,)."""
    first = padded.take(begin)
    negative = first == _MINUS
    digits = (end - begin).astype(np.int32) - negative
    fine = (digits >= 1) & (digits <= 5)
    fine &= (first != _ZERO) | (digits == 1)
    if negative.any():
        fine &= ~(negative & (padded.take(begin + 1) == _ZERO))
    values, numeric = _decimals(padded, end, digits)
    values = np.where(negative, -values, values)
    fine &= numeric & (values >= -32768) & (values <= 32767)
    return values, fine.all(axis=0)


def _decimals(padded: np.ndarray, end: np.ndarray, digits: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Decimal values of the (at most five) bytes before `end`, and which of them are all digits."""
    values = np.zeros(end.shape, np.int32)
    numeric = np.ones(end.shape, bool)
    for column, (value, fine) in enumerate(zip(values, numeric)):
        for place in range(min(5, int(digits[column].max(initial=0)))):
            inside = digits[column] > place
            digit = (padded.take(end[column] - (place + 1)) - np.uint8(_ZERO)) * inside
            fine &= digit <= 9
            value += digit * _PLACES[place : place + 1]
    return values, numeric


def _checks(padded: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """CRC-16 of the bytes [begin, end) of each frame (M,), unsigned."""
    data = padded.tobytes()
    return np.array([crc_hqx(data[a:b], 0xFFFF) for a, b in zip(begin.tolist(), end.tolist())], np.int32)


def _one(frame: Frame, end: int) -> LogFrames:
    stamps = None if frame.stamp is None else np.array([frame.stamp], np.int16)
    args = np.zeros((1, len(BY_CODE[frame.code].reply)), np.int16)
    args[0, : len(frame.args)] = frame.args
    return LogFrames(np.array([end]), args, stamps)


def _join(blocks: List[LogFrames]) -> LogFrames:
    end = np.concatenate([block.end for block in blocks])
    order = np.argsort(end, kind="stable")
    stamps = [block.stamps for block in blocks if block.stamps is not None]
    return LogFrames(
        end[order],
        np.concatenate([block.args for block in blocks])[order],
        np.concatenate(stamps)[order] if stamps else None,
    )
