"""The board's side of its radio module: requests become packets, and packets become frames for the host.

It behaves as `firmware/mrl_firmware/src/radio/xbee.cpp`; the reasons are there.
"""

import math
import struct
from typing import Callable, NamedTuple, Optional, Tuple

from mrl_driver.protocol.frames import to_int16
from sim_arduino.hardware.xbee import (
    AT_COMMAND,
    AT_RESPONSE,
    RECEIVED,
    TRANSMIT,
    TRANSMIT_STATUS,
    UNKNOWN_NETWORK,
    PacketReader,
    XBee,
    packet,
)

from .radio_hold import RadioHold
from .uart import Outgoing, Ring

BYTE_S = 10 / 9615.0  # time of a byte to the module [s]; the board's real baud rate is 9615
MODULE_BYTE_S = 10 / 9600.0  # time of a byte from the module [s]
QUEUE_BYTES = 64  # size of the queue to the module, and of that from it
LONGEST = 96  # longest data of a packet that is accepted [byte]
PIECE = 16  # longest text of one frame to the host [byte]
BROKEN_OFF_S = 0.048
FRAME_ID, NO_FRAME_ID = 1, 0
_ENVELOPE = 4
_DELIVERY, _STATUS_SIZE = 5, 7
_TEXT_AT, _NODE_SIZE, _NODE_AT = 12, 15, 5


class News(NamedTuple):
    """A text that the host has not got completely, or a node of a search that it has not got."""

    row: str
    address: int
    text: bytes = b""
    network: int = 0


class RadioPort:
    """The radio of a `PythonBoard`.

    Args:
        hold: Takes the hold texts.
        ask: Queues a frame to the host by its row; called only if `can_ask()`.
    """

    def __init__(
        self, xbee: XBee, hold: RadioHold, ask: Callable[[str], None], can_ask: Callable[[], bool]
    ) -> None:
        self._xbee, self.hold, self._ask, self._can_ask = xbee, hold, ask, can_ask
        self._out, self._in = Outgoing(), Outgoing()
        self._out.byte_s, self._in.byte_s = BYTE_S, MODULE_BYTE_S
        self._heard = Ring(QUEUE_BYTES)
        self._reader = PacketReader(LONGEST)
        self._waiting: Optional[News] = None
        self._asked = False

    # ---- to the module

    def send(self, address: int, text: bytes, now_s: float, frame_id: int = FRAME_ID) -> bool:
        """Sends a text; False if the module's line has no room for it.  The module reports a text with an id."""
        head = struct.pack(">BBQHBB", TRANSMIT, frame_id, address, UNKNOWN_NETWORK, 0, 0)
        return self._put(head + text, now_s)

    def discover(self, now_s: float) -> bool:
        """Starts a search for nodes; False if the module's line has no room for the command."""
        return self._put(bytes([AT_COMMAND, FRAME_ID]) + b"ND", now_s)

    def _put(self, data: bytes, now_s: float) -> bool:
        waiting = max(0, math.ceil((self._out.free_s - now_s) / BYTE_S) - 1)
        if QUEUE_BYTES - waiting < len(data) + _ENVELOPE:
            return False
        self._out.put(packet(data), now_s)
        return True

    # ---- from the module

    @property
    def next_s(self) -> float:
        """Time of the next event on the two lines [s]; may be infinite."""
        return min(self._out.next_s, self._in.next_s, self._xbee.next_s, self.hold.next_s)

    def run(self, now_s: float) -> None:
        """Moves the bytes on both lines to now, and takes the packets that are complete."""
        self._xbee.receive(self._out.take(now_s), now_s)
        if self._reader.in_packet and now_s - self._in.free_s > BROKEN_OFF_S:
            self._reader.clear()
        for data in self._xbee.take(now_s):
            self._in.put(data, now_s)
        for byte in self._in.take(now_s):
            self._heard.put(bytes([byte]))
            self._read(now_s)
        self.hold.run(now_s)
        self.serve_host(now_s)

    def gap(self, to_s: float) -> None:
        """The board's loop stood still until `to_s`: the queue keeps the bytes that fit, later ones are lost."""
        self._xbee.receive(self._out.take(to_s), to_s)
        for data in (self._in.take(to_s), *self._xbee.take(to_s)):
            self._heard.put(data)

    def serve_host(self, now_s: float) -> None:
        """Reads the next packet if the host has got the one before, and queues a frame for what is new."""
        self._read(now_s)
        for address, text in self.hold.answers():
            if not self.send(address, text, now_s, NO_FRAME_ID):
                self.hold.keep(address, text)
        if self._can_ask() and self.hold.take_news():
            self._ask("read_radio")
        if self._waiting is not None and not self._asked and self._can_ask():
            self._asked = True
            self._ask(self._waiting.row)

    def _read(self, now_s: float) -> None:
        while self._waiting is None:
            byte = self._heard.take()
            if byte is None:
                return
            for found in self._reader.feed(bytes([byte])):
                self._waiting = self._news(found, now_s)

    def _news(self, data: bytes, now_s: float) -> Optional[News]:
        """What is for the host in a packet."""
        if data[0] == RECEIVED and len(data) > _TEXT_AT:
            address, text = int.from_bytes(data[1:9], "big"), data[_TEXT_AT:]
            return None if self.hold.receive(address, text, now_s) else News("xbee_text", address, text)
        if data[0] == TRANSMIT_STATUS and len(data) >= _STATUS_SIZE and data[_DELIVERY]:
            self.hold.count_undelivered()
        if data[0] == AT_RESPONSE and len(data) >= _NODE_SIZE and data[2:5] == b"ND\0":
            network, node = struct.unpack_from(">HQ", data, _NODE_AT)
            return News("discover_xbee", node, network=network)
        return None

    # ---- the frames to the host

    def text(self) -> Optional[Tuple[int, ...]]:
        """Fields of `xbee_text`: the next piece of the text."""
        assert self._waiting
        address, piece, rest = self._waiting.address, self._waiting.text[:PIECE], self._waiting.text[PIECE:]
        self._waiting, self._asked = self._waiting._replace(text=rest) if rest else None, False
        padded = piece + b"\0" * (len(piece) % 2)
        return (*_words(address.to_bytes(8, "big")), len(piece), *_words(padded))

    def node(self) -> Optional[Tuple[int, ...]]:
        """Fields of the reply to `discover_xbee`."""
        assert self._waiting
        found, self._waiting, self._asked = self._waiting, None, False
        return (*_words(found.address.to_bytes(8, "big")), to_int16(found.network))


def _words(data: bytes) -> Tuple[int, ...]:
    return struct.unpack(f">{len(data) // 2}h", data)
