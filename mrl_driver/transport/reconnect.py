"""Finds a lost robot: opens the ports that may lead to it, the most likely first, until the robot answers.

A port is opened only if the user named it, or if it has the USB vendor and product of the lost port: opening resets an
Uno, and other devices must be left alone.
"""

import math
import os
import time
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

from mrl_driver.errors import BoardTimeout, LinkError, LinkLost, MrlError, WrongRobot

from .address import is_url
from .link import Link
from .port_info import Port, described, described_as, opened_by

LOOK_S = 0.1  # time between two looks for a lost port [s]; one look takes 1 to 3 ms
AGAIN_S = 1.0  # wait before a port that could not be opened, or stayed silent, is tried again [s]
AGAIN_SOON_S = 0.2  # the same for a network address, where a trial resets nothing [s]
# The same for the user's port name if another robot answers on it [s].  Any other port with a wrong robot is not tried
# again until it is unplugged.
WRONG_AGAIN_S = 10.0


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
    """Chooses the name to try next, until the robot is found.  No I/O: the list of ports and the time go in.

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


class _PseudoTerminal(NamedTuple):
    """A pseudo terminal.  The system gives the number of one that was removed to the next one of any program."""

    name: Optional[Tuple[int, float]]
    """Inode and time of the symbolic link under which it is known; None for its own name."""
    device: Tuple[int, float]  # inode and time of the terminal itself


def _pseudo_terminal(name: str) -> Optional[_PseudoTerminal]:
    """The pseudo terminal with this name; None if there is none, or if it is another kind of port."""
    if not os.path.realpath(name).startswith("/dev/pts/"):
        return None
    try:
        named, device = os.lstat(name), os.stat(name)
    except OSError:
        return None
    own = (device.st_ino, device.st_ctime)
    return _PseudoTerminal((named.st_ino, named.st_ctime) if os.path.islink(name) else None, own)


class _Undecided(WrongRobot):
    """A board with the robot's id answers, but it may be another board."""


class Reconnection:
    """The search of one driver for its lost robot.

    Args:
        name: name of the port, as the user gave it.
        open_link: opens a port by name.
        patience_s: time for a board's answer on a port that was just opened [s].

    Attributes:
        port: the name that was opened last.
        same_board: no other board answered since the port was lost.
    """

    same_board: bool
    _trial_ends_s: float

    def __init__(self, name: str, open_link: Callable[[str], Link], patience_s: float) -> None:
        self._name, self._open_link, self._patience_s = name, open_link, patience_s
        self._note(name)
        self._search: Optional[Search] = None
        self.port = name

    def _note(self, name: str) -> None:
        """Remember the robot's port, and the other ports of the same kind."""
        there = described()
        self._described = described_as(os.path.realpath(name), there)
        self._others = [
            port for port in there if port.is_like(self._described) and port.device != self._described.device
        ]
        self._terminal = _pseudo_terminal(name)

    def _there(self, search: Search) -> List[Port]:
        return described() if search.lost.vendor is not None else []

    @property
    def searching(self) -> bool:
        """The search is running."""
        return self._search is not None

    def lose(self, error: MrlError, now: float) -> bool:
        """The link is gone, or another board answers; return False if `error` is not news for the user."""
        if self._search is None:
            self._search = Search(self._name, self._described, self._others, may_be_there)
            self.same_board = True
            return True
        if isinstance(error, _Undecided):
            self.same_board = False
            return bool(self._search.rivals)
        self._search.refuse(self.port, now, isinstance(error, WrongRobot))
        if not (is_url(self.port) and isinstance(error, LinkLost)):  # an address opens without a board
            self.same_board = False
        return False

    def look(self) -> Optional[Link]:
        """Open the next port that may lead to the robot; None if there is none now."""
        search, now = self._search, time.monotonic()
        assert search is not None
        name = search.next(os.path.realpath(self._name), self._there(search), now)
        if name is None:
            return None
        if opened_by(name) or self._is_foreign(name):
            search.refuse(name, now)
            return None
        try:
            link = self._open_link(name)
        except (LinkError, BoardTimeout):
            search.refuse(name, now)
            return None
        self.port, self._trial_ends_s = name, now + self._patience_s
        return link

    def _is_foreign(self, name: str) -> bool:
        """Return whether a pseudo terminal has only the number of the lost one: it may be anybody's shell."""
        lost, there = self._terminal, _pseudo_terminal(name)
        if lost is None or there is None:
            return False
        return there.name == lost.name and there.device != lost.device

    def judge(self, ready: bool, now: float) -> bool:
        """Return whether the robot is found on the port that was opened last.

        Raises:
            BoardTimeout: no answer in time.
            WrongRobot: other boards may be the robot and must be tried first, or several answer with its id.
        """
        if ready:
            assert self._search is not None
            self._require_only(self._search)
            self._search = None
            self._note(self.port)
        elif now >= self._trial_ends_s:
            raise BoardTimeout(f"{self.port} does not answer")
        return ready

    def _require_only(self, search: Search) -> None:
        there = self._there(search)
        port = described_as(os.path.realpath(self.port), there)
        if search.take(self.port, port, os.path.realpath(self._name), there):
            return
        if search.rivals:
            raise _Undecided(
                f"{' and '.join(search.rivals)} answer with the id of the robot that was lost, and nothing tells them "
                "apart: unplug all but that robot, or give the others another id with: mrl set-id"
            )
        raise _Undecided(f"{self.port} answers with the robot's id, and others like it must be asked first")


def may_be_there(name: str) -> bool:
    """Return whether to try a name: always for a URL; for a device only if it exists."""
    return is_url(name) or os.path.exists(name)
