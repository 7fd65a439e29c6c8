"""Frames and garbage in the bytes of a recording, each with its bytes."""

from typing import List, Optional, Tuple

from mrl_driver.protocol import REPLIES, REQUESTS_TO_ANY, Event, Frame, FrameDecoder, Garbage
from mrl_driver.protocol.directions import Direction

_OTHER_FORM = ("bad_check", "argument_count")
"""Garbage of these reasons may be a frame with a checksum, or without one, unlike the frames before it."""


class FrameReader:
    """Reads the frames of one direction, each with its own bytes."""

    def __init__(self, direction: Direction) -> None:
        self._direction = direction
        self._decoder = FrameDecoder(direction)

    def read(self, data: bytes, checked: Optional[bool], turned: bool) -> List[Tuple[Event, bytes]]:
        """Return what these bytes complete.

        `checked` says whether frames carry a checksum, None that they are as before; with `turned`, frames of the other
        form are accepted, and after the first one they are the rule.
        """
        decoder = self._decoder
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
        checked = not self._decoder.checked
        found = FrameDecoder(self._direction, checked).feed(garbage.data)
        if len(found) != 1 or not isinstance(found[0], Frame):
            return garbage
        self._decoder.checked = checked
        return found[0]


def requests() -> FrameReader:
    """A reader of what the host sent."""
    return FrameReader(REQUESTS_TO_ANY)


def replies() -> FrameReader:
    """A reader of what the board sent."""
    return FrameReader(REPLIES)
