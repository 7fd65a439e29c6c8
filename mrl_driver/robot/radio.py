"""Texts and nodes of the board's XBee radio: frames 38 to 40 to values and back, and texts that wait.  Pure."""

import math
import re
from collections import deque
from typing import Deque, NamedTuple, Optional, Sequence, Tuple, Union

from mrl_driver.arguments import require_kind, require_whole
from mrl_driver.errors import FrameError, MrlError
from mrl_driver.protocol.frames import Frame, to_int16
from mrl_driver.protocol.table import BY_NAME

CAPABILITY = "xbee"
TEXT_BYTES = 16
BROADCAST = 0xFFFF  # address of all radios in range
DISCOVERY_S = 6.5
"""Time of a search [s]: an XBee waits 6 s for the answers of other radios (its parameter NT is 60 at first)."""
NO_ANSWER = (
    "no other radio has answered; check that they are on and belong to the same network (PAN), and that this board's "
    "XBee is in API mode 1 (its parameter AP is 1, not 2) at 9600 baud"
)
TEXT_IN, TEXT_OUT, SEARCH = (BY_NAME[name].code for name in ("xbee_text", "send_xbee", "discover_xbee"))
LINE_BAUD = 9600  # baud rate between board and XBee [Bd]
PACKET_BYTES = 18
"""Bytes of a transmit request without its text: delimiter, length, type, frame id, two addresses, two options, sum."""
WAITING = 16  # at most this many texts wait for the radio's line
OLDEST_S = 1.0
"""A text that has waited this long is dropped [s], because its receiver would take it for a new one."""
Request = Tuple[int, ...]


class RadioText(NamedTuple):
    """A text, and the 64-bit address of the other radio."""

    address: int
    data: bytes

    @property
    def text(self) -> str:
        """The text for people; bytes that are not ASCII as `\\xf8`."""
        return self.data.decode("ascii", "backslashreplace")


class RadioNode(NamedTuple):
    """A radio that has answered a search: its 64-bit address, and the 16-bit address that the network gave it."""

    address: int
    network: int


def format_address(address: int) -> str:
    """An address as 16 hexadecimal digits, such as `0013a20040a1b2c3`."""
    return f"{address:016x}"


def parse_address(text: str) -> int:
    """The address of a text: at most 16 hexadecimal digits; raise FrameError if it is something else."""
    if not re.fullmatch("(0[xX])?[0-9a-fA-F]{1,16}", text, re.ASCII):
        raise FrameError(
            f"radio address is {text!r}, expected a 64-bit address in hexadecimal, such as 0013a20040a1b2c3"
        )
    return int(text, 16)


def text_request(address: int, text: Union[str, bytes]) -> Request:
    """The request that sends a text of ASCII characters, or of any bytes.

    FrameError if the address is not valid, or the text is empty, too long or not ASCII; the message says which.
    """
    address = require_whole("radio address", address, FrameError)
    if not 0 <= address < 1 << 64:
        raise FrameError(f"radio address is {address}, expected a number from 0 to 2**64 - 1")
    require_kind("radio text", text, (str, bytes), f"1 to {TEXT_BYTES} ASCII characters or bytes", FrameError)
    if not 0 < len(text) <= TEXT_BYTES or not text.isascii() and isinstance(text, str):
        raise FrameError(f"radio text is {text!r}, expected 1 to {TEXT_BYTES} ASCII characters or bytes")
    data = text.encode("ascii") if isinstance(text, str) else text
    words = [to_int16(address >> shift & 0xFFFF) for shift in (48, 32, 16, 0)]
    padded = data + b"\0" * (len(data) % 2)
    texts = [to_int16(padded[i] << 8 | padded[i + 1]) for i in range(0, len(padded), 2)]
    return (TEXT_OUT, *words, len(data), *texts)


def text_of(frame: Frame) -> Optional[RadioText]:
    """The text of a frame `xbee_text`; None for other frames."""
    if frame.code != TEXT_IN:
        return None
    length, words = frame.args[4], frame.args[5:]
    data = b"".join((word & 0xFFFF).to_bytes(2, "big") for word in words)
    return RadioText(address_of(frame.args[:4]), data[:length])


def node_of(frame: Frame) -> Optional[RadioNode]:
    """The node of a reply `discover_xbee`; None for other frames."""
    return RadioNode(address_of(frame.args[:4]), frame.args[4] & 0xFFFF) if frame.code == SEARCH else None


def address_of(words: Sequence[int]) -> int:
    """The 64-bit address in four words, the highest first."""
    address = 0
    for word in words:
        address = address << 16 | word & 0xFFFF
    return address


class RadioQueue:
    """Requests that wait for the line from board to XBee.

    The line is slower than the port, and the board refuses a text while it still sends the one before.
    """

    def __init__(self) -> None:
        self.due_s = math.inf  # when the next request may be sent [s]; infinity if none waits
        self.dropped = 0
        """Number of requests that waited for `OLDEST_S` and were not sent, because the board was silent."""
        self._waiting: Deque[Tuple[float, Request]] = deque()
        self._free_s = -math.inf

    def add(self, request: Request, now: float) -> None:
        """Let a request wait for its turn; raise MrlError if `WAITING` requests wait already."""
        if len(self._waiting) >= WAITING:
            raise MrlError(
                f"{WAITING} texts wait for the radio, which sends about 30 in a second; this one was not sent"
            )
        self._waiting.append((now, request))
        self.due_s = max(self._free_s, now)

    def take(self, now: float) -> Optional[Request]:
        """The request to send now, or None."""
        while self._waiting and now - self._waiting[0][0] > OLDEST_S:
            self._waiting.popleft()
            self.dropped += 1
        request = None
        if self._waiting and now >= self._free_s:
            request = self._waiting.popleft()[1]
            self._free_s = now + _line_s(request)
        self.due_s = self._free_s if self._waiting else math.inf
        return request


def _line_s(request: Request) -> float:
    """Time of a request's packet on the line to the XBee [s]."""
    return 10 * (PACKET_BYTES + (request[5] if request[0] == TEXT_OUT else 0)) / LINE_BAUD
