"""Finds a lost robot again: opens what `ports` names, one after the other, until the robot answers."""

import os
import time
from typing import Callable, Optional

from .address import is_url
from .errors import BoardTimeout, LinkError, LinkLost, MrlError, WrongRobot
from .link import Link, describe, described, in_use
from .ports import Search

LOOK_S = 0.1
"""A lost port is looked for this often [s]; a look takes 1 to 3 ms."""


class Reconnection:
    """The search of one driver.

    Args:
        name: of the port, as the user gave it.
        open_link: opens a name.
        patience_s: how long a board may take to answer on a port that was just opened.
    """

    def __init__(self, name: str, open_link: Callable[[str], Link], patience_s: float) -> None:
        self._name, self._open_link, self._patience_s = name, open_link, patience_s
        self._described = describe(name)
        self._search: Optional[Search] = None
        self._trial_ends_s = 0.0
        self.port = name
        """The name that was opened last."""
        self.same_board = True
        """No other board has answered since the port was lost."""

    @property
    def searching(self) -> bool:
        """The robot is not found yet."""
        return self._search is not None

    def lose(self, error: MrlError, now: float) -> bool:
        """The link is gone, or what answers on it is not the robot; False in a search that goes on already."""
        if self._search is None:
            self._search, self.same_board = Search(self._name, self._described), True
            return True
        self._search.refuse(self.port, now, isinstance(error, WrongRobot))
        if not (is_url(self.port) and isinstance(error, LinkLost)):  # an address opens where nobody answers
            self.same_board = False
        return False

    def look(self) -> Optional[Link]:
        """The next port that may be the robot's, opened; None where there is none."""
        search, now = self._search, time.monotonic()
        assert search is not None
        there = described() if search.lost.vendor is not None else []
        name = search.next(os.path.realpath(self._name), there, now, may_be_there)
        if name is None:
            return None
        if in_use(name):
            search.refuse(name, now)
            return None
        try:
            link = self._open_link(name)
        except LinkError:
            search.refuse(name, now)
            return None
        self.port, self._trial_ends_s = name, now + self._patience_s
        return link

    def judge(self, ready: bool, now: float) -> bool:
        """Is the robot found on the port that was opened last?

        Raises:
            BoardTimeout: it had its time.
        """
        if ready:
            self._search = None
            self._described = describe(self.port)
        elif now >= self._trial_ends_s:
            raise BoardTimeout(f"{self.port} does not answer")
        return ready


def may_be_there(name: str) -> bool:
    """An URL is tried, a device only if there is one."""
    return is_url(name) or os.path.exists(name)
