"""Reads Intel HEX, the format of packaged firmware."""

from typing import List, Tuple

_DATA, _END, _SEGMENT, _START_SEGMENT, _LINEAR, _START_LINEAR = range(6)


def read(text: str) -> List[Tuple[int, bytes]]:
    """`(address, bytes)` pieces, in the order of the file.

    Raises:
        ValueError: a line is not a record, its checksum is wrong, or the record that ends the file is missing.
    """
    pieces: List[Tuple[int, bytes]] = []
    base = 0
    for number, line in enumerate(text.split(), 1):
        record = bytes.fromhex(line[1:]) if line[:1] == ":" else b""
        if len(record) < 5 or len(record) != record[0] + 5 or sum(record) & 0xFF:
            raise ValueError(f"line {number} is {line[:44]!r}, expected a record with its checksum")
        address, kind, data = int.from_bytes(record[1:3], "big"), record[3], record[4:-1]
        if kind == _END:
            return pieces
        if kind == _DATA:
            pieces.append((base + address, data))
        elif kind in (_SEGMENT, _LINEAR):
            base = int.from_bytes(data, "big") << (4 if kind == _SEGMENT else 16)
    raise ValueError("the record that ends the file is missing")
