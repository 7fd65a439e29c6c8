"""The search for a lost robot: which ports to open, the most likely first.

This module does no I/O: the list of ports and the time go in.  A port is opened only if the user named it, or if it has
the USB vendor and product of the lost port: opening resets an Uno, and other devices must be left alone.
"""

import math
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

AGAIN_S = 1.0  # wait before a port that could not be opened, or stayed silent, is tried again [s]
AGAIN_SOON_S = 0.2  # the same for a network address, where a trial resets nothing [s]
# The same for the user's port name if another robot answers on it [s].  Any other port with a wrong robot is not tried
# again until it is unplugged.
WRONG_AGAIN_S = 10.0


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


def candidates(name: str, device: str, lost: Port, there: Sequence[Port]) -> List[str]:
    """Return the names to open in the search, the best first.

    First comes the same device under any name, above all in the same socket; then the name that the user gave; then
    devices with the same USB vendor and product.

    Args:
        name: the name that the user gave; it may be a symbolic link.
        device: the device that `name` leads to now.
        lost: the port that was lost.
        there: all existing ports.
    """
    named = next((port for port in there if port.device == device), None)
    alike = [port for port in there if port.is_like(lost)]
    alike.sort(
        key=lambda port: (not port.is_same(lost), port.location != lost.location, port != named, port.device)
    )
    found = [name if port == named else port.device for port in alike]
    if name in found:
        return found
    at = sum(port.is_same(lost) for port in alike) if named is None else len(found)
    return [*found[:at], name, *found[at:]]


class Search:
    """Chooses the name to try next, until the robot is found.

    Args:
        name: the name that the user gave.
        lost: the port that was lost.
        others: ports that were present at the same time; none of them is the robot's while it stays plugged in.
        exists: returns whether a name exists.
    """

    def __init__(
        self, name: str, lost: Port, others: Sequence[Port] = (), exists: Callable[[str], bool] = bool
    ) -> None:
        self.name, self.lost, self._exists = name, lost, exists
        self._others = {port.identity for port in others}
        self._refused: Dict[str, float] = {}
        self._device = ""
        self._answered: Set[str] = set()
        self._among: Set[str] = set()

    def next(self, device: str, there: Sequence[Port], now: float) -> Optional[str]:
        """Return the name to open at `now` [s], or None; `device` is the device that the user's name leads to."""
        if self._device not in ("", device):
            self._refused.pop(self.name, None)  # the user's name now leads to another port
        self._device = device
        names = self._names(device, there)
        if self.rivals and set(names) == self._among:
            return None
        if self.rivals:
            self._answered.clear()
        unanswered = [name for name in names if name not in self._answered]
        for name in unanswered + [name for name in names if name in self._answered]:
            if now >= self._refused.get(name, -math.inf):
                return name
        return None

    def refuse(self, name: str, now: float, wrong: bool = False) -> None:
        """Do not try `name` for some time; with `wrong` (another robot answers on it) until it is unplugged."""
        again_s = AGAIN_SOON_S if "://" in name else AGAIN_S
        wait_s = again_s if not wrong else WRONG_AGAIN_S if name == self.name else math.inf
        self._refused[name] = now + wait_s
        self._answered.discard(name)

    def take(self, name: str, port: Port, device: str, there: Sequence[Port]) -> bool:
        """A board with the robot's id answers on `name`, which leads to `port`; return whether it is the robot.

        If the lost device cannot be distinguished from others, the others are tried as well.  If several answer, none
        is taken.
        """
        same = [each for each in there if each.is_same(self.lost)]
        if port.vendor is None or same == [port] or (port in same and port.location == self.lost.location):
            return True
        self._among = set(self._names(device, there))
        self._answered.add(name)
        return self._among <= self._answered | set(self._refused) and not self.rivals

    @property
    def rivals(self) -> List[str]:
        """Names on which a board with the robot's id answers, if there are several."""
        return sorted(self._answered) if len(self._answered) > 1 else []

    def _names(self, device: str, there: Sequence[Port]) -> List[str]:
        """Return the names that may lead to the robot now."""
        present = {port.device for port in there} | {self.name}
        self._refused = {name: until for name, until in self._refused.items() if name in present}
        self._answered &= present
        self._others &= {port.identity for port in there}
        others = {identity[0] for identity in self._others}
        free = [port for port in there if port.device not in others]
        names = candidates(self.name, device, self.lost, free)
        return [name for name in names if self._exists(name) and (name != self.name or device not in others)]
