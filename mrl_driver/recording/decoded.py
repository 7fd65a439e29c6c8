"""A recording, read once from its start: frames and garbage of both directions.

Summaries and calibrations read recordings through this module: faster than `driver.recorded`, and without what
listeners of the driver get.  Memory does not grow with the file.
"""

from collections import deque
from typing import Deque, Dict, Iterable, Iterator, List, NamedTuple, Tuple

from mrl_driver.protocol import REPLIES, REQUESTS_TO_ANY, Event, Frame, FrameDecoder

from .recording import (
    CHECKED,
    FROM_BOARD,
    MODEL,
    OPENED,
    PLAIN,
    POSE,
    REMARK,
    SESSION,
    TO_BOARD,
    Entry,
    Recording,
)

LINE_BYTES = 12  # a line of the file takes about this many bytes besides its data
HELD_BYTES = 8192
"""An entry waits until this many bytes of the file follow it: the driver remarks that checksums begin or end only
after it has read the first such frames."""
_TAIL_BYTES = 4096
"""The first such frame is at most this far from the end of the board's bytes before the remark."""


class DecodedPart(NamedTuple):
    """An entry, or a piece of one, and the frames and garbage that it completes; a remark has none."""

    time_s: float
    direction: str
    data: bytes
    events: List[Event]


def decode(recording: Recording) -> Iterator[DecodedPart]:
    """Decode a whole recording; a remark on checksums comes before the first reply that it applies to."""
    decoders, size = _decoders(), 0
    held: Deque[Entry] = deque()
    for entry in recording:
        time_s, direction, data = entry
        if direction != REMARK:
            held.append(entry)
            size += _size(entry)
            while size - _size(held[0]) >= HELD_BYTES:
                size -= _size(held[0])
                yield from _feed([held.popleft()], decoders)
            continue
        if data in (CHECKED, PLAIN):
            yield from _switch(list(held), entry, decoders)
        elif data.startswith(OPENED):
            yield from _feed([*held, entry], decoders)
            decoders = _decoders()
        elif data.startswith((MODEL, POSE, SESSION)):
            held.append(Entry(time_s, direction, data))
            continue
        else:
            continue
        held.clear()
        size = 0
    yield from _feed(held, decoders)


def _size(entry: Entry) -> int:
    """Return the bytes of the file that an entry stands for; a remark does not count."""
    return 0 if entry.direction == REMARK else len(entry.data) + LINE_BYTES


def _decoders() -> Dict[str, FrameDecoder]:
    return {TO_BOARD: FrameDecoder(REQUESTS_TO_ANY), FROM_BOARD: FrameDecoder(REPLIES)}


def _feed(entries: Iterable[Entry], decoders: Dict[str, FrameDecoder]) -> Iterator[DecodedPart]:
    for time_s, direction, data in entries:
        yield DecodedPart(
            time_s, direction, data, decoders[direction].feed(data) if direction != REMARK else []
        )


def _switch(held: List[Entry], remark: Entry, decoders: Dict[str, FrameDecoder]) -> Iterator[DecodedPart]:
    """The entries before a remark on checksums, and the remark between the two groups."""
    checked = remark.data == CHECKED
    before, behind = split(held, checked) if checked != decoders[FROM_BOARD].checked else (held, [])
    yield from _feed([*before, remark], decoders)
    decoders[FROM_BOARD].checked = checked
    yield from _feed(behind, decoders)
    decoders[TO_BOARD].checked = checked


def split(entries: List[Entry], checked: bool) -> Tuple[List[Entry], List[Entry]]:
    """Split the entries at the first reply near their end after which only the rules of `checked` give frames."""
    left = _first_frame(b"".join(data for _, direction, data in entries if direction == FROM_BOARD), checked)
    for i, (time_s, direction, data) in enumerate(entries):
        if direction == FROM_BOARD and len(data) > left:
            pieces = Entry(time_s, direction, data[:left]), Entry(time_s, direction, data[left:])
            return [*entries[:i], pieces[0]], [pieces[1], *entries[i + 1 :]]
        left -= len(data) if direction == FROM_BOARD else 0
    return entries, []


def _first_frame(data: bytes, checked: bool) -> int:
    """Offset of the first frame near the end of `data` after which only the rules of `checked` give frames."""
    found = end = len(data)
    while end > max(0, len(data) - _TAIL_BYTES):
        start = data.rfind(b"e", 0, end - 1) + 1
        frame = b"\r\n" + data[start:end]
        if _is_frame(frame, not checked):
            break
        found = start if _is_frame(frame, checked) else found
        end = start
    return found


def _is_frame(data: bytes, checked: bool) -> bool:
    return any(isinstance(event, Frame) for event in FrameDecoder(REPLIES, checked).feed(data))
