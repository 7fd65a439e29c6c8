"""Opens a port of any kind: a device, a TCP connection, UDP datagrams, or a URL of pyserial."""

import time
from typing import Callable, Optional

from mrl_driver.errors import BoardError, LinkError, shortages
from mrl_driver.protocol.table import BAUD

from .address import TCP, UDP, is_url, scheme_of
from .link import Link, SerialLink

# Time for a host to accept a connection, at first and in a search [s].  The system repeats a lost first packet after 1
# s.
CONNECT_S, AGAIN_S = 3.0, 0.8


class Opening:
    """The first opening of a port: until `timeout_s` has passed [s], each error is one that may pass.

    A port that has just appeared may not have its rights yet, or be held by a program that looks at it or ends.
    """

    def __init__(self, open_port: Callable[[], Link], timeout_s: float) -> None:
        self._open_port, self._until_s = open_port, time.monotonic() + timeout_s
        self.reason = ""  # why the last attempt failed

    def attempt(self) -> Optional[Link]:
        """Open the port; None to try again soon.  Raise the last LinkError or BoardError when the time is over."""
        try:
            return self._open_port()
        except (LinkError, BoardError) as error:
            if time.monotonic() >= self._until_s:
                raise
            self.reason = str(error)
            return None


def open_link(port: str, baud: int = BAUD, patience_s: float = CONNECT_S) -> Link:
    """Open a port and return its link.  The modules for URLs are imported only when needed.

    Args:
        port: device name or URL.
        baud: baud rate of devices, and of URLs that pyserial opens [Bd].
        patience_s: time for a host to accept a TCP connection [s].

    Raises:
        ConfigError: the URL does not parse.
        LinkError: the port cannot be opened; each link's class lists the errors.
    """
    with shortages(f"{port} cannot be opened", LinkError):
        return _open(port, baud, patience_s)


def _open(port: str, baud: int, patience_s: float) -> Link:
    if not is_url(port):
        return SerialLink(port, baud)
    scheme = scheme_of(port)
    if scheme in TCP:
        from .sockets import TcpLink

        return TcpLink(port, patience_s)
    if scheme in UDP:
        from .sockets import UdpLink

        return UdpLink(port)
    from .pyserial_link import UrlLink

    return UrlLink(port, baud)
