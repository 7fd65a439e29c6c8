"""Passes lines of text on in a thread of its own, so that the sender never waits, as for a terminal that is stopped."""

import contextlib
import queue
import threading
from typing import Callable, Optional

MOST_LINES = 100  # at most this many lines wait; further ones are counted
END_S = 0.5  # at the end, lines that wait are passed on for this time [s]


class Teller:
    """Calls `tell` with each line, in a thread.  A line that cannot be written is dropped.

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
