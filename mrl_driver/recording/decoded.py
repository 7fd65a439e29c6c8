"""Frames and garbage in the bytes of a recording."""

import re
from typing import List, Optional, Tuple

from mrl_driver.protocol import Direction, Event, Frame, FrameDecoder, Garbage

LINE_BYTES = 12  # a line of the file takes about this many bytes besides its data
_OTHER_FORM = ("bad_check", "argument_count")
"""Garbage of these reasons may be a frame with a checksum, or without one, unlike the frames before it."""
_PIECE = re.compile(rb"[^e]*e\s*|[^e]+")


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
        for piece in _PIECE.findall(data):
            whole = decoder.pending + piece
            for event in decoder.feed(piece):
                if turned and isinstance(event, Garbage) and event.reason in _OTHER_FORM:
                    event = self._reread(event)
                if isinstance(event, Frame):
                    found.append((event, whole[whole.rindex(b"@") :].rstrip()))
                else:
                    found.append((event, event.data))
        return found

    def _reread(self, garbage: Garbage) -> Event:
        checked = not self.decoder.checked
        for event in FrameDecoder(self._direction, checked).feed(garbage.data):
            if isinstance(event, Frame):
                self.decoder.checked = checked
                return event
        return garbage
