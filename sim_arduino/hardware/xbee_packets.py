"""Packets of an XBee's API mode 1: delimiter, length, data, checksum; no escapes (Digi 90000976, API Operation)."""

from typing import Iterator

DELIMITER = 0x7E
LONGEST = 0x100  # packets with more data are not accepted as such [byte]

AT_COMMAND, TRANSMIT, AT_RESPONSE, TRANSMIT_STATUS, RECEIVED = 0x08, 0x10, 0x88, 0x8B, 0x90
"""Types of packets: the first byte of their data."""


def packet(data: bytes) -> bytes:
    """The packet with this data."""
    return bytes([DELIMITER]) + len(data).to_bytes(2, "big") + data + bytes([0xFF - sum(data) % 256])


class PacketReader:
    """Finds packets with a right checksum in bytes; `longest` is the length of the longest data accepted [byte]."""

    def __init__(self, longest: int = LONGEST) -> None:
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
