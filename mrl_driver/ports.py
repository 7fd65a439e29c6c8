"""Where a lost robot may have come back: names worth opening, the likeliest first.

Pure: the ports that there are, and the time, go in.  A port is opened in the search only if the user named it, or if
it has the USB vendor and product of the one that was lost; opening resets an Uno, and other devices are not ours.
"""

import math
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

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

    def is_like(self, other: "Port") -> bool:
        """Same USB vendor and product."""
        return self.vendor is not None and (self.vendor, self.product) == (other.vendor, other.product)

    def is_same(self, other: "Port") -> bool:
        """To all appearances the very same device."""
        known = self.serial is not None or bool(set(self.links) & set(other.links))
        return self.is_like(other) and known and self.serial == other.serial


def candidates(name: str, device: str, lost: Port, there: Sequence[Port]) -> List[str]:
    """Names to open in the search, best first.

    The very same device leads, under whatever name; then the name that the user gave, then devices of the same USB
    vendor and product.

    Args:
        name: as the user gave it; a symbolic link, perhaps.
        device: what `name` leads to at present.
        lost: the port that was lost.
        there: all ports there are.
    """
    named = next((port for port in there if port.device == device), None)
    alike = [port for port in there if port.is_like(lost)]
    alike.sort(key=lambda port: (not port.is_same(lost), port != named, port.device))
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
    """

    def __init__(self, name: str, lost: Port) -> None:
        self.name, self.lost = name, lost
        self._refused: Dict[str, float] = {}

    def next(
        self, device: str, there: Sequence[Port], now: float, exists: Callable[[str], bool] = bool
    ) -> Optional[str]:
        """The name to open at `now` [s], or None; `device` is what the user's name leads to."""
        present = {port.device for port in there} | {self.name}
        self._refused = {name: until for name, until in self._refused.items() if name in present}
        for name in candidates(self.name, device, self.lost, there):
            if now >= self._refused.get(name, -math.inf) and exists(name):
                return name
        return None

    def refuse(self, name: str, now: float, wrong: bool = False) -> None:
        """Leave `name` alone for some time; one of a `wrong` robot until it was unplugged."""
        again_s = AGAIN_SOON_S if "://" in name else AGAIN_S
        wait_s = again_s if not wrong else WRONG_AGAIN_S if name == self.name else math.inf
        self._refused[name] = now + wait_s
