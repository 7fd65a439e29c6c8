"""Reads an image for the simulated chip: flash, EEPROM and symbols from an AVR ELF file, or flash from Intel HEX.

Neither pyelftools nor intelhex: the emulator runs in `sim.launch` with what a robot's Debian has, and three tables of
one kind of ELF are less code than an extra that may be missing.
"""

import struct
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Tuple

from mrl_driver.errors import SimulatorError
from mrl_driver.files import read_plain

from . import intel_hex

DATA_BASE = 0x800000
EEPROM_BASE = 0x810000
FUSES_BASE = 0x820000

_HEADER = struct.Struct("<16sHHIIIIIHHHHHH")
_SEGMENT = struct.Struct("<IIIIIIII")
_SECTION = struct.Struct("<IIIIIIIIII")
_SYMBOL = struct.Struct("<IIIBBH")
_MACHINE_AVR = 83
_ARCHITECTURE = 0x7F  # bits of the flags
_SEGMENT_LOAD = 1
_SECTION_SYMBOLS = 2
_LARGEST_SEGMENT = 1 << 18  # largest segment [byte]: the flash of the ATmega2560
_LONGEST = 1 << 24  # longest file [byte]; one with facts for debuggers has 1 MB
_LONGEST_NAME = 4096  # longest name of a symbol [byte]; those of C++ have hundreds
_MOST_ENTRIES = 256
"""An image has at most this many segments, and as many sections; those of avr-gcc have about twenty."""


class Symbol(NamedTuple):
    """A symbol of the image: address (in SRAM without the linker's offset of 0x800000) and size in bytes."""

    address: int
    size: int


class Image(NamedTuple):
    """An image's contents: `(address, bytes)` pieces of flash and EEPROM, and its symbols by name.

    `architecture` is avr-gcc's number of the chip's instruction set, such as 5 for avr5; 0 if unknown.
    """

    flash: List[Tuple[int, bytes]]
    eeprom: List[Tuple[int, bytes]]
    symbols: Dict[str, Symbol]
    architecture: int = 0


def read_image(path: Path) -> Image:
    """The image in an ELF file made by avr-gcc, or in an Intel HEX file, which has no symbols.

    Raises:
        SimulatorError: the file is missing or is neither.
    """
    try:
        raw = read_plain(str(path), _LONGEST)
    except OSError as error:
        reason = error.strerror or str(error)
        raise SimulatorError(f"firmware image {path}: {reason}, expected an ELF or Intel HEX file") from error
    try:
        if raw[:1] == b":":
            return Image(intel_hex.read(raw.decode("ascii", "replace")), [], {})
        return _parse(raw)
    except (struct.error, ValueError, IndexError) as error:
        raise SimulatorError(f"firmware image {path}: not an AVR ELF or Intel HEX file ({error})") from error


def _parse(raw: bytes) -> Image:
    header = _HEADER.unpack_from(raw)
    if header[0][:5] != b"\x7fELF\x01" or header[2] != _MACHINE_AVR:
        raise ValueError(f"starts with {raw[:5]!r}, machine {header[2]}")
    if max(header[10], header[12]) > _MOST_ENTRIES:
        raise ValueError(f"{header[10]} segments and {header[12]} sections")
    pieces = list(_loaded(raw, header))
    flash = [(address, data) for address, data in pieces if address < DATA_BASE]
    eeprom = [
        (address - EEPROM_BASE, data) for address, data in pieces if EEPROM_BASE <= address < FUSES_BASE
    ]
    return Image(flash, eeprom, dict(_symbols(raw, header)), header[7] & _ARCHITECTURE)


def _loaded(raw: bytes, header: Tuple) -> Iterator[Tuple[int, bytes]]:
    offset, entry_size, count = header[5], header[9], header[10]
    for index in range(count):
        kind, at, _, physical, size, _, _, _ = _SEGMENT.unpack_from(raw, offset + index * entry_size)
        if size > _LARGEST_SEGMENT:
            raise ValueError(f"a segment of {size} bytes")
        if kind == _SEGMENT_LOAD and size:
            yield physical, raw[at : at + size]


def _symbols(raw: bytes, header: Tuple) -> Iterator[Tuple[str, Symbol]]:
    offset, entry_size, count = header[6], header[11], header[12]
    sections = [_SECTION.unpack_from(raw, offset + index * entry_size) for index in range(count)]
    table = next((each for each in sections if each[1] == _SECTION_SYMBOLS), None)
    if table is None:
        return
    at, size, link = table[4:7]
    names = sections[link][4]
    for entry in range(at, at + size, _SYMBOL.size):
        name_at, value, length, _, _, section = _SYMBOL.unpack_from(raw, entry)
        if name_at and section:
            yield (
                _text(raw, names + name_at),
                Symbol(value & 0xFFFF if value >= DATA_BASE else value, length),
            )


def _text(raw: bytes, at: int) -> str:
    return raw[at : raw.index(b"\0", at, at + _LONGEST_NAME)].decode("ascii", "replace")
