"""A TCP proxy in the test: it counts bytes, notes when the browser sent, and stalls when told to."""

import contextlib
import socket
import threading
import time
from typing import List, Tuple

from tests.waiting import PATIENCE_S


class StallingProxy:
    """Passes connections on to a port of this computer, until `close`.

    While `flows` is cleared nothing passes in either direction; what waited then passes at once.

    Attributes:
        port: Where it listens.
        sent: When bytes from the browser were passed on [s of `time.monotonic`], and how many.
        received: Bytes that were passed on to the browser.
    """

    def __init__(self, target: int) -> None:
        self.target, self.flows = target, threading.Event()
        self.flows.set()
        self.sent: List[Tuple[float, int]] = []
        self.received = 0
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._ends: List[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                browser, _ = self._server.accept()
                try:
                    server = socket.create_connection(("127.0.0.1", self.target), PATIENCE_S)
                except OSError:  # the server is not there: neither is this connection
                    browser.close()
                    continue
                server.settimeout(None)
                for end in (browser, server):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._ends += browser, server
                for arguments in ((browser, server, True), (server, browser, False)):
                    thread = threading.Thread(target=self._pass_on, args=arguments, daemon=True)
                    self._threads.append(thread)
                    thread.start()

    def _pass_on(self, source: socket.socket, sink: socket.socket, from_browser: bool) -> None:
        with contextlib.suppress(OSError):
            while True:
                data = source.recv(65536)
                self.flows.wait()
                if not data:
                    break
                if from_browser:
                    self.sent.append((time.monotonic(), len(data)))
                else:
                    self.received += len(data)
                sink.sendall(data)
        with contextlib.suppress(OSError):
            sink.shutdown(socket.SHUT_WR)  # the other direction ends by itself

    def cut(self) -> None:
        """Ends the connections there are; what waits in them is lost."""
        for end in self._ends:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Ends all connections."""
        self._server.shutdown(socket.SHUT_RDWR)
        self.flows.set()
        self._threads[0].join(PATIENCE_S)
        self.cut()
        for thread in self._threads:
            thread.join(PATIENCE_S)
        for end in (self._server, *self._ends):
            end.close()
