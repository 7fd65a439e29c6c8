"""USB ids of boards and serial adapters; sources: the makers' drivers, and those of Linux.

`mrl system install` writes udev rules for all of them.
"""

from typing import NamedTuple, Optional, Tuple

ARDUINO_VENDORS = (0x2341, 0x2A03)


class UsbKind(NamedTuple):
    """A kind of USB device, by its vendor and product id."""

    vendor: int
    product: int
    text: str


KINDS: Tuple[UsbKind, ...] = (
    UsbKind(0x2341, 0x0001, "Arduino Uno"),
    UsbKind(0x2341, 0x0043, "Arduino Uno R3"),
    UsbKind(0x2341, 0x0243, "Arduino Uno R3"),
    UsbKind(0x2A03, 0x0043, "Arduino Uno R3"),
    UsbKind(0x2341, 0x0010, "Arduino Mega 2560"),
    UsbKind(0x2341, 0x0042, "Arduino Mega 2560 R3"),
    UsbKind(0x0403, 0x6001, "FTDI adapter"),
    UsbKind(0x0403, 0x6015, "FTDI adapter"),
    UsbKind(0x067B, 0x2303, "PL2303 adapter"),
    UsbKind(0x10C4, 0xEA60, "CP210x adapter"),
    UsbKind(0x1A86, 0x7523, "CH340 adapter, as on copies of the Uno"),
    UsbKind(0x1A86, 0x7522, "CH340K adapter"),
    UsbKind(0x1A86, 0x5523, "CH341 adapter"),
    UsbKind(0x1A86, 0x55D3, "CH343 adapter"),
    UsbKind(0x1A86, 0x55D4, "CH9102 adapter"),
)


def text_of(vendor: Optional[int], product: Optional[int]) -> str:
    """Return the kind of a USB device in words."""
    if vendor is None:
        return "serial port"
    for kind in KINDS:
        if (kind.vendor, kind.product) == (vendor, product):
            return kind.text
    return "Arduino board" if vendor in ARDUINO_VENDORS else "unknown USB device"
