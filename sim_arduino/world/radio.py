"""The air between radios of the 802.15.4 kind: which radio receives which, how often a packet is sent, when it arrives.

A text takes one hop: the emulated radios do not pass texts on for others, as a real ZigBee network can.  The outcome
of a transmission is drawn when it begins.  Packets never collide.

Sources: "Digi ZB manual" is the manual of the XBee/XBee-PRO ZB modules, 90000976, chapter Transmission, Addressing and
Routing; "802.15.4" is IEEE 802.15.4-2003; "ZigBee" is the ZigBee specification 053474r17.
"""

import math
import random
from typing import Dict, List, NamedTuple, Optional, Protocol, Tuple

from mrl_driver.errors import ConfigError

Place = Tuple[float, float]

MAC_SENDS = 4
"""Times that a unicast packet is sent until the next radio acknowledges it (macMaxFrameRetries 3, 802.15.4)."""
ATTEMPTS, ATTEMPT_S = 3, 1.6
"""Times that a text is sent until its receiver acknowledges it, each with its own `MAC_SENDS`, and time between them
[s] (Digi ZB manual: two retries; 50 ms times NH, 30, and 100 ms)."""
BROADCAST_SENDS, BROADCAST_PAUSE_S = 3, 0.5
"""Times that a broadcast is sent (Digi ZB manual), and time between them [s] (nwkPassiveAckTimeout, ZigBee)."""
DISCOVERY_S = 6.0
"""Time in which nodes answer a search [s]: NT is 60 times 100 ms; each waits for a random time (Digi, command NT)."""
BYTE_S = 8 / 250e3  # time of a byte in the air [s] (802.15.4, 2.4 GHz)
HEADERS = 6 + 11 + 24 + 8
"""Bytes around a text: PHY, MAC, network layer with 64-bit addresses, application layer (802.15.4, ZigBee)."""
BACKOFF_S, BACKOFFS = 320e-6, 7
"""A sender waits 0 to 7 of these before it listens whether the air is free [s] (macMinBE 3, 802.15.4)."""
ACK_S, ACK_WAIT_S = 192e-6 + 11 * BYTE_S, 864e-6
"""Time until an acknowledgement has come, and until it counts as missing [s] (802.15.4)."""


class Station(NamedTuple):
    """A radio as the others know it."""

    address: int  # 64-bit address
    network: int  # 16-bit network address
    node: str  # node identifier
    robot: str  # name of the robot that carries it
    range_m: float = math.inf  # largest distance at which it receives others and they receive it [m]
    loss: float = 0.0  # share of the packets that it does not receive
    cut: bool = False  # it neither sends nor receives


class RadioPacket(NamedTuple):
    """A text in the air, with the addresses of its sender."""

    source: int
    network: int
    broadcast: bool
    text: bytes


class Radio(Protocol):
    """A radio of this process."""

    @property
    def station(self) -> Station:
        """The radio as the others know it."""

    def place(self) -> Place:
        """Where it is [m]."""

    def arrive(self, packet: RadioPacket, sent_s: float, delay_s: float) -> None:
        """A packet that was sent at a time of the sender's clock arrives after this delay [s]."""


class Delivery(NamedTuple):
    """What a sender learns of its text."""

    to: Optional[Station]  # the receiver, if it exists and is in range
    acknowledged: bool
    """Whether the receiver acknowledged the text; without it, the text may have arrived all the same."""
    retries: int  # number of attempts after the first
    delay_s: float  # time from the beginning until the sender knows it [s]


class Found(NamedTuple):
    """A radio that answers a search, and the time until its answer is here [s]."""

    station: Station
    delay_s: float


class RadioMedium:
    """The radios of one process; radios of several threads may use it."""

    def __init__(self) -> None:
        self._radios: Dict[int, Radio] = {}

    # ---- the radios

    def join(self, radio: Radio) -> None:
        """Adds a radio; raises ConfigError if another radio has its address."""
        address = radio.station.address
        if self._radios.setdefault(address, radio) is not radio:
            raise ConfigError(f"radio address {address:016x} is taken already, expected another one")

    def leave(self, radio: Radio) -> None:
        """Removes a radio, if it is there."""
        self._radios.pop(radio.station.address, None)

    def changed(self, radio: Radio) -> None:
        """A radio has another range, loss or cut."""

    def fileno(self, radio: Radio) -> Optional[int]:
        """A descriptor that is readable when packets of other processes wait for a radio, if they can come."""

    def poll(self, radio: Radio) -> None:
        """Passes packets of other processes on to a radio."""

    def stations(self) -> List[Station]:
        """All radios."""
        return [radio.station for radio in list(self._radios.values())]

    def _place_of(self, station: Station) -> Optional[Place]:
        """Where a radio is [m], or None if nobody knows."""
        radio = self._radios.get(station.address)
        return radio.place() if radio else None

    def _deliver(self, station: Station, packet: RadioPacket, sent_s: float, delay_s: float) -> bool:
        """Passes a packet on to the radio of a station; False if it is not there any more."""
        radio = self._radios.get(station.address)
        if radio is not None:
            radio.arrive(packet, sent_s, delay_s)
        return radio is not None

    def in_reach(self, sender: Radio) -> List[Station]:
        """The radios that receive what a radio sends."""
        own, (x, y) = sender.station, sender.place()
        return [
            each
            for each in self.stations()
            if each.address != own.address and not own.cut and not each.cut and self._near(own, each, x, y)
        ]

    def _near(self, own: Station, other: Station, x: float, y: float) -> bool:
        range_m = min(own.range_m, other.range_m)
        if math.isinf(range_m):
            return True
        place = self._place_of(other)
        return place is not None and math.hypot(place[0] - x, place[1] - y) <= range_m

    # ---- transmissions

    def unicast(self, sender: Radio, to: int, text: bytes, at_s: float, rng: random.Random) -> Delivery:
        """Sends a text to one radio: up to `ATTEMPTS` times, until an acknowledgement of the receiver is back.

        If only the acknowledgement was lost, the text arrives more than once; XBee modules do not filter that (Digi
        90001539, Transmit mode).
        """
        own = sender.station
        other = next((each for each in self.in_reach(sender) if each.address == to), None)
        if other is None:
            return Delivery(None, False, ATTEMPTS - 1, ATTEMPTS * ATTEMPT_S)
        packet = RadioPacket(own.address, own.network, False, text)
        for attempt in range(ATTEMPTS):
            start_s = attempt * ATTEMPT_S
            arrived_s, ended_s = _hop(start_s, len(text), own.loss, other.loss, rng)
            if arrived_s is None or not self._deliver(other, packet, at_s, arrived_s):
                continue
            back_s, _ = _hop(ended_s, 0, other.loss, own.loss, rng)
            if back_s is not None and back_s < start_s + ATTEMPT_S:
                return Delivery(other, True, attempt, back_s)
        return Delivery(other, False, ATTEMPTS - 1, ATTEMPTS * ATTEMPT_S)

    def broadcast(self, sender: Radio, text: bytes, at_s: float, rng: random.Random) -> float:
        """Sends a text to all radios in range; returns the time that the sending takes [s]."""
        own = sender.station
        packet = RadioPacket(own.address, own.network, True, text)
        sends = _broadcast_times(len(text), rng)
        for other in self.in_reach(sender):
            received_s = _first_received(sends, other.loss, rng)
            if received_s is not None:
                self._deliver(other, packet, at_s, received_s)
        return sends[-1]

    def discover(self, sender: Radio, rng: random.Random) -> List[Found]:
        """Searches for radios; each one that receives it and whose answer comes back is one item."""
        own, found = sender.station, []
        sends = _broadcast_times(0, rng)
        for other in self.in_reach(sender):
            received_s = _first_received(sends, other.loss, rng)
            if received_s is None:
                continue
            asked_s = received_s + rng.uniform(0.0, DISCOVERY_S)
            back_s, _ = _hop(asked_s, len(other.node), other.loss, own.loss, rng)
            if back_s is not None and back_s < DISCOVERY_S:
                found.append(Found(other, back_s))
        return found


def _on_air_s(size: int, rng: random.Random) -> float:
    """Time to send a packet with this many bytes of text, with a random wait before it [s]."""
    return rng.randint(0, BACKOFFS) * BACKOFF_S + (HEADERS + size) * BYTE_S


def _hop(
    start_s: float, size: int, loss: float, loss_there: float, rng: random.Random
) -> Tuple[Optional[float], float]:
    """Sends one packet until it is acknowledged: when it arrived, if it did, and when its sender stopped [s].

    `loss` is that of the sender.
    """
    arrived_s, now_s = None, start_s
    for _ in range(MAC_SENDS):
        now_s += _on_air_s(size, rng)
        if rng.random() >= loss_there:
            arrived_s = now_s if arrived_s is None else arrived_s
            if rng.random() >= loss:
                return arrived_s, now_s + ACK_S
        now_s += ACK_WAIT_S
    return arrived_s, now_s


def _broadcast_times(size: int, rng: random.Random) -> List[float]:
    """Times at which the sends of a broadcast have arrived [s]."""
    return [n * BROADCAST_PAUSE_S + _on_air_s(size, rng) for n in range(BROADCAST_SENDS)]


def _first_received(sends: List[float], loss: float, rng: random.Random) -> Optional[float]:
    return next((at_s for at_s in sends if rng.random() >= loss), None)
