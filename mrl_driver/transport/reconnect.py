"""Finds a lost robot again: opens what `ports` names, one after the other, until the robot answers."""

import os
import time
from typing import Callable, List, Optional

from mrl_driver.errors import BoardTimeout, LinkError, LinkLost, MrlError, WrongRobot

from .address import is_url
from .link import Link, described, in_use
from .port_search import Port, Search, described_as

LOOK_S = 0.1
"""A lost port is looked for this often [s]; a look takes 1 to 3 ms."""


class _Undecided(WrongRobot):
    """The robot's id is answered, but perhaps by another board."""


class Reconnection:
    """The search of one driver.

    Args:
        name: of the port, as the user gave it.
        open_link: opens a name.
        patience_s: how long a board may take to answer on a port that was just opened.
    """

    def __init__(self, name: str, open_link: Callable[[str], Link], patience_s: float) -> None:
        self._name, self._open_link, self._patience_s = name, open_link, patience_s
        self._note(name)
        self._search: Optional[Search] = None
        self._trial_ends_s = 0.0
        self.port = name
        """The name that was opened last."""
        self.same_board = True
        """No other board has answered since the port was lost."""

    def _note(self, name: str) -> None:
        """What is known of the robot's port, and which like it there are beside it."""
        there = described()
        self._described = described_as(os.path.realpath(name), there)
        self._others = [
            port for port in there if port.is_like(self._described) and port.device != self._described.device
        ]

    def _there(self, search: Search) -> List[Port]:
        return described() if search.lost.vendor is not None else []

    @property
    def searching(self) -> bool:
        """The robot is not found yet."""
        return self._search is not None

    def lose(self, error: MrlError, now: float) -> bool:
        """The link is gone, or what answers on it is not the robot; False where `error` tells nothing new."""
        if self._search is None:
            self._search, self.same_board = (
                Search(self._name, self._described, self._others, may_be_there),
                True,
            )
            return True
        if isinstance(error, _Undecided):
            self.same_board = False
            return bool(self._search.rivals)
        self._search.refuse(self.port, now, isinstance(error, WrongRobot))
        if not (is_url(self.port) and isinstance(error, LinkLost)):  # an address opens where nobody answers
            self.same_board = False
        return False

    def look(self) -> Optional[Link]:
        """The next port that may be the robot's, opened; None where there is none."""
        search, now = self._search, time.monotonic()
        assert search is not None
        name = search.next(os.path.realpath(self._name), self._there(search), now)
        if name is None:
            return None
        if in_use(name):
            search.refuse(name, now)
            return None
        try:
            link = self._open_link(name)
        except (LinkError, BoardTimeout):
            search.refuse(name, now)
            return None
        self.port, self._trial_ends_s = name, now + self._patience_s
        return link

    def judge(self, ready: bool, now: float) -> bool:
        """Is the robot found on the port that was opened last?

        Raises:
            BoardTimeout: it had its time.
            WrongRobot: another board may be the one, or answers as well.
        """
        if ready:
            assert self._search is not None
            self._demand_only(self._search)
            self._search = None
            self._note(self.port)
        elif now >= self._trial_ends_s:
            raise BoardTimeout(f"{self.port} does not answer")
        return ready

    def _demand_only(self, search: Search) -> None:
        there = self._there(search)
        port = described_as(os.path.realpath(self.port), there)
        if search.take(self.port, port, os.path.realpath(self._name), there):
            return
        if search.rivals:
            raise _Undecided(
                f"{' and '.join(search.rivals)} answer with the id of the robot that was lost, and nothing tells them "
                "apart: unplug all but that robot, or give the others another id with: mrl set-id"
            )
        raise _Undecided(f"{self.port} answers with the robot's id, and others like it are to be asked first")


def may_be_there(name: str) -> bool:
    """An URL is tried, a device only if there is one."""
    return is_url(name) or os.path.exists(name)
