"""Tells when the ROS master goes away: nodes that are connected go on, but nobody finds this one any more.  No ROS."""

import socket
from urllib.parse import urlparse

PATIENCE_S = 0.3


class MasterWatch:
    """Looks whether anything listens at the master's address."""

    def __init__(self, uri: str) -> None:
        self._uri = uri
        self._there = True

    def look(self) -> str:
        """What has changed since the last look, in words; nothing where nothing has."""
        before, self._there = self._there, _listens(self._uri)
        if before and not self._there:
            return (
                f"no ROS master answers at {self._uri}: who is connected stays so, and without cmd_vel the robot "
                "stops; start roscore, then this node again"
            )
        if self._there and not before:
            return f"a ROS master answers again at {self._uri}: if it is a new one, start this node again"
        return ""


def _listens(uri: str) -> bool:
    address = urlparse(uri)
    try:
        socket.create_connection((address.hostname or "localhost", address.port or 11311), PATIENCE_S).close()
    except OSError:
        return False
    return True
