"""Detects that the ROS master is gone: connected nodes stay connected, but new ones cannot find this node.  No ROS."""

import socket
import time
from typing import Callable
from urllib.parse import urlparse

PATIENCE_S, START_PATIENCE_S = 0.3, 3.0
LOOK_S = 0.5
EXAMPLE = "http://localhost:11311"


class MasterWatch:
    """Checks whether a process listens at the master's address."""

    def __init__(self, uri: str) -> None:
        self._uri = uri
        self._there = True

    def look(self) -> str:
        """A sentence on what has changed since the last call; empty if nothing has changed."""
        before, self._there = self._there, _listens(self._uri)
        if before and not self._there:
            return (
                f"no ROS master answers at {self._uri}: existing connections stay, and without cmd_vel the robot "
                "stops; start roscore, then this node again"
            )
        if self._there and not before:
            return f"a ROS master answers again at {self._uri}: if it is a new one, start this node again"
        return ""


def await_master(uri: str, tell: Callable[[str], None]) -> None:
    """Wait until a process listens at the master's address; `tell` gets a message if this takes long.

    rospy waits for the master too, but not in all cases.
    """
    if _listens(uri, START_PATIENCE_S):
        return
    tell(
        f"no ROS master answers at {uri}, waiting for it: start roscore, or set ROS_MASTER_URI, such as {EXAMPLE}"
    )
    while not _listens(uri, START_PATIENCE_S):
        time.sleep(LOOK_S)


def _listens(uri: str, patience_s: float = PATIENCE_S) -> bool:
    try:
        address = urlparse(uri)
        if not address.hostname:
            return False
        socket.create_connection((address.hostname, address.port or 11311), patience_s).close()
    except (OSError, ValueError):  # nothing listens there, or the address has no valid port
        return False
    return True
