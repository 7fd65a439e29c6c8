"""A serial port on the network: bytes pass between a board and one client.  When the client leaves, the robot stops."""

import select
from typing import Callable, List, Optional

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import STOP_CODE

from .link import Link
from .listener import Listener
from .teller import Teller

STOP = encode_request(STOP_CODE)
LOOK_S = 0.5
"""Time between two checks whether a UDP client is silent [s]."""
STOPS, STOP_AGAIN_S = 3, 0.05
"""Number of stops and time between them [s].  A stop may fall into an incomplete frame, so it is repeated."""


class Bridge:
    """Connects `listener`'s client with `link` until `stop` is called; it ends at most half a second later.

    Args:
        link: link to the board.
        listener: listener for the client.
        tell: called with a line of text when a client comes or leaves.  It may block or raise an `OSError`: the bridge
            goes on, because a `Teller` calls it.
    """

    def __init__(self, link: Link, listener: Listener, tell: Callable[[str], None]) -> None:
        self._link, self._listener, self._tell = link, listener, Teller(tell)
        self._client = ""
        self._stops = 0
        self._running = self._accepts = True

    def stop(self) -> None:
        """End `run`; may be called from a signal handler or another thread."""
        self._running = False

    def run(self) -> None:
        """Pass bytes in both directions until `stop` is called.

        Raises:
            LinkLost: the board's port went away.
        """
        try:
            while self._running:
                self._turn()
        finally:
            try:
                if self._client or self._stops:
                    any(self._send(STOP * STOPS) for _ in range(STOPS))  # until the port has taken them
            finally:
                self._listener.close()
                self._tell.close()

    def _turn(self) -> None:
        watched: List[Optional[int]] = [self._link.fileno(), self._listener.watch, self._listener.data]
        wait_s = STOP_AGAIN_S if self._stops else LOOK_S
        select.select([fd for fd in watched if fd is not None], [], [], wait_s)
        data = self._link.read(0)
        if data:
            self._listener.write(data)
        data = self._listener.read()
        self._notice()  # whose command is sent is known first: this client, too, may be gone a moment later
        if data:
            self._send(data)
        self._listener.attend()
        self._notice()
        if self._stops and self._send(STOP):
            self._stops -= 1

    def _send(self, data: bytes) -> bool:
        """Return whether the board's port has accepted the bytes; the first refusal in a row is reported."""
        accepted, self._accepts = self._accepts, True
        try:
            self._link.write(data)
        except BoardTimeout as error:
            self._accepts = False
            if accepted:
                self._tell(str(error))
        return self._accepts

    def _notice(self) -> None:
        """Report a new client or one that has left; stop the robot when a client has left."""
        before, client = self._client, self._listener.client
        if before == client:
            return
        if before:
            self._stops = STOPS  # first: an exception from here on is a stop, too
            self._tell(f"{before} has left; the robot is stopped")
        self._client = client
        if client:
            self._tell(f"{client} is served")
