import contextlib
import os
import select
import signal
import subprocess
import sys
import threading
import time
import tty

import pytest

from mrl_driver.session import session
from tests.fake_board import FakeBoard
from tests.waiting import PATIENCE_S

from .line import Line


class PtyBoard:
    """A fake board on a pty, in a thread; `lock` guards the board."""

    def __init__(self, board):
        self.board = board
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.path = os.ttyname(self.slave)
        self.held = threading.Event()
        self.unplugged = threading.Event()
        self.received = bytearray()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        while not self._end.is_set():
            ready, _, _ = select.select([self.master], [], [], 0.002)
            if self.held.is_set():  # asked after the wait: what was sent once it is set gets no answer
                time.sleep(0.002)
                continue
            now = time.monotonic()
            if ready:
                data = os.read(self.master, 4096)
                self.received += data
                self.board.receive(data, now)
            out = self.board.advance(now)
            if out:
                self._send(out)

    def _send(self, data):
        """What there is room for: a line waits for nobody, nor may the end of a test wait for a reader."""
        with contextlib.suppress(BlockingIOError):
            os.write(self.master, data)

    def unplug(self):
        self._end.set()
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive(), "the fake board hangs"
        os.close(self.slave)
        os.close(self.master)
        self.unplugged.set()

    def close(self):
        if not self.unplugged.is_set():
            self.unplug()


@pytest.fixture
def prompt():
    """For tests of silence: driver and board keep their own limits."""


@pytest.fixture
def patient(request, monkeypatch):
    """Driver and fake board bear a silence of any length, or a busy computer would drop a test's command."""
    if "prompt" not in request.fixturenames:
        for limit in ("LATE_S", "STALE_S", "PAUSE_S"):
            monkeypatch.setattr(session, limit, PATIENCE_S)
        monkeypatch.setattr(FakeBoard, "watches", False)


@pytest.fixture
def serve(patient, close_later):
    """Puts a fake board on a pty; call it with a board, or with the arguments of FakeBoard."""

    def start(board=None, **kwargs):
        served = close_later(PtyBoard(board or FakeBoard(**kwargs)))
        served.board.reset(time.monotonic())
        return served

    return start


class Cable:
    """A link in a folder that leads to the board that is plugged in, and is gone while none is, as udev's are.

    Another test may have a pty of the same number by then.
    """

    def __init__(self, serve, path):
        self.serve, self.path = serve, str(path)
        self.plug()

    def plug(self, **board):
        self.port = self.serve(**board)
        os.symlink(self.port.path, self.path + ".new")
        os.replace(self.path + ".new", self.path)

    def unplug(self):
        os.remove(self.path)
        self.port.unplug()


@pytest.fixture
def cable(serve, tmp_path):
    return Cable(serve, tmp_path / "robot")


@pytest.fixture
def line():
    line = Line()
    yield line
    line.open.set()


@pytest.fixture
def mrl_sim():
    """Starts an emulator process; call it with its options, it returns the port's path."""
    started = []

    def start(*args):
        command = [sys.executable, "-m", "sim_arduino.serve.main", *map(str, args)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        started.append(process)
        path = process.stdout.readline().strip()
        assert path.startswith("/dev/")
        start.process = process
        return path

    yield start
    for process in started:
        process.send_signal(signal.SIGCONT)
        process.terminate()
        process.wait(PATIENCE_S)
        process.stdout.close()
