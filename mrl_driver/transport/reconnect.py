"""Finds a lost robot: opens the ports that `port_search` names, one after the other, until the robot answers."""

import os
import time
from typing import Callable, List, NamedTuple, Optional, Tuple

from mrl_driver.errors import BoardTimeout, LinkError, LinkLost, MrlError, WrongRobot

from .address import is_url
from .link import Link, described, opened_by
from .port_search import Port, Search, described_as

LOOK_S = 0.1  # time between two looks for a lost port [s]; one look takes 1 to 3 ms


class _PseudoTerminal(NamedTuple):
    """A pseudo terminal.  The system gives the number of one that was removed to the next one of any program."""

    name: Tuple[int, float]
    """Inode and time of the name under which it is known, which may be a symbolic link."""
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
    return _PseudoTerminal((named.st_ino, named.st_ctime) if os.path.islink(name) else (0, 0.0), own)


class _Undecided(WrongRobot):
    """A board with the robot's id answers, but it may be another board."""


class Reconnection:
    """The search of one driver for its lost robot.

    Args:
        name: name of the port, as the user gave it.
        open_link: opens a port by name.
        patience_s: time for a board's answer on a port that was just opened [s].
    """

    def __init__(self, name: str, open_link: Callable[[str], Link], patience_s: float) -> None:
        self._name, self._open_link, self._patience_s = name, open_link, patience_s
        self._note(name)
        self._search: Optional[Search] = None
        self._trial_ends_s = 0.0
        self.port = name  # the name that was opened last
        self.same_board = True  # no other board answered since the port was lost

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
