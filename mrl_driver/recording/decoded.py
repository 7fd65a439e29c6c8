"""Frames and garbage in the bytes of a recording.

Summaries and calibrations read a whole recording with `decode`: faster than `driver.recorded`, and without what
listeners of the driver get.  Memory does not grow with the file.
"""

from collections import deque
from typing import Deque, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.protocol import REPLIES, REQUESTS_TO_ANY, Direction, Event, Frame, FrameDecoder, Garbage

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
_OTHER_FORM = ("bad_check", "argument_count")
"""Garbage of these reasons may be a frame with a checksum, or without one, unlike the frames before it."""


class FrameReader:
    """Reads the frames of one direction, each with its own bytes."""

    def __init__(self, direction: Direction) -> None:
        self._direction = direction
        self.decoder = FrameDecoder(direction)

    def read(self, data: bytes, checked: Optional[bool], turned: bool) -> List[Tuple[Event, bytes]]:
        """Return what these bytes complete.

        `checked` says whether frames carry a checksum, None that they are as before; with `turned`, frames of the other
        form are accepted, and after the first one they are the rule.
        """
        decoder = self.decoder
        decoder.checked = decoder.checked if checked is None else checked
        found: List[Tuple[Event, bytes]] = []
        *pieces, rest = data.split(b"e")
        for piece in [*(piece + b"e" for piece in pieces), rest]:
            whole = decoder.pending + piece
            for event in decoder.feed(piece):
                if isinstance(event, Garbage) and turned and event.reason in _OTHER_FORM:
                    event = self._reread(event)
                if isinstance(event, Garbage):
                    found.append((event, event.data))
                else:
                    found.append((event, whole[whole.rfind(b"@") :]))
        return found

    def _reread(self, garbage: Garbage) -> Event:
        checked = not self.decoder.checked
        found = FrameDecoder(self._direction, checked).feed(garbage.data)
        if len(found) != 1 or not isinstance(found[0], Frame):
            return garbage
        self.decoder.checked = checked
        return found[0]


class DecodedPart(NamedTuple):
    """An entry, and the frames and garbage that it completes; a remark has none."""

    time_s: float
    direction: str
    data: bytes
    events: List[Event]


def decode(recording: Recording) -> Iterator[DecodedPart]:
    """Decode a whole recording; a remark on checksums comes before the first reply that it applies to."""
    readers, size = _readers(), 0
    held: Deque[Entry] = deque()
    for entry in recording:
        _, direction, data = entry
        if direction != REMARK:
            held.append(entry)
            size += _size(entry)
            while size - _size(held[0]) >= HELD_BYTES:
                size -= _size(held[0])
                yield _decoded(held.popleft(), readers)
            continue
        if data in (CHECKED, PLAIN):
            yield from _switch(held, entry, readers)
        elif data.startswith(OPENED):
            yield from [_decoded(each, readers) for each in (*held, entry)]
            readers = _readers()
        elif data.startswith((MODEL, POSE, SESSION)):
            held.append(entry)
            continue
        else:
            continue
        held.clear()
        size = 0
    yield from [_decoded(each, readers) for each in held]


def _size(entry: Entry) -> int:
    """Return the bytes of the file that an entry stands for; a remark does not count."""
    return 0 if entry.direction == REMARK else len(entry.data) + LINE_BYTES


def _readers() -> Dict[str, FrameReader]:
    return {TO_BOARD: FrameReader(REQUESTS_TO_ANY), FROM_BOARD: FrameReader(REPLIES)}


def _decoded(entry: Entry, readers: Dict[str, FrameReader], turned: bool = False) -> DecodedPart:
    """Decode an entry; with `turned`, the board's frames may be of the other form, see `FrameReader.read`."""
    if entry.direction == REMARK:
        events: List[Event] = []
    elif turned and entry.direction == FROM_BOARD:
        events = [event for event, _ in readers[FROM_BOARD].read(entry.data, None, True)]
    else:
        events = readers[entry.direction].decoder.feed(entry.data)
    return DecodedPart(*entry, events)


def _switch(held: Sequence[Entry], remark: Entry, readers: Dict[str, FrameReader]) -> List[DecodedPart]:
    """Decode the entries before a remark on checksums; it comes before the entry with the first frame of its form."""
    decoder, checked = readers[FROM_BOARD].decoder, remark.data == CHECKED
    parts, place = [], len(held)
    for number, entry in enumerate(held):
        turned = decoder.checked != checked
        parts.append(_decoded(entry, readers, turned))
        if turned and decoder.checked == checked:
            place = number
    decoder.checked = readers[TO_BOARD].decoder.checked = checked
    return [*parts[:place], _decoded(remark, readers), *parts[place:]]
