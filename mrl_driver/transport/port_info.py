"""Information about serial ports without opening them, because opening one resets an Arduino Uno."""

import os
from typing import Dict, List, NamedTuple

from .link import described, group_of, locked_by, opened_by, read_text
from .port_search import Port
from .usb_ids import ARDUINO_VENDORS, text_of

_LOCK_FOLDERS = ("/run/lock", "/var/lock")


class PortFacts(NamedTuple):
    """One serial port."""

    device: str
    kind: str  # kind of the device in words
    arduino: bool  # its USB vendor is Arduino: a search may open it
    link: str  # permanent name under /dev/serial/by-id; empty if there is none
    usb: str  # vendor and product id in hexadecimal, such as `2341:0043`; empty if it is not a USB device
    serial: str  # USB serial number; empty if the device has none
    used_by: str  # program that has it open, as far as this user can see; empty if there is none
    permitted: bool  # this user may open it
    group: str  # group that may open it


def facts() -> List[PortFacts]:
    """Return all serial ports, sorted by name."""
    return sorted(map(facts_of, described()), key=lambda each: each.device)


def facts_of(port: Port) -> PortFacts:
    """Return the information about a port."""
    vendor, product = port.vendor, port.product
    return PortFacts(
        port.device,
        text_of(vendor, product),
        vendor in ARDUINO_VENDORS,
        port.links[0] if port.links else "",
        "" if vendor is None else f"{vendor:04x}:{product or 0:04x}",
        port.serial or "",
        user_of(port.device),
        os.access(port.device, os.R_OK | os.W_OK),
        group_of(port.device),
    )


def user_of(device: str) -> str:
    """Return the program that has the port open, or has a UUCP lock file for it; empty if there is none.

    Programs of other users are visible only to root, or by their locks.
    """
    holder = locked_by(device) or opened_by(device)
    if holder:
        return holder
    for folder in _LOCK_FOLDERS:
        try:
            with open(f"{folder}/LCK..{os.path.basename(device)}", encoding="ascii") as file:
                number = int(file.read())
            os.kill(number, 0)
        except (OSError, ValueError, OverflowError) as error:
            if not isinstance(error, PermissionError):
                continue
        return f"process {number}"
    return ""


def udev_properties(device: str) -> Dict[str, str]:
    """Return udev's properties of a device; empty without udev.

    Not by pyudev: only `mrl doctor` asks, for one property; all else about ports comes from pyserial.
    """
    try:
        number = os.stat(device).st_rdev
        with open(
            f"/run/udev/data/c{os.major(number)}:{os.minor(number)}", encoding="utf-8", errors="replace"
        ) as file:
            lines = [line[2:].rstrip("\n").partition("=") for line in file if line.startswith("E:")]
    except OSError:
        return {}
    return {key: value for key, _, value in lines}


def programs_named(name: str) -> List[int]:
    """Return the process ids of the programs with this name."""
    numbers = filter(str.isdigit, os.listdir("/proc"))
    return [int(number) for number in numbers if read_text(f"/proc/{number}/comm").rstrip("\n") == name]
