"""A serial port on the network: bytes pass between a board and one client.  When the client leaves, the robot stops."""

import contextlib
import queue
import select
import threading
import time
from concurrent.futures import Future, wait
from typing import Callable, List, Optional

from mrl_driver.errors import BoardTimeout, LinkLost
from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import STOP_CODE

from .link import Link
from .listener import REASON, Listener

STOP, STOP_2013 = (encode_request(STOP_CODE, wrapped=wrapped) for wrapped in (False, True))
# How a request to a board of 2013 begins, see `table.WRAP`; none to another board does.  A driver that greets a board
# sends such requests until it knows which board it is.
TO_2013 = STOP_2013[:3]
LOOK_S = 0.5  # time between two checks whether a UDP client is silent [s]
SEARCH_S = 0.1  # time between two looks for the board [s]
ANSWERS_S = 3.0
"""Most boards answer within this time after their port is opened, and clients wait for that [s]."""
STOPS, STOP_AGAIN_S = 3, 0.05
"""Number of stops and time between them [s].  A stop may fall into an incomplete frame, so it is repeated."""
MOST_LINES = 100  # at most this many lines wait; further ones are counted
END_S = 0.5  # at the end, lines that wait are passed on for this time [s]


class Teller:
    """Passes lines of text on in a thread of its own, so that the sender never waits, as for a terminal that is
    stopped.  A line that cannot be written is dropped.

    Args:
        tell: takes a line of text; it may block, and may raise an `OSError`.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell, self._left_out = tell, 0
        self._lines: queue.Queue[Optional[str]] = queue.Queue(MOST_LINES)
        self._thread = threading.Thread(target=self._run, name="teller", daemon=True)
        self._thread.start()

    def __call__(self, line: str) -> None:
        """Pass a line on later.  Never blocks and never raises; for one thread alone."""
        more = f"; {self._left_out} lines before this one were left out" if self._left_out else ""
        try:
            self._lines.put_nowait(line + more)
            self._left_out = 0
        except queue.Full:
            self._left_out += 1

    def close(self) -> None:
        """Wait until the lines have been passed on, at most twice `END_S`."""
        with contextlib.suppress(queue.Full):
            self._lines.put(None, timeout=END_S)
        self._thread.join(END_S)

    def _run(self) -> None:
        for line in iter(self._lines.get, None):
            with contextlib.suppress(OSError):
                self._tell(line)


class Bridge:
    """Connects `listener`'s client with the board until `stop` is called; it ends at most half a second later, but for
    the time that `find` takes.

    While the board is away, clients get the reason and are disconnected.

    Args:
        find: returns a link to the board, or None if it is not there now; it may raise an MrlError, which ends `run`.
        lose: called with the error when that link is lost; from then on `find` looks for the same board.
        listener: listener for the client.
        tell: called with a line of text when a client or the board comes or leaves.  It may block or raise an
            `OSError`: the bridge goes on, because a `Teller` calls it.
    """

    def __init__(
        self,
        find: Callable[[], Optional[Link]],
        lose: Callable[[LinkLost], None],
        listener: Listener,
        tell: Callable[[str], None],
    ) -> None:
        self._find, self._lost, self._listener, self._tell = find, lose, listener, Teller(tell)
        self._link: Optional[Link] = None
        self._why = "the board was not found yet"
        self._stop = STOP_2013
        self._running = self._accepts = True

    def stop(self) -> None:
        """End `run`; may be called from a signal handler or another thread."""
        self._running = False

    def run(self) -> None:
        """Pass bytes in both directions until `stop` is called; raise MrlError if the board cannot be found."""
        try:
            while self._running:
                if self._link is None:
                    self._search()
                    continue
                try:
                    self._turn(self._link)
                except LinkLost as error:
                    self._lose(self._link, error)
        finally:
            try:
                if self._link is not None and (self._client or self._stops):
                    # Until the port has taken them:
                    any(self._send(self._link, self._stop * STOPS) for _ in range(STOPS))
            finally:
                if self._link is not None:
                    self._link.close()
                self._listener.close()
                self._tell.close()

    def _search(self) -> None:
        """Look for the board once, on a thread, for it may take 8 s; send clients away until it is there."""
        found: Future[Optional[Link]] = Future()
        threading.Thread(target=self._look, args=(found,), name="mrl-look", daemon=True).start()
        wait([found], ANSWERS_S)
        while not wait([found], SEARCH_S).done:
            self._send_away()
        link = found.result()
        if link is None:
            self._send_away()
            time.sleep(SEARCH_S)
            return
        self._listener.drop()  # what a client has sent meanwhile is old
        self._link, self._client, self._stops = link, "", 0
        self._tell(f"{link.port} answers")

    def _look(self, found: "Future[Optional[Link]]") -> None:
        try:
            found.set_result(self._find())
        except BaseException as error:  # noqa: BLE001 - `_search` raises it
            found.set_exception(error)

    def _send_away(self) -> None:
        self._listener.read()
        self._listener.attend()
        if self._listener.client:
            self._listener.write(REASON + self._why.encode() + b"\r\n")
            self._listener.drop()

    def _lose(self, link: Link, error: LinkLost) -> None:
        self._link, self._why = None, str(error)
        self._tell(f"{error}; the port is searched")
        self._send_away()
        link.close()
        self._lost(error)

    def _turn(self, link: Link) -> None:
        watched: List[Optional[int]] = [link.fileno(), self._listener.watch, self._listener.data]
        wait_s = STOP_AGAIN_S if self._stops else LOOK_S
        select.select([fd for fd in watched if fd is not None], [], [], wait_s)
        data = link.read(0)
        if data:
            self._listener.write(data)
        data = self._listener.read()
        self._notice()  # whose command is sent is known first: this client, too, may be gone a moment later
        if b"@" in data:
            self._stop = STOP_2013 if TO_2013 in data else STOP
        if data:
            self._send(link, data)
        self._listener.attend()
        self._notice()
        if self._stops and self._send(link, self._stop):
            self._stops -= 1

    def _send(self, link: Link, data: bytes) -> bool:
        """Return whether the board's port has accepted the bytes; the first refusal in a row is reported."""
        accepted, self._accepts = self._accepts, True
        try:
            link.write(data)
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
