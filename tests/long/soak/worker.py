"""A user's program that drives a robot and takes orders on stdin, one a line; it answers on stdout in JSON.

keep LINEAR ANGULAR   command these speeds 20 times a second
once LINEAR ANGULAR   command them once
silent                command nothing any more; the program lives on
hang SECONDS          do nothing at all for so long; the driver's own thread goes on
stop                  stop
record FILE           begin a recording
unrecord              end it
flood COUNT           send so many requests as fast as possible
clock SECONDS         set the program's wall clock this much ahead
reopen COUNT          close the driver while it reads, and connect again
state                 what the driver says, and what the process holds
end                   close the driver and end
"""

import json
import math
import os
import resource
import select
import sys
import threading
import time
from contextlib import suppress
from typing import Any, Dict, Optional, Tuple

from mrl_driver.driver import Driver, Options
from mrl_driver.errors import MrlError
from mrl_driver.geometry import ORIGIN
from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import QUANTUM_COUNTS
from mrl_driver.robot.robot_state import Telemetry, fastest_m_s

PERIOD_S = 0.05
SLACK_S = 0.002
"""What odometry allows beyond the board's time between two readings [s]."""


def held() -> Dict[str, int]:
    """What this process holds: memory in RAM [kB], descriptors, threads."""
    with open("/proc/self/statm", encoding="ascii") as file:
        pages = int(file.read().split()[1])
    return {
        "memory_kb": pages * resource.getpagesize() // 1024,
        "descriptors": len(os.listdir("/proc/self/fd")),
        "threads": threading.active_count(),
    }


class Jumps:
    """Compares each step of the pose with what the wheels can do in the time."""

    def __init__(self) -> None:
        model = load("traxbot")
        self._fastest_m_s = fastest_m_s(model)
        self._quantum_m = QUANTUM_COUNTS * model.base.metres_per_count
        self._pose, self._time_s = ORIGIN, math.nan
        self.farthest_m = -math.inf

    def begin_anew(self) -> None:
        """Another driver begins, at the origin."""
        self._pose, self._time_s = ORIGIN, math.nan

    def see(self, telemetry: Telemetry) -> None:
        """Judge one step."""
        pose, time_s = telemetry.pose, telemetry.stamp_s
        if time_s > self._time_s:
            reach_m = self._fastest_m_s * (time_s - self._time_s + SLACK_S) + self._quantum_m
            self.farthest_m = max(self.farthest_m, math.dist(pose[:2], self._pose[:2]) - reach_m)
        self._pose, self._time_s = pose, time_s


class Worker:
    """One driver and its user."""

    def __init__(self, port: str, timeout_s: Optional[float]) -> None:
        self._port, self._options = port, Options(reconnect=True, command_timeout_s=timeout_s)
        self.jumps = Jumps()
        self._speeds: Optional[Tuple[float, float]] = None
        self._due_s = self._last_s = 0.0
        self._rest = b""
        self._driver = self._connect()

    def _connect(self) -> Driver:
        driver = Driver(self._port, options=self._options)
        self.jumps.begin_anew()
        driver.on_telemetry(self.jumps.see)
        driver.on_event(lambda event: say(event=type(event).__name__))
        driver.connect()
        return driver

    def run(self) -> None:
        """Obey until `end`, or the end of stdin."""
        say(ready=True)
        while True:
            left_s = max(0.0, self._due_s - time.monotonic()) if self._speeds else 1.0
            if select.select([0], [], [], left_s)[0]:
                data = os.read(0, 4096)
                *lines, self._rest = (self._rest + data).split(b"\n")
                if not data or not all(map(self._obey, lines)):
                    break
            if self._speeds and time.monotonic() >= self._due_s:
                self._last_s = time.monotonic()
                self._due_s = self._last_s + PERIOD_S
                self._driver.drive(*self._speeds)
        self._driver.close()
        say(closed=True, jump_m=self.jumps.farthest_m)

    def _obey(self, line: bytes) -> bool:
        word, *values = line.decode().split()
        before_s = time.monotonic()
        answer: Dict[str, Any] = {}
        if word == "end":
            return False
        if word == "keep":
            self._speeds = (float(values[0]), float(values[1]))
        elif word == "once":
            self._speeds, answer["taken"] = None, self._driver.drive(float(values[0]), float(values[1]))
        elif word in ("silent", "stop"):
            self._speeds = None
            if word == "stop":
                self._driver.stop()
        elif word == "hang":
            self._speeds = None
            time.sleep(float(values[0]))
        elif word == "record":
            with suppress(MrlError):
                self._driver.start_recording(values[0])
        elif word == "unrecord":
            with suppress(MrlError):
                self._driver.stop_recording()
        elif word == "flood":
            for _ in range(int(values[0])):
                with suppress(MrlError):
                    self._driver.request(30)
        elif word == "clock":
            real, ahead_s = time.monotonic, float(values[0])
            offset_s = time.time() - real()
            time.time = lambda: real() + offset_s + ahead_s
        elif word == "reopen":
            answer["close_s"] = 0.0
            for _ in range(int(values[0])):
                begun_s = time.monotonic()
                self._driver.close()
                answer["close_s"] = max(answer["close_s"], time.monotonic() - begun_s)
                self._driver = self._connect()
        elif word == "state":
            answer.update(held(), **self._state())
        say(done=word, took_s=time.monotonic() - before_s, at_s=time.monotonic(), **answer)
        return True

    def _state(self) -> Dict[str, Any]:
        driver, counters = self._driver, self._driver.statistics
        return {
            "is_ready": driver.ready,
            "stopped": driver.stopped,
            "reason": driver.stop_reason,
            "last_s": self._last_s,
            "age_s": driver.age_s,
            "jump_m": self.jumps.farthest_m,
            "frames": counters.frames,
            "lost": counters.lost,
            "blocked": counters.blocked_writes,
            "garbage": sum(counters.garbage.values()),
        }


def say(**what: Any) -> None:
    """One line for the soak."""
    os.write(1, json.dumps(what).encode() + b"\n")


if __name__ == "__main__":
    Worker(sys.argv[1], float(sys.argv[2]) or None).run()
