"""The driver's thread: it reads the port, sends what is due, searches a lost port, and stops the robot at the end."""

import contextlib
import math
import threading
import time
from typing import List, Optional, Union

from mrl_driver.errors import BoardError, BoardTimeout, LinkLost, MrlError, WrongRobot
from mrl_driver.protocol.table import BAUD, BY_NAME
from mrl_driver.recording.recorded_link import DriverRecording
from mrl_driver.robot.robot_state import Notice
from mrl_driver.session.events import Lost, Reconnected, Slowed
from mrl_driver.session.session import PAUSE_S
from mrl_driver.transport import fork_guard
from mrl_driver.transport.baud_upgrade import BACK_S, speed_up
from mrl_driver.transport.link import Link
from mrl_driver.transport.open_link import AGAIN_S, CONNECT_S, open_link
from mrl_driver.transport.reconnect import LOOK_S, Reconnection

from .options import Options
from .readout import Readout
from .robot_core import Core

CLOCK_BOOTTIME = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
ERRORS, ERROR_SHARE = 20, 100
"""A raised line goes back to 115200 after more than `ERRORS` damaged pieces plus one per `ERROR_SHARE` frames."""
CLOSE_S = 0.8
"""The stop at the end waits at most this long for telemetry to confirm it [s]."""


class Runner(Readout):
    """Serves `port` from `_begin` until it is closed or fails.  Other modules use it through `Driver`."""

    def __init__(self, core: Core, port: Union[str, Link], baud: int, options: Options) -> None:
        super().__init__(core)
        self._port, self._baud, self._options = port, baud, options
        self._changed = threading.Condition(self._lock)
        self._settled = threading.Event()
        self._link: Optional[Link] = None
        self._trial: Optional[Link] = None
        self._thread: Optional[threading.Thread] = None
        self._beginning = self._closing = False
        self._asking = 0
        self._settling = True
        self._broken: Optional[LinkLost] = None
        self._reconnection: Optional[Reconnection] = None
        self._tape: Optional[DriverRecording] = None
        self._slept_s = slept_s()
        self._fast, self._well_s, self._errors = False, 0.0, 0

    def _begin(self) -> None:
        """Open the port and greet the board; `_settled` is set when the greeting is complete or has failed."""
        self._beginning = True
        try:
            link = self._first_link()
            if self._options.reconnect and not isinstance(self._port, Link):
                self._reconnection = Reconnection(self._port, self._open, self._options.greeting_s)
            self._start(link)
        finally:
            self._beginning = False
        fork_guard.leave_to_parent(self._abandon)

    def _start(self, link: Link) -> None:
        """Start the session and the thread, unless the driver was closed while the port opened."""
        with self._lock:
            if not self._closing:
                self._link = link
                self._core.begin(time.monotonic())
                self._thread = threading.Thread(target=self._run, name="mrl-driver", daemon=True)
                self._thread.start()
                return
        link.close()
        self._end_tape()
        raise LinkLost("the driver was closed while it connected")

    def _run(self) -> None:
        try:
            while not self._closing:
                self._turn()
        except MrlError as error:
            self._give_up(error)
        finally:
            if not self._closing and self._error is None:
                self._give_up(
                    MrlError("a callback raised; the driver has ended and sent a stop to the robot")
                )

    def _turn(self) -> None:
        """Serve the link if there is one; otherwise search it."""
        try:
            if self._link is None:
                self._seek()
            else:
                self._cycle(self._link)
        except LinkLost as error:
            self._lose(error)
        except BoardError as error:
            if self._reconnection is None or not self._reconnection.searching:
                raise
            self._lose(error)

    def _cycle(self, link: Link) -> None:
        core = self._core
        data = link.read(min(1.0, core.due_s - time.monotonic()))
        now = time.monotonic()
        with self._lock:
            if self._closing:
                with contextlib.suppress(BoardError):
                    core.turn(data, now)  # what is recorded counts as well
                return
            if self._broken is not None:
                raise self._broken
            self._notice_sleep(now)
            notices = core.turn(data, now)
            if self._tape is not None:
                self._tape.note(core.session.checked)
            if self._reconnection is not None and self._reconnection.searching:
                notices += self._judge(self._reconnection, now)
            self._send()
            if self._asking:
                self._changed.notify_all()
            if self._fast:
                notices += self._watch_speed(link, now)
        if self._settling and core.state.telemetry is not None:
            self._settling = False
            self._settled.set()
        self._call(notices)

    def _watch_speed(self, link: Link, now: float) -> List[Notice]:
        """Go back to 115200 Bd if the line fails at the higher speed; the board does the same by itself."""
        session = self._core.session
        errors = sum(session.counters.garbage.values())
        if self._errors < 0:
            self._errors = errors
        if session.ready:
            self._well_s = now
        most = session.counters.frames // ERROR_SHARE + ERRORS
        if now - self._well_s <= BACK_S and errors - self._errors <= most:
            return []
        self._fast = False
        link.set_baud(BAUD)
        return [("state", Slowed(BAUD))]

    def _notice_sleep(self, now: float) -> None:
        """Stop the robot if the machine was suspended; the driver's clock does not count that time."""
        before, self._slept_s = self._slept_s, slept_s()
        if self._slept_s > before + PAUSE_S and self.command is not None:
            self._core.stop(now, "host_paused")

    # -- links

    def _first_link(self) -> Link:
        if isinstance(self._port, Link):
            return self._port
        record, tap = self._options.record, self._options.tap
        if record is not None or tap is not None:
            self._tape = DriverRecording(record, self._port, self._baud, tap)
        try:
            return self._open(self._port, CONNECT_S)
        except BaseException:
            self._end_tape()
            raise

    def _open(self, name: str, patience_s: float = AGAIN_S) -> Link:
        opener = self._tape.open if self._tape is not None else open_link
        link = opener(name, self._baud, patience_s)
        try:
            self._fast = self._options.fast and self._speed_up(link)
        except BaseException:
            link.close()
            raise
        self._well_s, self._errors = time.monotonic(), -1
        return link

    def _speed_up(self, link: Link) -> bool:
        """Call `speed_up`.  It takes seconds if nothing answers, so `close` may interrupt it through `_trial`."""
        with self._lock:
            if self._closing:
                raise LinkLost("the driver was closed")
            self._trial = link
        try:
            return speed_up(link)
        finally:
            self._trial = None

    def _end_tape(self) -> None:
        if self._tape is not None:
            self._tape.close()

    def _lose(self, error: MrlError) -> None:
        """Drop the link and start the search; raise `error` if the driver does not reconnect."""
        now = time.monotonic()
        with self._lock:
            reconnection, link = self._searchable(), self._link
            if reconnection is None or link is None:
                raise error
            self._link = self._broken = None
            self._core.session.lose(now)
            first, may_move = reconnection.lose(error, now), self._core.session.may_be_moving
        link.close()
        if first:
            self._call([("state", Lost(reconnection.port, str(error), may_move))])

    def _searchable(self) -> Optional[Reconnection]:
        """The search for a lost port; None before the first connection, or if the driver does not reconnect."""
        was_there = self._settled.is_set() and not self._closing and self._error is None
        return self._reconnection if was_there else None

    def _seek(self) -> None:
        """Look for the port once.  If it is found, the following cycles greet the robot on it."""
        reconnection = self._reconnection
        assert reconnection is not None
        with self._changed:
            if self._changed.wait_for(lambda: self._closing, LOOK_S):
                return
        link = reconnection.look()
        if link is None:
            return
        with self._lock:
            if self._closing:
                link.close()
                return
            self._core.session.relink(time.monotonic(), reconnection.same_board)
            self._link, self._core.due_s = link, -math.inf

    def _judge(self, reconnection: Reconnection, now: float) -> List[Notice]:
        """Check that the robot on the new link is the one that was lost.

        Raises:
            WrongRobot: another robot answers; its session was ended.
        """
        session = self._core.session
        try:
            if not reconnection.judge(session.ready, now):
                return []
        except WrongRobot:
            session.end()
            self._send()
            raise
        session.counters.reconnects += 1
        return [("state", Reconnected(reconnection.port))]

    # -- what is sent

    def _connected(self) -> Core:
        if self._error is not None:
            raise self._error
        if not self._core.begun or self._closing:
            raise LinkLost("the driver is not connected, or was closed")
        return self._core

    def _flush(self) -> None:
        """Send the session's bytes, and wake the reading thread if something is now due earlier."""
        self._send()
        if threading.current_thread() is not self._thread:
            self._wake()

    def _send(self) -> None:
        """Send the session's bytes.  The caller holds the lock, so that frames never mix."""
        session = self._core.session
        data = session.take()
        if data and self._link is not None:
            try:
                self._link.write(data)
            except BoardTimeout:
                session.counters.blocked_writes += 1
            except LinkLost as error:
                if self._searchable() is not None:
                    self._broken = error
                    self._link.wake()
                elif not self._closing:
                    self._error = self._error or error
                    self._changed.notify_all()
                    self._link.wake()
                    raise

    def _wake(self) -> None:
        """Wake the reading thread if something is due before it would wake up."""
        if self._link is not None and self._core.session.deadline(time.monotonic()) < self._core.due_s:
            self._link.wake()

    # -- the end

    def _say_goodbye(self, wait: bool) -> None:
        """Stop the robot, wait for the confirmation, and set the board back to what a 2013 host expects.

        Without `wait` the caller is the reading thread itself, so this method reads the link.
        """
        try:
            with self._lock:
                core = self._connected()
                core.leaving = True
                core.session.stop(time.monotonic(), "closed")
                self._flush()
            if not wait:
                self._halt()
            deadline = time.monotonic() + CLOSE_S
            while wait and self.ready and not self.stopped and time.monotonic() < deadline:
                time.sleep(0.01)
            with self._lock:
                if not self.stopped:  # telemetry may not confirm the stop any more, so send it again
                    core.session.stop(time.monotonic(), "closed")
                core.session.end()
                if self._fast:
                    core.session.request(BY_NAME["set_baud"].code, 0)
                self._flush()
        except MrlError:
            return

    def _give_up(self, error: MrlError) -> None:
        try:
            self._halt()
        except MrlError:
            return
        finally:
            self._fail(error)

    def _halt(self) -> None:
        """Stop the robot and repeat the stop until telemetry confirms it; 2013 boards have no watchdog to do it."""
        core, link = self._core, self._link
        session = core.session
        with self._lock:
            core.leaving = True
            session.stop(time.monotonic(), "closed")
            self._flush()
        deadline = time.monotonic() + CLOSE_S
        while link is not None and session.ready and session.motion.stopping and time.monotonic() < deadline:
            data = link.read(min(core.due_s, deadline) - time.monotonic())
            with self._lock:
                core.turn(data, time.monotonic())
                self._send()

    def _fail(self, error: MrlError) -> None:
        with self._changed:
            if self._closing:
                return
            self._error = error
            self._changed.notify_all()
        self._settled.set()
        self._call([("state", error)])

    def _abandon(self) -> None:
        """Run in a forked child: the parent keeps the robot.  Here the driver is closed, and each call raises why."""
        self._lock = threading.RLock()
        self._changed, self._settled = threading.Condition(self._lock), threading.Event()
        self._link = self._trial = self._thread = self._reconnection = self._tape = None
        self._closing = True
        self._error = LinkLost(
            "this process was forked from the one that drives the robot; connect in one of them"
        )


def slept_s() -> float:
    """Total time that the machine was suspended since its start [s]."""
    return time.clock_gettime(CLOCK_BOOTTIME) - time.monotonic()
