"""Where a lost robot may have come back: names worth opening, the likeliest first.

Pure: the ports that there are, and the time, go in.  A port is opened in the search only if the user named it, or if
it has the USB vendor and product of the one that was lost; opening resets an Uno, and other devices are not ours.
"""

import math
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

AGAIN_S = 1.0
"""A port that could not be opened, or stayed silent, is left alone for so long."""
AGAIN_SOON_S = 0.2
"""The same for an address on a network, where a look resets nothing."""
WRONG_AGAIN_S = 10.0
"""The same for a port of unknown kind on which another robot answers; one with USB ids is left alone until it was
unplugged.
"""


class Port(NamedTuple):
    """A serial port as the system describes it."""

    device: str
    """Name under /dev, with symbolic links resolved."""
    links: Tuple[str, ...] = ()
    """Names under /dev/serial/by-id that lead to it."""
    vendor: Optional[int] = None
    """USB vendor id; None where the port is no USB device."""
    product: Optional[int] = None
    serial: Optional[str] = None
    """USB serial number; None where the device has none."""

    location: Optional[str] = None
    """Which USB socket it is plugged into; None where unknown."""

    @property
    def identity(self) -> Tuple[str, Optional[str], Optional[str]]:
        """What does not change while it stays plugged in."""
        return self.device, self.serial, self.location

    def is_like(self, other: "Port") -> bool:
        """Same USB vendor and product."""
        return self.vendor is not None and (self.vendor, self.product) == (other.vendor, other.product)

    def is_same(self, other: "Port") -> bool:
        """To all appearances the very same device: by its serial number; without one, by its socket or its link."""
        if not self.is_like(other) or self.serial != other.serial:
            return False
        if self.serial is not None:
            return True
        if self.location is not None and other.location is not None:
            return self.location == other.location
        return bool(set(self.links) & set(other.links))


def described_as(device: str, there: Sequence[Port]) -> Port:
    """The one of `there` that is `device`."""
    return next((port for port in there if port.device == device), Port(device))


def candidates(name: str, device: str, lost: Port, there: Sequence[Port]) -> List[str]:
    """Names to open in the search, best first.

    The very same device leads, under whatever name, in the same socket above all; then the name that the user gave,
    then devices of the same USB vendor and product.

    Args:
        name: as the user gave it; a symbolic link, perhaps.
        device: what `name` leads to at present.
        lost: the port that was lost.
        there: all ports there are.
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
    """Which name to try next, until the robot is found.

    Args:
        name: as the user gave it.
        lost: the port that was lost.
        others: ports that were there beside it; none of them is the robot's while it stays plugged in.
        exists: whether there is something under a name.
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
        """The name to open at `now` [s], or None; `device` is what the user's name leads to."""
        if self._device not in ("", device):
            self._refused.pop(self.name, None)  # the user's name leads to another port
        self._device = device
        names = self._names(device, there)
        if self.rivals and set(names) == self._among:
            return None
        if self.rivals:
            self._answered.clear()
        unheard = [name for name in names if name not in self._answered]
        for name in unheard + [name for name in names if name in self._answered]:
            if now >= self._refused.get(name, -math.inf):
                return name
        return None

    def refuse(self, name: str, now: float, wrong: bool = False) -> None:
        """Leave `name` alone for some time; one of a `wrong` robot until it was unplugged."""
        again_s = AGAIN_SOON_S if "://" in name else AGAIN_S
        wait_s = again_s if not wrong else WRONG_AGAIN_S if name == self.name else math.inf
        self._refused[name] = now + wait_s
        self._answered.discard(name)

    def take(self, name: str, port: Port, device: str, there: Sequence[Port]) -> bool:
        """The robot's id is answered on `name`, which leads to `port`: is that the robot?

        Where nothing tells the lost device from others, those are asked as well, and if several answer none is taken.
        """
        same = [each for each in there if each.is_same(self.lost)]
        if port.vendor is None or same == [port] or (port in same and port.location == self.lost.location):
            return True
        self._among = set(self._names(device, there))
        self._answered.add(name)
        return self._among <= self._answered | set(self._refused) and not self.rivals

    @property
    def rivals(self) -> List[str]:
        """Names on which the robot's id was answered, where there are several."""
        return sorted(self._answered) if len(self._answered) > 1 else []

    def _names(self, device: str, there: Sequence[Port]) -> List[str]:
        """Names that may be the robot's at present."""
        present = {port.device for port in there} | {self.name}
        self._refused = {name: until for name, until in self._refused.items() if name in present}
        self._answered &= present
        self._others &= {port.identity for port in there}
        others = {identity[0] for identity in self._others}
        free = [port for port in there if port.device not in others]
        names = candidates(self.name, device, self.lost, free)
        return [name for name in names if self._exists(name) and (name != self.name or device not in others)]
