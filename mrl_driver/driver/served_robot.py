"""The robot of `mrl serve`: its port is opened when that is possible, and searched when it was lost."""

import time
from typing import Callable, Optional

from mrl_driver.errors import LinkLost, MrlError, WrongRobot
from mrl_driver.protocol.table import BAUD
from mrl_driver.robot.robot_state import require_kind
from mrl_driver.transport.link import Link
from mrl_driver.transport.open_link import AGAIN_S, CONNECT_S, Opening, open_link
from mrl_driver.transport.reconnect import Reconnection

from .probe import board_on


class ServedRobot:
    """Finds one robot for a `Bridge`: the board with `robot_id`, or with the id that answered first.

    It is `virtual` or real, or as the one that answered first.

    Args:
        tell: called with each new reason why the robot cannot be served now.
        timeout_s: the first search ends after this time [s].
    """

    def __init__(
        self,
        port: str,
        tell: Callable[[str], None],
        baud: int = BAUD,
        robot_id: Optional[int] = None,
        timeout_s: float = 0.0,
        virtual: Optional[bool] = None,
    ) -> None:
        self._port, self._baud, self._robot_id, self._tell = port, baud, robot_id, tell
        self._virtual = virtual
        self._opening = Opening(lambda: self._identified(open_link(port, baud, CONNECT_S)), timeout_s)
        self._reconnection: Optional[Reconnection] = None
        self._told = ""

    def find(self) -> Optional[Link]:
        """Return a link to the robot's board; None if it is not there now.

        Raises:
            MrlError: the time for the first search is over; this is the last error.
        """
        link = self._first() if self._reconnection is None else self._again(self._reconnection)
        if link is not None:
            self._told = ""
        return link

    def lose(self, error: LinkLost) -> None:
        """The link that was found is lost."""
        assert self._reconnection is not None
        self._reconnection.lose(error, time.monotonic())

    def _first(self) -> Optional[Link]:
        link = self._opening.attempt()
        if link is None:
            self._say(self._opening.reason)
        else:
            self._reconnection = Reconnection(
                self._port, lambda name: open_link(name, self._baud, AGAIN_S), 0.0
            )
        return link

    def _again(self, reconnection: Reconnection) -> Optional[Link]:
        link = reconnection.look()
        if link is None:
            return None
        try:
            self._identified(link)
            reconnection.judge(True, time.monotonic())
        except MrlError as error:
            link.close()
            reconnection.lose(error, time.monotonic())
            self._say(str(error))
            return None
        return link

    def _identified(self, link: Link) -> Link:
        """Return the link if its board is the robot, as the first that answers is; else close it and raise MrlError."""
        try:
            found = board_on(link)
            if self._robot_id not in (None, found.robot_id):
                raise WrongRobot(
                    f"robot id {found.robot_id} answers on {link.port}, expected {self._robot_id}: another robot is "
                    "not served"
                )
            require_kind(found.virtual, self._virtual)
        except BaseException:
            link.close()
            raise
        self._robot_id, self._virtual = found.robot_id, found.virtual
        return link

    def _say(self, reason: str) -> None:
        if reason != self._told:
            self._tell(f"{reason}; the port is tried again")
        self._told = reason
