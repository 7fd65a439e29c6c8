"""A link to a fake board in the same process, without a port."""

import threading
import time

from mrl_driver import lock_order
from tests.fake_board import FakeBoard
from tests.waiting import PATIENCE_S

STEP_S = 0.002


class Line:
    """A link to a fake board; it notes the locks held during writes.

    While `open` is cleared, the writes of the thread `stuck` block, or of any thread if that is None.
    """

    port = "line"

    def __init__(self):
        self.board, self.open, self.held = FakeBoard(), threading.Event(), set()
        self.blocked, self.stuck = [], None
        self._guard, self._woken, self._closed = threading.Lock(), threading.Event(), False
        self.open.set()
        self.board.reset(time.monotonic())

    def read(self, timeout_s):
        end_s = time.monotonic() + timeout_s
        while not self._closed:
            with self._guard:
                data = self.board.advance(time.monotonic())
            if data or self._woken.wait(STEP_S) or time.monotonic() >= end_s:
                self._woken.clear()
                return data
        return b""

    def write(self, data):
        self.held.add(lock_order.held())
        writer = threading.current_thread().name
        if not self.open.is_set() and self.stuck in (None, writer):
            self.blocked.append(writer)
            self.open.wait(PATIENCE_S)
        with self._guard:
            self.board.receive(data, time.monotonic())

    def wake(self):
        self._woken.set()

    def close(self):
        self._closed = True

    def fileno(self):
        return -1

    def set_baud(self, baud):
        raise NotImplementedError
