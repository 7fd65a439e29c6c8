"""A radio module: an XBee Series 2 with the ZB firmware in API mode 1, as a board sees it on its serial line.

Packets of API mode 1 (delimiter, length, data, checksum; no escapes) and AT commands: Digi 90000976, chapters API
Operation and XBee Command Reference Tables.  The module's own computing time is not known and counts as nothing.  The
line's speed is that of the board's wires: `BAUD`.
"""

import heapq
import itertools
import math
import random
import struct
import zlib
from typing import Any, Callable, Iterator, List, NamedTuple, Optional, Set, Tuple

from sim_arduino.world.radio import DISCOVERY_S, Delivery, Place, RadioMedium, RadioPacket, Station

DELIMITER = 0x7E
LONGEST_PACKET = 0x100  # packets with more data are not accepted as such [byte]
AT_COMMAND, TRANSMIT, AT_RESPONSE, TRANSMIT_STATUS, RECEIVED = 0x08, 0x10, 0x88, 0x8B, 0x90
"""Types of packets: the first byte of their data."""
BAUD = 9600  # factory setting, and that of the board
BROADCAST = 0xFFFF  # 64-bit address of all radios
LOWEST_ADDRESS = 0x10000  # first 64-bit address that a module can have here
DIGI = 0x0013A200  # first half of the addresses of all XBee modules
UNKNOWN_NETWORK = 0xFFFE
LONGEST_TEXT = 84  # NP of a module without encryption [byte]
LONGEST_NODE = 20
OK, ERROR, INVALID_COMMAND, INVALID_PARAMETER = 0, 1, 2, 3  # status of an AT command's response
DELIVERED, NO_ACKNOWLEDGEMENT, SELF_ADDRESSED, ADDRESS_NOT_FOUND, TEXT_TOO_LONG = 0x00, 0x21, 0x23, 0x24, 0x74
"""Delivery status."""
ACKNOWLEDGED, BROADCASTED = 0x01, 0x02  # options of a received packet
_NO_DISCOVERY, _ADDRESS_DISCOVERY = 0x00, 0x01
_NO_PARENT, _ROUTER, _PROFILE, _MANUFACTURER = 0xFFFE, 1, 0xC105, 0x101E
_LARGEST_NETWORK = 0xFFF7
_TEXT_AT = 14


def packet(data: bytes) -> bytes:
    """The packet with this data."""
    return bytes([DELIMITER]) + len(data).to_bytes(2, "big") + data + bytes([0xFF - sum(data) % 256])


class PacketReader:
    """Finds packets with a right checksum in bytes; `longest` is the length of the longest data accepted [byte]."""

    def __init__(self, longest: int = LONGEST_PACKET) -> None:
        self._longest = longest
        self._data = bytearray()

    @property
    def in_packet(self) -> bool:
        """Whether a packet has begun and is not complete."""
        return bool(self._data)

    def clear(self) -> None:
        """Looks for the next delimiter."""
        self._data.clear()

    def feed(self, data: bytes) -> Iterator[bytes]:
        """The data of the packets that these bytes complete."""
        for byte in data:
            if self._data or byte == DELIMITER:
                self._data.append(byte)
            size = int.from_bytes(self._data[1:3], "big")
            if len(self._data) >= 3 and not 0 < size <= self._longest:
                self._data.clear()
            elif len(self._data) >= 3 and len(self._data) == size + 4:
                found = bytes(self._data[3:-1])
                self._data.clear()
                if (sum(found) + byte) & 0xFF == 0xFF:
                    yield found


class RadioFit(NamedTuple):
    """A radio to fit to a robot."""

    address: Optional[int] = None  # 64-bit address; None makes one of the robot's name
    range_m: float = math.inf  # largest distance at which it receives others and they receive it [m]
    loss: float = 0.0  # share of the radio packets that it does not receive


def address_for(robot: str) -> int:
    """The 64-bit address of a robot's radio if none is given: Digi's number, and a checksum of the robot's name."""
    return DIGI << 32 | zlib.crc32(robot.encode())


class XBee:
    """A module on a robot; it joins the `medium`, and raises ConfigError if another radio has its address.

    The robot's name is the first node identifier, `place` returns where the robot is [m], and `seed` draws losses and
    waits, together with the address.
    """

    def __init__(
        self, medium: RadioMedium, robot: str, fit: RadioFit, place: Callable[[], Place], seed: int = 0
    ) -> None:
        address = address_for(robot) if fit.address is None else fit.address
        network = zlib.crc32(address.to_bytes(8, "big")) % _LARGEST_NETWORK + 1
        self.station = Station(address, network, robot[:LONGEST_NODE], robot, fit.range_m, fit.loss)
        """The module as other radios know it."""
        self._medium, self.place = medium, place
        self._rng = random.Random(f"radio {seed} {address}")
        self._reader = PacketReader()
        self._due: List[Tuple[float, int, bytes]] = []
        self._numbers = itertools.count()
        self._met: Set[int] = set()
        self.live = False  # the board runs in real time: packets of other boards arrive by its own clock
        self.on_arrival: Callable[[], None] = lambda: None
        """Called when a packet has arrived, from any thread."""
        self.now_s = 0.0  # time of the board [s]
        medium.join(self)

    def close(self) -> None:
        """Leaves the air."""
        self._medium.leave(self)

    # ---- the air

    def set(self, **values: Any) -> None:
        """Sets `range_m` [m], `loss` (a share) or `cut` (True: it neither sends nor receives)."""
        self.station = self.station._replace(**values)
        self._medium.changed(self)

    def arrive(self, packet: RadioPacket, sent_s: float, delay_s: float) -> None:
        """A packet arrives; `sent_s` is a time of the sender's clock, and of this board's unless it is `live`."""
        if self.station.cut:
            return
        options = BROADCASTED if packet.broadcast else ACKNOWLEDGED
        head = struct.pack(">BQHB", RECEIVED, packet.source, packet.network, options)
        self._met.add(packet.source)
        self._say((self.now_s if self.live else sent_s) + delay_s, head + packet.text)
        self.on_arrival()

    def fileno(self) -> Optional[int]:
        """A descriptor that is readable when packets of other processes wait, if they can come."""
        return self._medium.fileno(self)

    def poll(self) -> None:
        """Takes the packets of other processes."""
        self._medium.poll(self)

    # ---- the board

    def receive(self, data: bytes, at_s: float) -> None:
        """Bytes from the board; the last one arrived at `at_s` [s]."""
        self.now_s = max(self.now_s, at_s)
        for found in self._reader.feed(data):
            if found[0] == AT_COMMAND and len(found) >= 4:
                self._command(found[1], found[2:4], found[4:])
            elif found[0] == TRANSMIT and len(found) >= _TEXT_AT:
                self._transmit(found[1], int.from_bytes(found[2:10], "big"), found[_TEXT_AT:])

    @property
    def next_s(self) -> float:
        """Time at which the next packet to the board begins [s]; may be infinite."""
        return self._due[0][0] if self._due else math.inf

    def take(self, to_s: float) -> List[bytes]:
        """Packets whose way to the board begins until `to_s` [s]."""
        self.now_s = max(self.now_s, to_s)
        out = []
        while self._due and self._due[0][0] <= to_s:
            out.append(heapq.heappop(self._due)[2])
        return out

    def _say(self, at_s: float, data: bytes) -> None:
        heapq.heappush(self._due, (at_s, next(self._numbers), packet(data)))

    # ---- texts

    def _transmit(self, frame: int, to: int, text: bytes) -> None:
        now_s, known = self.now_s, to in self._met
        if len(text) > LONGEST_TEXT:
            self._report(frame, now_s, UNKNOWN_NETWORK, 0, TEXT_TOO_LONG)
        elif to == self.station.address:
            self._report(frame, now_s, UNKNOWN_NETWORK, 0, SELF_ADDRESSED)
        elif to == BROADCAST:
            delay_s = self._medium.broadcast(self, text, now_s, self._rng)
            self._report(frame, now_s + delay_s, UNKNOWN_NETWORK, 0, DELIVERED)
        else:
            sent = self._medium.unicast(self, to, text, now_s, self._rng)
            self._report_unicast(frame, to, sent, known)

    def _report_unicast(self, frame: int, to: int, sent: Delivery, known: bool) -> None:
        """Reports the fate of a text.  To a module that was never met, a failure is an address not found."""
        network, status = UNKNOWN_NETWORK, ADDRESS_NOT_FOUND
        if sent.acknowledged and sent.to:
            network, status = sent.to.network, DELIVERED
            self._met.add(to)
        elif sent.to or known:
            status = NO_ACKNOWLEDGEMENT
        discovery = _NO_DISCOVERY if known else _ADDRESS_DISCOVERY
        self._report(frame, self.now_s + sent.delay_s, network, sent.retries, status, discovery)

    def _report(
        self, frame: int, at_s: float, network: int, retries: int, status: int, discovery: int = _NO_DISCOVERY
    ) -> None:
        """Says how a text was delivered, unless the board did not ask for it: frame id 0."""
        if frame:
            self._say(
                at_s, struct.pack(">BBHBBB", TRANSMIT_STATUS, frame, network, retries, status, discovery)
            )

    # ---- AT commands

    def _command(self, frame: int, name: bytes, value: bytes) -> None:
        if name == b"ND":
            self._discover(frame, value)
            return
        own = self.station
        values = {
            b"SH": struct.pack(">I", own.address >> 32),
            b"SL": struct.pack(">I", own.address & 0xFFFFFFFF),
            b"MY": struct.pack(">H", own.network),
            b"NI": own.node.encode(),
        }
        if name not in values:
            self._respond(frame, name, INVALID_COMMAND)
        elif not value:
            self._respond(frame, name, OK, values[name])
        elif name == b"NI" and len(value) <= LONGEST_NODE and value.isascii():
            self.station = own._replace(node=value.decode())
            self._medium.changed(self)
            self._respond(frame, name, OK)
        else:
            self._respond(frame, name, INVALID_PARAMETER)

    def _discover(self, frame: int, wanted: bytes) -> None:
        """One response for each node, and no packet at the end; an error if a node is wanted that does not answer."""
        found = self._medium.discover(self, self._rng)
        found = [each for each in found if wanted in (b"", each.station.node.encode())]
        for (address, network, node, *_), delay_s in found:
            data = struct.pack(">HQ", network, address) + node.encode() + b"\0"
            data += struct.pack(">HBBHH", _NO_PARENT, _ROUTER, 0, _PROFILE, _MANUFACTURER)
            self._respond(frame, b"ND", OK, data, delay_s)
        if wanted and not found:
            self._respond(frame, b"ND", ERROR, b"", DISCOVERY_S)

    def _respond(self, frame: int, name: bytes, status: int, data: bytes = b"", delay_s: float = 0.0) -> None:
        if frame:
            self._say(self.now_s + delay_s, bytes([AT_RESPONSE, frame]) + name + bytes([status]) + data)
