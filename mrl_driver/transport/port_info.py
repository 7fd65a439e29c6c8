"""Information about serial ports without opening them, because opening one resets an Arduino Uno."""

import glob
import grp
import os
import stat
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import ConfigError

PTY_MAJORS = range(136, 144)
ARDUINO_VENDORS = (0x2341, 0x2A03)
_LOCK_FOLDERS = ("/run/lock", "/var/lock")


class UsbKind(NamedTuple):
    """A kind of USB device, by its vendor and product id; `mrl system install` writes udev rules for all kinds."""

    vendor: int
    product: int
    text: str


# Sources: the makers' drivers, and those of Linux.
KINDS: Tuple[UsbKind, ...] = (
    UsbKind(0x2341, 0x0001, "Arduino Uno"),
    UsbKind(0x2341, 0x0043, "Arduino Uno R3"),
    UsbKind(0x2341, 0x0243, "Arduino Uno R3"),
    UsbKind(0x2A03, 0x0043, "Arduino Uno R3"),
    UsbKind(0x2341, 0x006A, "Arduino Uno Mini"),
    UsbKind(0x2341, 0x0010, "Arduino Mega 2560"),
    UsbKind(0x2A03, 0x0010, "Arduino Mega 2560"),
    UsbKind(0x2341, 0x0042, "Arduino Mega 2560 R3"),
    UsbKind(0x2341, 0x0210, "Arduino Mega 2560 R3"),
    UsbKind(0x2341, 0x0242, "Arduino Mega 2560 R3"),
    UsbKind(0x2A03, 0x0042, "Arduino Mega 2560 R3"),
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


def tells_apart(serial: Optional[str]) -> bool:
    """Return whether a USB serial number can be that of one device alone.

    Cheap adapters have none, or all the same: zeros and ones, such as 0001 of the CP2102.
    """
    return serial is not None and not set(serial) <= set("01")


class Port(NamedTuple):
    """A serial port as the system describes it."""

    device: str  # name under /dev, with symbolic links resolved
    links: Tuple[str, ...] = ()  # names under /dev/serial/by-id that lead to it
    vendor: Optional[int] = None  # USB vendor id; None if the port is not a USB device
    product: Optional[int] = None
    serial: Optional[str] = None  # USB serial number; None if the device has none
    location: Optional[str] = None  # USB socket that it is plugged into; None if unknown

    @property
    def identity(self) -> Tuple[str, Optional[str], Optional[str]]:
        """Properties that do not change while the device stays plugged in."""
        return self.device, self.serial, self.location

    def is_like(self, other: "Port") -> bool:
        """Return whether both have the same USB vendor and product."""
        return self.vendor is not None and (self.vendor, self.product) == (other.vendor, other.product)

    def is_same(self, other: "Port") -> bool:
        """Return whether both appear to be the same device: by serial number, or without one by USB socket or link."""
        if not self.is_like(other) or self.serial != other.serial:
            return False
        if tells_apart(self.serial):
            return True
        if self.location is not None and other.location is not None:
            return self.location == other.location
        return bool(set(self.links) & set(other.links))


def described_as(device: str, there: Sequence[Port]) -> Port:
    """Return the port in `there` whose name is `device`; if there is none, a port with only that name."""
    return next((port for port in there if port.device == device), Port(device))


def _comports() -> List[Any]:
    try:
        from serial.tools import list_ports  # late: the list of commands needs no pyserial
    except ImportError:
        raise not_pyserial() from None
    return list(list_ports.comports())


def not_pyserial() -> ConfigError:
    """Return the error for another module that is called serial."""
    import serial

    return ConfigError(
        f"{serial.__file__} is not pyserial: rename it if it is yours; otherwise run: pip uninstall serial, and then: "
        "pip install --force-reinstall pyserial"
    )


def ports() -> List[str]:
    """Return the device names of all serial ports."""
    return sorted(port.device for port in _comports())


def described() -> List[Port]:
    """Return all serial ports with their USB ids, their names under /dev/serial/by-id, and their USB sockets."""
    links: Dict[str, List[str]] = {}
    for link in sorted(glob.glob("/dev/serial/by-id/*")):
        links.setdefault(os.path.realpath(link), []).append(link)
    found = ((port, tuple(links.get(os.path.realpath(port.device), ()))) for port in _comports())
    return [
        Port(port.device, names, port.vid, port.pid, port.serial_number, port.location)
        for port, names in found
    ]


def describe(name: str) -> Port:
    """Return the port that `name` leads to."""
    return described_as(os.path.realpath(name), described())


def is_terminal(name: str) -> bool:
    """Return whether `name` is a serial port or a pseudo terminal (and not /dev/null, which many programs open)."""
    try:
        number = os.stat(name).st_rdev
    except (OSError, ValueError):
        return False
    kind = f"/sys/dev/char/{os.major(number)}:{os.minor(number)}/subsystem"
    return os.major(number) in PTY_MAJORS or os.path.basename(os.path.realpath(kind)) == "tty"


def opened_by(name: str) -> str:
    """Return name and process id of another program that has the port open; empty if this user can see none.

    A program whose terminal it is, such as a login prompt, is visible to all users; one that has merely opened it, to
    its own user and root.  The server of a pseudo terminal does not count.
    """
    try:
        there = os.stat(name)
        numbers = filter(str.isdigit, os.listdir("/proc"))
    except OSError:
        return ""
    if not stat.S_ISCHR(there.st_mode):
        return ""
    for number in numbers:
        process = f"/proc/{number}"
        if number != str(os.getpid()) and (_has_opened(process, there) or _works_in(process, there)):
            return _program(number)
    return ""


def _has_opened(process: str, there: os.stat_result) -> bool:
    """Return whether a process has opened the device, and does not serve it as a pseudo terminal."""
    devices = [fd for fd in glob.glob(f"{process}/fd/*") if _target(fd).startswith("/dev/")]
    if os.major(there.st_rdev) not in PTY_MAJORS:
        return any(_stat(fd).st_rdev == there.st_rdev for fd in devices)
    if not any(os.path.samestat(_stat(fd), there) for fd in devices):
        return False
    index = f"tty-index:\t{os.minor(there.st_rdev)}\n"
    return not any(index in read_text(fd.replace("/fd/", "/fdinfo/")) for fd in devices)


def _stat(path: str) -> os.stat_result:
    try:
        return os.stat(path)
    except OSError:
        return os.stat_result([0] * 10)


def read_text(path: str) -> str:
    """Return the text of a file of the system; empty if it cannot be read."""
    try:
        with open(path, "rb") as file:
            return file.read().decode(errors="replace")
    except OSError:
        return ""


def _program(number: str) -> str:
    """Return name and id of a process."""
    name = read_text(f"/proc/{int(number)}/comm").strip()
    return f"{name} (process {number})" if name else f"process {number}"


def _works_in(process: str, there: os.stat_result) -> bool:
    """Return whether this may be the controlling terminal of another user's process, whose files cannot be seen.

    The number alone says little: a container has terminals of its own with the same numbers.
    """
    if _terminal(f"{process}/stat") != there.st_rdev:
        return False
    try:
        os.listdir(f"{process}/fd")
    except PermissionError:
        return True
    except OSError:
        pass
    return False


def _terminal(stat_path: str) -> int:
    """Return the device number of a process's controlling terminal; 0 if it has none."""
    try:
        return int(read_text(stat_path).rpartition(")")[2].split()[4])
    except (IndexError, ValueError):
        return 0


def _target(path: str) -> str:
    try:
        return os.readlink(path)
    except OSError:
        return ""


def locked_by(port: str) -> str:
    """Return name and process id of the program that has locked the port; empty if the system shows none."""
    try:
        there = os.stat(port)
        file = f"{os.major(there.st_dev):02x}:{os.minor(there.st_dev):02x}:{there.st_ino}"
        locks = map(str.split, read_text("/proc/locks").splitlines())
        owners = [lock[4] for lock in locks if lock[5] == file]
        return _program(owners[0])
    except (OSError, IndexError, ValueError):
        return ""


def group_of(device: str) -> str:
    """Return the name of the group that owns the device; empty if it is unknown."""
    try:
        return grp.getgrgid(os.stat(device).st_gid).gr_name
    except (OSError, KeyError):
        return ""


def opening_group(device: str) -> str:
    """Return the name of the group whose members may open the device; empty if only root may."""
    both = stat.S_IRGRP | stat.S_IWGRP
    try:
        group, mode = group_of(device), os.stat(device).st_mode
    except OSError:
        return ""
    return group if mode & both == both and group != "root" else ""


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
    return sorted(map(facts_of, described()))


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
            number = int(read_text(f"{folder}/LCK..{os.path.basename(device)}"))
            os.kill(number, 0)
        except (OSError, ValueError, OverflowError) as error:
            if not isinstance(error, PermissionError):
                continue
        return _program(str(number))
    return ""


def udev_properties(device: str) -> Dict[str, str]:
    """Return udev's properties of a device; empty without udev.

    Not by pyudev: only `mrl doctor` asks, for one property; all else about ports comes from pyserial.
    """
    try:
        number = os.stat(device).st_rdev
    except OSError:
        return {}
    lines = read_text(f"/run/udev/data/c{os.major(number)}:{os.minor(number)}").split("\n")
    pairs = (line[2:].partition("=") for line in lines if line.startswith("E:"))
    return {key: value for key, _, value in pairs}


def programs_named(name: str) -> List[int]:
    """Return the process ids of the programs with this name."""
    numbers = filter(str.isdigit, os.listdir("/proc"))
    return [int(number) for number in numbers if read_text(f"/proc/{number}/comm") == f"{name}\n"]
