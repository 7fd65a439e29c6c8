"""Serves engines on ports in real time.  A server owns its board's clock; a port owns its descriptors.

`PtyServer` serves one board; `serve_together` serves many in one thread.
"""

import contextlib
import json
import math
import os
import select
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Protocol, Sequence, TextIO

from mrl_driver.errors import ConfigError
from mrl_driver.program import handle_end_signals
from mrl_driver.protocol.table import BAUD
from sim_arduino.board.engine import Engine
from sim_arduino.hardware.wiring import Plant

from .control import Control
from .socket_port import BoardPort, read_all

HEARTBEAT_S = 0.1  # longest wait; if a pause is longer than requested, this process has stalled
STALL_S = 0.25
TRUTH_PERIOD_S = 0.05
CLOSE_WAIT_S = 1.0
"""Time that a board waits at its end for the host to close the port [s]: roslaunch ends both at the same time, and
without the wait, the host would report a lost link."""
SLOWEST, FASTEST = 0.01, 1000.0
_PACKET_BYTES, _PACKET_S = 64, 0.002
_BYTE_BITS = 10
_LINK_AHEAD_S = 0.002
"""If the host's bytes are further ahead of the serial link than this, they stay in the pty."""
ROUND_S = 0.001
"""Shortest time between two rounds of many boards [s]: a USB host, too, asks its devices once in a millisecond."""


class Watcher(Protocol):
    """An object that looks at the robot from time to time."""

    due_s: float  # time of the next look, in the board's time [s]

    def look(self, now_s: float) -> None:
        """Looks at the robot, and sets the next `due_s`."""


class Waker:
    """Ends the wait of a server's thread; may be used from a signal handler or another thread."""

    def __init__(self) -> None:
        self.fd, self._end = os.pipe()
        os.set_blocking(self.fd, False)
        os.set_blocking(self._end, False)

    def wake(self) -> None:
        """Ends the wait at once."""
        with contextlib.suppress(OSError):
            os.write(self._end, b"x")

    def clear(self) -> None:
        """Forgets the calls of `wake` so far."""
        with contextlib.suppress(BlockingIOError):
            os.read(self.fd, 4096)

    def close(self) -> None:
        """Frees the descriptors."""
        end, self._end = self._end, -1
        os.close(end)
        os.close(self.fd)


class PtyServer:
    """Connects an engine and a port until `stop` is called; ConfigError if the speed is out of range.

    Args:
        speed: Factor over real time; if the computer is too slow, as fast as possible.
        truth: File for the plant's true pose as JSON lines, 20 per second.
        log: File for the bytes of both directions as JSON lines.
        reset_on_open: Opening the port resets the board, as the DTR line of an Uno does.
        waker: Of the thread that serves this board among others; by default the server has its own.
    """

    def __init__(
        self,
        engine: Engine,
        port: BoardPort,
        plant: Optional[Plant] = None,
        truth: Optional[TextIO] = None,
        log: Optional[TextIO] = None,
        reset_on_open: bool = False,
        control: Optional[Control] = None,
        speed: float = 1.0,
        watchers: Sequence[Watcher] = (),
        waker: Optional[Waker] = None,
    ) -> None:
        if not SLOWEST <= speed <= FASTEST:
            raise ConfigError(f"speed is {speed!r}, expected {SLOWEST:g} to {FASTEST:g} times real time")
        self.lock = threading.RLock()
        """Held while the board runs; take it to look at the board from another thread."""
        self._speed, self._watchers = speed, watchers
        self._engine, self._port, self._plant = engine, port, plant
        self._truth, self._log = truth, log
        self._radio = plant.xbee if plant else None
        self._reset_on_open, self._control = reset_on_open, control
        self.waker = Waker() if waker is None else waker
        self._start_s = time.monotonic()
        self._now_s = self._expected_s = 0.0
        self._link_free_s = 0.0
        self._held, self._baud = b"", BAUD
        self._truth_due_s = 0.0 if truth and plant else float("inf")
        self._end_s = math.inf  # time at which the serving ends at the latest [s, of the monotonic clock]
        self.running = True  # false after `stop`
        self.watched: List[int] = []  # descriptors of which one is readable when `step` has something to do
        self.due_s = 0.0  # time of the next `step` if none of them is [s, of the monotonic clock]
        if self._radio:
            self._radio.live, self._radio.on_arrival = True, self.wake

    def stop(self) -> None:
        """Ends the serving; may be called from a signal handler or another thread."""
        self.running = False
        self.wake()

    def end(self) -> None:
        """Ends the serving when no program has the port open, or after `CLOSE_WAIT_S`; at once if called again.

        May be called from a signal handler or another thread.
        """
        if self._end_s < math.inf:
            self.running = False
        self._end_s = time.monotonic() + CLOSE_WAIT_S
        self.wake()

    def wake(self) -> None:
        """Makes the board run up to now at once; may be called from a signal handler or another thread."""
        self.waker.wake()

    def run(self) -> None:
        """Serves until `stop`."""
        try:
            while self.running:
                self.step()
                wait([self], self.waker, 0.0)
        finally:
            self.waker.close()

    def step(self) -> None:
        """Takes what the host has sent, runs the board to now, and sets `watched` and `due_s`."""
        with self.lock:
            self._read_clock()
            if self._radio:
                self._radio.poll()
            if self._port.newly_opened() and self._reset_on_open:
                self._advance()
                self._engine.reset()
            if self._link_ready():
                self._take_input()
            self._advance()
            if self._control:
                self._control.attend(self._port)
            self._run_watchers()
            self._plan()
            if self._end_s < math.inf and not (self._port.is_open and time.monotonic() < self._end_s):
                self.running = False

    def _run_watchers(self) -> None:
        if self._now_s >= self._truth_due_s:
            self._write_truth()
        for watcher in self._watchers:
            if self._now_s >= watcher.due_s:
                watcher.look(self._now_s)

    def _read_clock(self) -> None:
        """Reads the clock.

        If this process has stalled, the board gets the same gap at speed 1; at another speed its time slows down.
        """
        self._now_s = (time.monotonic() - self._start_s) * self._speed
        late_s = self._now_s - self._expected_s
        if self._speed != 1.0 and late_s > HEARTBEAT_S:
            self._start_s += (late_s - HEARTBEAT_S) / self._speed
            self._now_s -= late_s - HEARTBEAT_S
        elif late_s > STALL_S:
            waiting = read_all(self._port)
            self._write_log("stalled", waiting)
            self._engine.gap(self._now_s, waiting)
        self._expected_s = self._now_s

    def _plan(self) -> None:
        """Sets `watched` and `due_s`."""
        until = min(self._engine.next_event_s, self._truth_due_s, self._now_s + HEARTBEAT_S * self._speed)
        until = min([until, *(watcher.due_s for watcher in self._watchers)])
        watched = [self._port.watch, self._control.fd if self._control else None]
        if self._radio:
            watched.append(self._radio.fileno())
        if self._link_ready():
            watched.append(self._port.master)
        else:
            until = min(until, self._link_free_s - _LINK_AHEAD_S)
        self.watched = [fd for fd in watched if fd is not None]
        self._expected_s = max(until, self._now_s)
        self.due_s = self._start_s + self._expected_s / self._speed

    def _link_ready(self) -> bool:
        return self._link_free_s - _LINK_AHEAD_S <= self._now_s

    def _follow_baud(self) -> None:
        """Passes the baud rate that the host has set to the engine."""
        baud = self._port.baud
        if baud != self._baud:
            self._advance()
            self._baud = baud
            getattr(self._engine, "set_host_baud", lambda _: None)(float(baud))

    def _take_input(self) -> None:
        self._follow_baud()
        data = self._port.read()
        if data:
            self._advance()
            self._engine.receive(data)
            self._link_free_s = max(self._link_free_s, self._now_s) + len(data) * _BYTE_BITS / self._baud
            self._write_log("host", data)

    def _advance(self) -> None:
        """Runs the board up to now.  Its bytes are sent in whole lines, as a USB bridge sends packets."""
        self._held += self._engine.advance(self._now_s)
        if self._held and (
            self._held.endswith(b"\n")
            or len(self._held) >= _PACKET_BYTES
            or self._engine.next_event_s > self._now_s + _PACKET_S
        ):
            self._port.write(self._held)
            self._write_log("board", self._held)
            self._held = b""

    def _write_truth(self) -> None:
        assert self._plant and self._truth
        pose = self._plant.true_pose
        self._truth_due_s = max(self._truth_due_s + TRUTH_PERIOD_S, self._now_s)
        now_s, host_s = round(self._now_s, 6), round(self._start_s + self._now_s / self._speed, 6)
        place = {"x": pose.x_m, "y": pose.y_m, "yaw": pose.yaw_rad}
        _append(self._truth, {"t": now_s, **place, "host_monotonic": host_s})

    def _write_log(self, source: str, data: bytes) -> None:
        if self._log:
            _append(self._log, {"t": round(self._now_s, 6), "from": source, "bytes": data.decode("latin-1")})


def wait(servers: Sequence[PtyServer], waker: Waker, least_s: float) -> List[PtyServer]:
    """Waits until a server has something to do, at least `least_s` [s] unless a descriptor is readable.

    Returns the servers to step: those that are due or have something to read; all of them after `waker.wake`.
    """
    watched = [fd for server in servers for fd in server.watched]
    first_s = min([server.due_s for server in servers], default=0.0)
    ready, _, _ = select.select([waker.fd, *watched], [], [], max(least_s, first_s - time.monotonic()))
    if waker.fd in ready:
        waker.clear()
        return list(servers)
    now_s, found = time.monotonic(), set(ready)
    return [each for each in servers if each.due_s <= now_s or not found.isdisjoint(each.watched)]


def serve_together(
    servers: Sequence[PtyServer], waker: Waker, failed: Callable[[PtyServer, Exception], None]
) -> List[Exception]:
    """Serves many boards in one thread, until all are stopped; returns the errors of those that failed.

    All have this `waker`.  `failed` is called with a server whose board has failed, and its error; the others run on.
    """
    running, due = list(servers), list(servers)
    errors: List[Exception] = []
    while running:
        for server in due:
            try:
                if server.running:
                    server.step()
            except Exception as error:  # noqa: BLE001 - one board does not end the others
                server.running = False
                errors.append(error)
                failed(server, error)
        running = [server for server in running if server.running]
        if running:
            due = wait(running, waker, ROUND_S if len(running) > 1 else 0.0)
    return errors


def on_signals(ends: Sequence[Callable[[], None]]) -> None:
    """Calls these functions at each signal that ends a program."""

    def end(*_: Any) -> None:
        for each in ends:
            each()

    handle_end_signals(end, even_ignored=True)


def _append(file: TextIO, row: Dict[str, Any]) -> None:
    """Appends a line; a full disk never stops the board."""
    with contextlib.suppress(OSError):
        file.write(json.dumps(row) + "\n")
        file.flush()
