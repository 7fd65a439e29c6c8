"""The board's side of its radio module: requests become packets, packets become frames for the host, and other robots
may hold this one.

It behaves as `xbee.cpp` and `hold.cpp` in `firmware/mrl_firmware/src/radio`; the reasons are there.
"""

import math
import struct
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple

from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.hold_text import HoldText, is_newer
from mrl_driver.protocol.table import HOLD_STATES, INT16_MAX, MOST_HOLDERS, TICK_S
from sim_arduino.hardware import xbee

from .parameter_store import Config
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
UNIT_S = 1563 * TICK_S  # one count of parameter 26 [s]: 100 ms in whole ticks
_STATE = {name: row for row, (name, _) in enumerate(HOLD_STATES)}
_ANSWER = {"hold": "held", "free": "freed"}


class Holder:
    """A radio that has sent a hold text.  It stays known after its hold, so that an old text cannot hold the robot."""

    def __init__(self, answer: HoldText) -> None:
        self.answer = answer  # what the board answers: the last text with an effect
        self.heard_s = 0.0  # time of that text [s]
        self.holds = self.silent = False  # a silent holder was not heard for the time of parameter 26

    def is_good(self, text: HoldText) -> bool:
        """Whether a text has an effect: it is newer, or repeats the last one or its end."""
        if text.number != self.answer.number:
            return is_newer(text.number, self.answer.number)
        return self.holds or text.kind == "free"


class RadioHold:
    """Robots that hold this one since the board's last start.  Nothing here turns a motor.

    `stop` stops the motors; `started_s` is the time of the start [s].
    """

    def __init__(self, config: Config, stop: Callable[[], None], started_s: float) -> None:
        self._config, self._stop, self._started_s = config, stop, started_s
        self._listening = self.on
        self._holders: Dict[int, Holder] = {}
        self._waiting: Dict[int, bytes] = {}
        self._ignored = self.undelivered = 0
        """Numbers of texts without effect, and of those that reached no radio."""
        self._told = self._changed = False

    @property
    def on(self) -> bool:
        """Whether other robots may hold this one."""
        return self._config["radio_hold"] > 0

    @property
    def _silence_s(self) -> float:
        return self._config["radio_hold"] * UNIT_S

    @property
    def held(self) -> bool:
        """Whether moves are refused."""
        return self._listening or any(holder.holds for holder in self._holders.values())

    @property
    def next_s(self) -> float:
        """Time of the next call of `run` [s]."""
        if not self.on:
            return -math.inf if self._holders or self._listening else math.inf
        times = [each.heard_s for each in self._holders.values() if each.holds and not each.silent]
        times += [self._started_s] * self._listening
        return min(times, default=math.inf) + self._silence_s

    def run(self, now_s: float) -> None:
        """Notes which holders are silent."""
        if not self.on:
            changed = self.held
            self._holders.clear()
            self._listening = False
        else:
            changed = self._listening
            self._listening = self._listening and now_s < self._started_s + self._silence_s
            changed = changed and not self._listening
            for holder in self._holders.values():
                if holder.holds and not holder.silent and now_s >= holder.heard_s + self._silence_s:
                    holder.silent = changed = True
        self._changed = self._changed or changed

    def take_news(self) -> bool:
        """Whether the state has changed since the last call, and the host has asked for it before."""
        news = self._told and self._changed
        if news:
            self._changed = False
        return news

    def receive(self, address: int, data: bytes, now_s: float) -> bool:
        """Takes a received text; False if it is not a hold text or holds are off, so that it is for the host."""
        text = HoldText.parse(data)
        if not self.on or text is None or text.kind not in _ANSWER:
            return False
        answer = HoldText(_ANSWER[text.kind], text.number)
        known = address in self._holders
        if not known and not self._make_room():
            self._count_ignored()
            return True
        holder = self._holders.setdefault(address, Holder(answer))
        if holder.is_good(text) if known else text.kind == "hold":
            holder.answer = answer
            self._apply(holder, text.kind == "hold", now_s)
        else:
            self._count_ignored()
        self._waiting[address] = holder.answer.data
        return True

    def answers(self) -> List[Tuple[int, bytes]]:
        """The texts to send and the addresses of their radios; each is returned once."""
        waiting, self._waiting = self._waiting, {}
        return list(waiting.items())

    def keep(self, address: int, data: bytes) -> None:
        """Keeps a text for which there was no room, unless there is a newer one."""
        self._waiting.setdefault(address, data)

    def release(self) -> int:
        """Drops the silent holders; 1 if another robot still holds this one, otherwise 0."""
        self._holders = {address: each for address, each in self._holders.items() if not each.silent}
        self._changed = True
        return int(self.held)

    def count_undelivered(self) -> None:
        """Counts a text that reached no radio."""
        self.undelivered = min(INT16_MAX, self.undelivered + 1)
        self._changed = True

    def report(self) -> Tuple[int, ...]:
        """The fields of the reply to `read_radio`."""
        self._told, self._changed = True, False
        holding = {address: each for address, each in self._holders.items() if each.holds}
        silent = [address for address, each in holding.items() if each.silent]
        state = "free" if self.on else "off"
        if holding:
            state = "silent" if silent else "held"
        elif self._listening:
            state = "listening"
        address = silent[0] if silent else next(reversed(list(holding)), 0)
        words = _words(address.to_bytes(8, "big"))
        return (_STATE[state], len(holding), self._ignored, self.undelivered, *words)

    def _make_room(self) -> bool:
        """Whether a new radio finds a place; one whose hold has ended gives way."""
        if len(self._holders) + self._listening < MOST_HOLDERS:
            return True
        ended = next((address for address, each in self._holders.items() if not each.holds), None)
        if ended is not None:
            del self._holders[ended]
        return ended is not None

    def _apply(self, holder: Holder, holds: bool, now_s: float) -> None:
        self._changed = self._changed or holder.silent or holder.holds != holds
        holder.holds, holder.silent, holder.heard_s = holds, False, now_s
        if holds:
            self._stop()

    def _count_ignored(self) -> None:
        self._ignored = min(INT16_MAX, self._ignored + 1)


class News(NamedTuple):
    """A text that the host has not got completely, or a node of a search that it has not got."""

    row: str
    address: int
    text: bytes = b""
    network: int = 0


class RadioPort:
    """The radio of a `PythonBoard`; `ask` queues a frame to the host by its row, and is called only if `can_ask()`."""

    def __init__(
        self, module: xbee.XBee, hold: RadioHold, ask: Callable[[str], None], can_ask: Callable[[], bool]
    ) -> None:
        self._xbee, self.hold, self._ask, self._can_ask = module, hold, ask, can_ask
        self._out, self._in = Outgoing(), Outgoing()
        self._out.byte_s, self._in.byte_s = BYTE_S, MODULE_BYTE_S
        self._heard = Ring(QUEUE_BYTES)
        self._reader = xbee.PacketReader(LONGEST)
        self._waiting: Optional[News] = None
        self._asked = False

    # ---- to the module

    def send(self, address: int, text: bytes, now_s: float, frame_id: int = FRAME_ID) -> bool:
        """Sends a text; False if the module's line has no room for it.  The module reports a text with an id."""
        head = struct.pack(">BBQHBB", xbee.TRANSMIT, frame_id, address, xbee.UNKNOWN_NETWORK, 0, 0)
        return self._put(head + text, now_s)

    def discover(self, now_s: float) -> bool:
        """Starts a search for nodes; False if the module's line has no room for the command."""
        return self._put(bytes([xbee.AT_COMMAND, FRAME_ID]) + b"ND", now_s)

    def _put(self, data: bytes, now_s: float) -> bool:
        waiting = max(0, math.ceil((self._out.free_s - now_s) / BYTE_S) - 1)
        if QUEUE_BYTES - waiting < len(data) + _ENVELOPE:
            return False
        self._out.put(xbee.packet(data), now_s)
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
        if data[0] == xbee.RECEIVED and len(data) > _TEXT_AT:
            address, text = int.from_bytes(data[1:9], "big"), data[_TEXT_AT:]
            return None if self.hold.receive(address, text, now_s) else News("xbee_text", address, text)
        if data[0] == xbee.TRANSMIT_STATUS and len(data) >= _STATUS_SIZE and data[_DELIVERY]:
            self.hold.count_undelivered()
        if data[0] == xbee.AT_RESPONSE and len(data) >= _NODE_SIZE and data[2:5] == b"ND\0":
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
