"""A user's program that drives a robot and takes orders on stdin, one a line; it answers on stdout in JSON.

Each order is a method of `Worker`; `end` closes the driver and ends.
"""

import json
import os
import select
import sys
import time
from contextlib import suppress
from typing import Any, Dict, Optional

from mrl_driver.driver import Driver, Options
from mrl_driver.errors import MrlError
from mrl_driver.robot.models import load
from mrl_driver.robot.robot_state import Telemetry
from tests.long.jumps import Jumps

PERIOD_S = 0.05


class Obedient:
    """Carries out orders, and repeats what is wanted every 50 ms in between."""

    wanted: Any = None
    due_s = 0.0
    last_s = 0.0  # When the last command was given

    def run(self) -> None:
        """Obey until `end`, or the end of stdin."""
        rest = b""
        while True:
            left_s = max(0.0, self.due_s - time.monotonic()) if self.wanted else 1.0
            if select.select([0], [], [], left_s)[0]:
                data = os.read(0, 4096)
                *lines, rest = (rest + data).split(b"\n")
                if not data or not all(map(self._obey, lines)):
                    break
            if self.wanted and time.monotonic() >= self.due_s:
                self.due_s = time.monotonic() + PERIOD_S
                self.command()

    def _obey(self, line: bytes) -> bool:
        word, *values = line.decode().split()
        if word == "end":
            return False
        answer = getattr(self, word)(*values) or {}
        say(done=word, at_s=time.monotonic(), last_s=self.last_s, **answer)
        return True

    def command(self) -> None:
        raise NotImplementedError

    def silent(self) -> None:
        """Command nothing any more; the program lives on."""
        self.wanted = None


class Worker(Obedient):
    """One driver and its user."""

    def __init__(self, port: str, timeout_s: Optional[float]) -> None:
        self._port, self._options = port, Options(reconnect=True, command_timeout_s=timeout_s)
        self._jumps = Jumps.of(load("traxbot"))
        self._driver = self._connect()

    def _connect(self) -> Driver:
        driver = Driver(self._port, options=self._options)
        self._jumps.begin_anew()
        driver.on_telemetry(self._see)
        driver.on_event(lambda event: say(event=type(event).__name__))
        driver.connect()
        return driver

    def _see(self, telemetry: Telemetry) -> None:
        if telemetry.stamp_s > self._jumps.used_s:
            self._jumps.see(telemetry.pose, telemetry.stamp_s)

    def run(self) -> None:
        """Obey, and close the driver."""
        say(ready=True)
        super().run()
        self._driver.close()
        say(closed=True, jump_m=self._jumps.farthest_m)

    def command(self) -> None:
        self.last_s = time.monotonic()
        self._driver.drive(*self.wanted)

    def keep(self, linear: str, angular: str) -> None:
        """Command these speeds 20 times a second."""
        self.wanted = float(linear), float(angular)

    def once(self, linear: str, angular: str) -> None:
        self.wanted = None
        self._driver.drive(float(linear), float(angular))

    def stop(self) -> None:
        self.wanted = None
        self._driver.stop()

    def record(self, path: str) -> None:
        with suppress(MrlError):
            self._driver.recorder.start(path)

    def unrecord(self) -> None:
        with suppress(MrlError):
            self._driver.recorder.stop()

    def flood(self, most: str) -> Dict[str, int]:
        """Send until ten writes are blocked; return how many were."""
        counted = self._driver.link.statistics.blocked_writes
        for _ in range(int(most)):
            with suppress(MrlError):
                self._driver.request(30)
            if self._driver.link.statistics.blocked_writes >= counted + 10:
                break
        return {"blocked": self._driver.link.statistics.blocked_writes - counted}

    def reopen(self, count: str) -> Dict[str, Any]:
        """Close the driver while it reads, and connect again."""
        close_s = 0.0
        for _ in range(int(count)):
            begun_s = time.monotonic()
            self._driver.close()
            close_s = max(close_s, time.monotonic() - begun_s)
            self._driver = self._connect()
        return {"close_s": close_s}

    def state(self) -> Dict[str, Any]:
        driver = self._driver
        frames = driver.link.statistics.frames
        return {"is_ready": driver.ready, "age_s": driver.link.age_s, "frames": frames}


def say(**what: Any) -> None:
    os.write(1, json.dumps(what).encode() + b"\n")


if __name__ == "__main__":
    Worker(sys.argv[1], float(sys.argv[2]) or None).run()
