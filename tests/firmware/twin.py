"""The firmware's decoder behind the interface of the Python one."""

import functools
from typing import Any, List

from mrl_driver.protocol import Event, Frame, Garbage
from mrl_driver.protocol.table import REASONS
from tests.firmware.pc_board import MEGA, load

FRAME, GARBAGE = 1, 2


@functools.lru_cache(maxsize=None)
def shared() -> Any:
    """The library that all decoders use, one after the other: that of the build that has all parameters."""
    return load(MEGA)


class TwinDecoder:
    """Feeds the C++ decoder and gives its events, garbage with the bytes that it counted."""

    def __init__(self, checked: bool = False, asked: bool = False, plain_calibrate: bool = False) -> None:
        self._native = shared()
        self._native.pc_decoder_start(int(checked), int(asked), int(plain_calibrate))
        self._seen = bytearray()

    def feed(self, data: bytes) -> List[Event]:
        events: List[Event] = []
        for byte in data:
            verdict = self._native.pc_decoder_feed(byte)
            if verdict == FRAME:
                events.append(self._frame())
                self._seen.clear()
            elif verdict == GARBAGE:
                events.append(self._garbage(byte))
            else:
                self._seen.append(byte)
        return events

    def _frame(self) -> Frame:
        count = self._native.pc_decoder_count()
        args = self._native.pc_decoder_arguments()
        return Frame(self._native.pc_decoder_code(), tuple(args[i] for i in range(count)))

    def _garbage(self, byte: int) -> Garbage:
        """A '@' or a line end completes what stood before it; any other byte is part of the garbage."""
        reason = REASONS[self._native.pc_decoder_reason()].name
        length = self._native.pc_decoder_length()
        outside = byte in b"@\r\n" and reason in ("noise", "restarted")
        if not outside:
            self._seen.append(byte)
        data = bytes(self._seen[len(self._seen) - length :])
        self._seen[:] = bytes([byte]) if outside else b""
        return Garbage(data, reason)
