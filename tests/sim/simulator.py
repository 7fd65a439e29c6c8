"""A running `mrl-sim` and a program at the other end of its port."""

import os
import select
import signal
import subprocess
import sys
import time
from typing import Any

from tests.waiting import PATIENCE_S

AGAIN_S = 3.0


class Simulator:
    """`mrl-sim` with options, ready; a context manager that ends it."""

    def __init__(self, *options: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "sim_arduino.serve.main", *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout
        self.path = self.process.stdout.readline().strip()
        assert self.path, self.process.stderr.read()

    def __enter__(self) -> "Simulator":
        return self

    def __exit__(self, *_: Any) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()

    def order(self, line: str) -> None:
        assert self.process.stdin
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def end(self, number: int = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)


class Client:
    """A program that has a port open."""

    def __init__(self, path: str) -> None:
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: Any) -> None:
        os.close(self.fd)

    def send(self, data: bytes) -> None:
        os.write(self.fd, data)

    def read(self, seconds: float) -> bytes:
        """Everything that comes within a time."""
        out, end = b"", time.monotonic() + seconds
        while select.select([self.fd], [], [], max(0.0, end - time.monotonic()))[0]:
            out += os.read(self.fd, 65536)
        return out

    def read_until(self, mark: bytes) -> bytes:
        """What comes up to and including a mark."""
        out, end = b"", time.monotonic() + PATIENCE_S
        while mark not in out:
            assert select.select([self.fd], [], [], max(0.0, end - time.monotonic()))[0], out[-200:]
            out += os.read(self.fd, 65536)
        return out

    def read_until_quiet(self, seconds: float = 0.3) -> None:
        """Drops what comes until nothing has come for a time."""
        end = time.monotonic() + PATIENCE_S
        while self.read(seconds):
            assert time.monotonic() < end

    def ask_until(self, request: bytes, beginning: bytes) -> bytes:
        """Repeats a request until a line that begins so has come; what came up to that line's end."""
        out, end = b"", time.monotonic() + PATIENCE_S
        while True:
            if time.monotonic() > end:
                raise AssertionError(f"no line that begins with {beginning!r}, got {out[-200:]!r}")
            self.send(request)
            out += self.read(0.1)
            at = out.find(beginning)
            if at >= 0 and b"\n" in out[at:]:
                return out[: out.index(b"\n", at) + 1]

    def ask(self, request: bytes) -> bytes:
        """The answer; asked again where the board has missed the request, as after a stall of its process."""
        for _ in range(int(PATIENCE_S / AGAIN_S)):
            self.send(request)
            if select.select([self.fd], [], [], AGAIN_S)[0]:
                break
        return self.read_until(b"\n")
