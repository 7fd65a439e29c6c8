"""The connection of one driver: its lock, its reading thread, the bytes that are written, and the end.

`Driver`, and the objects that it offers, call it from any thread.  Only the reading thread reads.  `lock_order` has the
threads and the order of the locks.
"""

import atexit
import contextlib
import math
import threading
import time
from typing import Any, Callable, Dict, Iterator, List, NoReturn, Optional, Sequence, Tuple

from mrl_driver.arguments import require_function, require_whole
from mrl_driver.clocks import BOOT_CLOCK, wait_until
from mrl_driver.errors import (
    BoardError,
    BoardTimeout,
    ConfigError,
    FrameError,
    LinkLost,
    MrlError,
    WrongRobot,
    shortages,
)
from mrl_driver.lock_order import new_lock
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BAUD, BY_NAME, STOP_CODE
from mrl_driver.recording.recorded_link import inner
from mrl_driver.recording.recording import CLOSED, ENDED, RECONNECTED, SLOWED, now_s
from mrl_driver.robot.imu import Imu
from mrl_driver.robot.radio import RadioText
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.session.events import Lost, SensorRead, Slowed, Status
from mrl_driver.session.handshake import Board
from mrl_driver.session.session import PAUSE_S, TURNING
from mrl_driver.transport import fork_guard
from mrl_driver.transport.baud_rates import FAST_BAUD
from mrl_driver.transport.link import WRITE_TIMEOUT_S, Link
from mrl_driver.transport.reconnect import LOOK_S

from .link_source import LinkSource
from .options import require_timeout
from .robot_core import Core, DriverEvent

ATTEMPTS, ANSWER_S = 3, 0.5
"""`ask` sends a request at most this many times and waits this long for each reply [s]."""
CLOSE_S = 0.8  # the stop at the end waits at most this long for telemetry to confirm it [s]
# `request` waits while more bytes than these are on the way to the board, by the baud rate, or queued because the port
# blocks, so that a stop does not wait for many others.
QUEUE_BYTES = 512
BITS = 10  # a byte on the serial line [bit]
CLOSED_EARLY = "the driver was closed while it connected"
FLUSH_S = 1e-3  # at the end, the driver looks this often whether another thread's write is over [s]
Listener = Callable[[Any], None]


def _whole(code: Any, args: Sequence[Any]) -> Tuple[int, Tuple[int, ...]]:
    """Return code and arguments of a request as int; raise FrameError if one is not a whole number."""
    whole = tuple(require_whole(f"argument {n}", value, FrameError) for n, value in enumerate(args, 1))
    return require_whole("code", code, FrameError), whole


def _of_callback(error: BaseException) -> MrlError:
    """Return the error of a driver whose callback has raised this one."""
    failure = MrlError(f"a callback raised {error!r}; the driver has ended and sent a stop to the robot")
    failure.__cause__ = error
    return failure


class Connection:
    """A driver's core on its links.  `connect`, `close`, `wait`, `request`, `ask` and `board` are those of `Driver`.

    Attributes:
        core: the driver without I/O; used with `lock` held.
        links: opens the links, and records them.
        lock, changed: the driver's lock, and the condition that reports what has changed.
        link: the link in use; None while the port is searched.
        thread: the reading thread.
        error: the error that ended the driver, or None.
        closing: the driver is being closed, or was closed.
        identifies: the option `identify`.
        clock: the driver's clock [s].
        listeners, on_state: the callbacks for events of these types, and for all others.
        refusal: why nothing can be sent if there is no `error`.
    """

    refusal = "the driver is not connected, or was closed"

    def __init__(self, core: Core, links: LinkSource, line_baud: int, identifies: bool) -> None:
        self.core, self.links, self.identifies = core, links, identifies
        self.clock: Callable[[], float] = time.monotonic
        self.lock = new_lock("driver")
        self.changed = threading.Condition(self.lock)
        self.link: Optional[Link] = None
        self.thread: Optional[threading.Thread] = None
        self.error: Optional[MrlError] = None
        self._broken: Optional[LinkLost] = None
        self._beginning = self.closing = False
        self.writer: Optional[Tuple[int, Optional[Link]]] = None
        """Thread and link of the write that is under way."""
        self._asking = self.queuing = 0
        self._line_baud, self._line_free_s = line_baud, -math.inf
        """When the line will have carried all that was written [s]."""
        self._settled = False  # telemetry has arrived, or the driver has failed before
        self._seized = False  # a signal handler closes the driver while its own thread holds the lock
        self._slept_s = math.inf
        self.ahead_s: Optional[float] = None
        """Time by which the wall clock is ahead of `now_s`, if it is known [s]."""
        self.on_state: List[Listener] = []
        self.listeners: Dict[type, List[Listener]] = {
            kind: [] for kind in (Telemetry, Imu, Status, Board, SensorRead, RadioText)
        }

    def connect(self) -> None:
        with self.lock:
            if self.thread is not None or self.closing or self._beginning:
                raise MrlError("this driver was connected already; create another one to connect again")
            self._beginning = True
        try:
            self._start(self.links.first(self.report))
        finally:
            self._beginning = False
        fork_guard.leave_to_parent(self._abandon)
        atexit.register(self._end_with_program)
        try:
            with self.changed:
                self.changed.wait_for(lambda: self._settled or self.closing)
        except BaseException:
            self.close()
            raise
        if self.error is not None or self.closing:
            self.close()
            raise self.error or LinkLost(CLOSED_EARLY)

    def _start(self, link: Link) -> None:
        """Start the session and the thread, unless the driver was closed while the port opened."""
        thread = threading.Thread(target=self._run, name="mrl-driver", daemon=True)
        try:
            with self.lock, shortages("the driver cannot start", MrlError):
                if self.closing:
                    raise LinkLost(CLOSED_EARLY)
                self.link = link
                now = now_s()
                if self.links.recording is not None:
                    self.links.recording.new(now)
                self.core.begin(now)
                thread.start()
                self.thread = thread
        except BaseException as error:
            if not isinstance(error, MrlError):  # Ctrl-C: the thread may have begun
                self.closing = True
            self.link = None
            link.close()
            self.links.end_recording()
            raise

    def close(self) -> None:
        self._seized = self._seized or self._holds_lock()
        with self.lock:
            thread = self.thread
            self.closing = self.closing or (thread is None and self._beginning)
        if thread is None:
            if self.closing:
                self.links.close()
            return
        alone = thread is threading.current_thread() or self._holds_lock()
        if not self.closing:
            self._say_goodbye(wait=not alone)
        with self.changed:
            self.closing = True
            self.changed.notify_all()
            link = self.link
        self.links.close()
        if link is not None:
            link.close()
        if not alone:
            thread.join(2 * CLOSE_S)  # not for ever: a callback may be blocked
        self.links.end_recording()
        atexit.unregister(self._end_with_program)

    def close_aside(self) -> None:
        """Close on a thread of its own, and wait for it if possible: the caller may be any code of any thread."""
        closer = threading.Thread(target=self.close, name="mrl-close", daemon=True)
        closer.start()
        if threading.current_thread() is not self.thread and not self._holds_lock():
            closer.join(2 * CLOSE_S)  # not for ever: a callback may wait for a lock of this thread

    def _holds_lock(self) -> bool:
        """Return whether this thread holds the driver's lock: a signal handler runs, which has interrupted it."""
        try:
            self.changed.notify(0)
        except RuntimeError:
            return False
        return True

    def _end_with_program(self) -> None:
        """Close at the end of the program: after an error the driver may still be open, and 2013 boards drive on."""
        self.close()

    def _abandon(self) -> None:
        """Run in a forked child: the parent keeps the robot.  Here the driver is closed, and each call raises why."""
        self.lock = new_lock("driver")
        self.changed = threading.Condition(self.lock)
        self.links.abandon()
        self.link = self.thread = None
        self.closing = True
        self.error = LinkLost("this process was forked from the one with the robot; connect in one of them")

    def wait(self, timeout_s: Optional[float] = None) -> bool:
        with self.stop_if_refused():
            timeout_s = require_timeout("timeout_s", timeout_s)
        if timeout_s is None:
            self._require_other_thread("wait")
        ended = wait_until(
            lambda: self.closing or self.error is not None, math.inf if timeout_s is None else timeout_s
        )
        if self.error is not None:
            raise self.error
        return ended

    def request(self, code: int, *args: int) -> None:
        self.connected()
        with self.stop_if_refused():
            self._request(*_whole(code, args))

    def _request(self, code: int, args: Tuple[int, ...]) -> None:
        core = self.connected()
        session = core.session
        with self.changed:
            self.require_link()
            stops = core.stops
            self._await_line()
            if not self.await_writer(lambda: len(session.out) <= QUEUE_BYTES):
                session.counters.blocked_writes += 1
                return
            if code in TURNING:
                core.require_may_turn(code, self.clock())
                if core.stops != stops:
                    raise MrlError(
                        f"a stop came while request {code} waited for the line: not sent, send it again if needed"
                    )
            core.expire(self.clock())
            if code == STOP_CODE:
                core.stop(self.clock(), StopReason.USER)
            else:
                session.request(code, *args)
        self.flush()

    def ask(self, code: int, *args: int, timeout_s: float = ANSWER_S) -> Tuple[int, ...]:
        with self.stop_if_refused():
            wait_s = require_timeout("timeout_s", timeout_s)
            code, args = _whole(code, args)
        self._require_other_thread("ask")
        for _ in range(ATTEMPTS):
            reply = self._ask_once(code, args, math.inf if wait_s is None else wait_s)
            if reply is not None:
                return reply
        raise BoardTimeout(f"no answer to request {code} in {ATTEMPTS} attempts of {timeout_s} s; try again")

    def _require_other_thread(self, name: str) -> None:
        if threading.current_thread() is self.thread:
            raise MrlError(
                f"{name} is called in a callback, whose thread reads the port: nothing would arrive; call it elsewhere"
            )

    def _ask_once(self, code: int, args: Tuple[int, ...], wait_s: float) -> Optional[Tuple[int, ...]]:
        """Send a request, and return its reply; None if it has not come within this time."""
        core = self.core
        with self.lock:
            core.replies.pop(code, None)
            self._asking += 1
        try:
            self.request(code, *args)
            with self.changed:
                self.changed.wait_for(
                    lambda: core.answer(code, args) or self.error or self.closing,
                    None if wait_s == math.inf else wait_s,
                )
        finally:
            with self.lock:
                self._asking -= 1
        self.connected()
        return core.answer(code, args)

    def exchange_link(self) -> None:
        """Go on with a link that is recorded, or not any more.  Only for the reading thread, with the lock."""
        if self.link is not None:
            self.link = self.links.exchange(self.link, self.core.session, self.core.state)
            self.note_clock()
        self.changed.notify_all()

    def note_clock(self) -> None:
        """Record how far the wall clock is ahead, if that is known."""
        if self.links.recording is not None and self.ahead_s is not None:
            self.links.recording.clock(self.ahead_s)

    def remark(self, data: bytes) -> None:
        """Write a remark into the recording, if one is running."""
        recording = self.links.recording
        if recording is not None:
            recording.remark(data)

    def require_link(self) -> None:
        """Raise LinkLost while the port is searched."""
        if self.link is None:
            raise LinkLost("the port went away and is searched; try again when it is back")

    @property
    def board(self) -> Board:
        if self.core.state.info is None:
            raise BoardTimeout("not connected; call connect() first")
        return self.core.state.info

    @property
    def ready(self) -> bool:
        """The board is greeted, its telemetry is not stale, and the driver is not closed."""
        return self.core.begun and self.core.session.ready and self.error is None and not self.closing

    @property
    def stopped(self) -> bool:
        """No command is in force, and telemetry has confirmed the last stop."""
        with self.lock:
            motion = self.core.session.motion if self.core.begun else None
            return motion is None or not (motion.target or motion.stopping or motion.unconfirmed)

    def listen(self, listeners: List[Listener], callback: Listener) -> None:
        """Call `callback` for these events; the robot stops if it is not a function."""
        with self.stop_if_refused():
            listeners.append(require_function("callback", callback))

    def _run(self) -> None:
        try:
            self._work()
        finally:
            with self.changed:
                self.changed.notify_all()  # a signal handler may have closed the driver just before a wait began

    def _work(self) -> None:
        try:
            while not self.closing:
                try:
                    if self.link is None:
                        self.seek()
                    else:
                        self.serve(self.link)
                except LinkLost as error:
                    self.lose(error)
                except BoardError as error:
                    if not self.links.searching:
                        raise
                    self.lose(error)
        except MrlError as error:
            self._give_up(error)
        except BaseException as error:
            if not self.closing:
                self._give_up(_of_callback(error))
            raise

    def serve(self, link: Link) -> None:
        """Read the link and do what is due, until it is lost or the driver is closed."""
        core, links, session = self.core, self.links, self.core.session
        clock = time.monotonic_ns
        while self.link is link:
            data = link.read(min(1.0, core.due_s - clock() / 1e9))
            now = clock() // 1000 / 1e6  # as `recording.now_s`, without a call
            with self.lock:
                if self.closing:
                    with contextlib.suppress(BoardError):
                        self._take_last(data, now)
                    return
                if self._broken is not None:
                    raise self._broken
                # If the machine was suspended, stop; the driver's clock does not count that time.
                slept_s = time.clock_gettime(BOOT_CLOCK) - now
                if slept_s > self._slept_s + PAUSE_S:
                    session.resumed_s = now
                    if session.motion.target is not None or session.turning:
                        core.stop(now, StopReason.HOST_PAUSED)
                self._slept_s = slept_s
                if links.recording is None:
                    events = core.turn(data, now)
                else:
                    events = self.turn_recorded(data, now)
                    if links.recording.due:
                        self.exchange_link()
                if self._asking:
                    self.changed.notify_all()
            if links.searching or links.fast:
                events += self._supervise(link, now)
            if session.out:
                self.flush()
            if not self._settled and core.state.settled:
                self._settle()
            try:
                self.report(events)
            except (LinkLost, BoardError) as error:
                if error is not self.error:  # a callback's, perhaps of another robot: this link is not lost
                    raise _of_callback(error) from error
                raise

    def turn_recorded(self, data: bytes, now: float) -> List[DriverEvent]:
        """As `Core.turn`, and record what a replay needs to do the same; with the lock."""
        recording, core = self.links.recording, self.core
        if recording is None:
            return core.turn(data, now)
        recording.heard(data, now)
        events = core.turn(data, now)
        recording.turned(data, events, core.session, core.state)
        return events

    def _take_last(self, data: bytes, now: float) -> None:
        """Take what was read while the driver was closed: it counts, but no listener is called; with the lock."""
        if self.links.recording is not None:
            self.links.recording.remark(ENDED + CLOSED, now)
        self.turn_recorded(data, now)

    def _settle(self) -> None:
        """Let `connect` return."""
        with self.changed:
            self._settled = True
            self.changed.notify_all()

    def _supervise(self, link: Link, now: float) -> Sequence[DriverEvent]:
        """In a search, check that the robot is the one that was lost; at a raised baud rate, count the link's errors.

        Raises:
            WrongRobot: another robot answers; its session was ended.
        """
        links, session = self.links, self.core.session
        events: List[DriverEvent] = []
        if links.searching:
            try:
                found = links.judge(session, now)
            except WrongRobot:
                with self.lock:
                    session.end()
                with contextlib.suppress(LinkLost):
                    self.flush()
                raise
            if found is not None:
                events.append(found)
                self.remark(RECONNECTED + found.port.encode("utf-8", "replace"))
        if links.fast and links.is_failing(session, now):
            with self.lock:
                alone = self.writer is None
                if alone:  # nobody else writes until the speed is changed
                    self.writer = (threading.get_ident(), link)
            if alone:
                links.fast = False
                try:
                    link.set_baud(BAUD)  # the board does the same by itself
                finally:
                    self.writer = None
                events.append(Slowed(BAUD))
                self.remark(SLOWED + b"%d" % BAUD)
        return events

    def lose(self, error: MrlError) -> None:
        """Drop the link and start the search; raise `error` if the driver does not reconnect."""
        now = now_s()
        with self.lock:
            link = self.link
            if link is None or not self._may_search():
                raise error
            self.link = self._broken = None
            self.writer = None  # a write that still blocks on the lost link does not hinder the next one
            self.core.session.lose(now)
            may_be_moving = self.core.session.may_be_moving
        lost = self.links.lose(error, now, may_be_moving)
        if self.links.recording is not None:
            event = lost or Lost(link.port, str(error), may_be_moving)
            self.links.recording.lost(event, lost is not None, now)
        link.close()
        if lost is not None:
            self.report([lost])

    def _may_search(self) -> bool:
        """The driver searches a lost port: not before the first connection, and only with the option `reconnect`."""
        return (
            self.links.reconnection is not None and self._settled and not self.closing and self.error is None
        )

    def seek(self) -> None:
        """Look for the port once.  If it is found, `serve` greets the robot on it."""
        if wait_until(lambda: self.closing, LOOK_S):
            return
        search = self.links.reconnection
        assert search is not None
        link = search.look()
        if link is None:
            return
        with self.lock:
            closing = self.closing
            if not closing:
                now, same = now_s(), search.same_board
                if self.links.recording is not None:
                    self.links.recording.again(now, same)
                self.core.session.relink(now, same)
                self.link, self.core.due_s = link, -math.inf
        if closing:
            link.close()

    def report(self, events: Sequence[object]) -> None:
        """Call the listeners of these events."""
        for event in events:
            for listener in self.listeners.get(type(event), self.on_state):
                listener(event)

    @contextlib.contextmanager
    def stop_if_refused(self) -> Iterator[None]:
        """Stop the robot if an argument of a call is refused."""
        try:
            yield
        except (ConfigError, FrameError) as error:
            drives = self.core.begun and self.core.limiter.limits is not None
            if drives and self.error is None and not self.closing:
                with self.lock:
                    refused = self.core.refuse(error, self.clock())
                self.flush()
                raise refused from None
            raise

    def connected(self) -> Core:
        """Return the core; raise the error that ended the driver, or LinkLost, if nothing can be sent."""
        if self.error is not None or self.closing or not self.core.begun:
            self.refuse()
        return self.core

    def refuse(self) -> NoReturn:
        """Raise the error that ended the driver, or LinkLost."""
        raise self.error or LinkLost(self.refusal)

    def flush(self) -> bool:
        """Send the session's bytes, and wake the reading thread if something is now due earlier.

        Only one thread writes at a time, without a lock.  What others add meanwhile, the reading thread sends next.
        A signal handler of the thread that writes may write as well.

        Returns:
            The port has accepted all bytes that were to be sent.
        """
        core, session, data = self.core, self.core.session, b""
        mine, accepted = (threading.get_ident(), self.link), True
        try:
            with self.lock:
                link, due_s = self.link, -math.inf if session.hurried else session.motion.due_s
                wake = due_s < core.due_s
                if wake:
                    core.due_s = due_s
                accepted = not session.out or self.writer is None or self.may_write()
                if session.out and accepted:
                    self.writer, data = mine, bytes(session.out)  # as `Session.take`, without a call
                    session.out.clear()
                    session.counters.bytes_out += len(data)
                    baud = FAST_BAUD if self.links.fast else self._line_baud
                    self._line_free_s = max(self._line_free_s, self.clock()) + len(data) * BITS / baud
            if data and link is not None:
                link.write(data)
        except BoardTimeout:
            session.counters.blocked_writes += 1
            session.motion.sent, accepted = None, False
        except LinkLost as error:
            accepted = False
            if link is not None:
                self._on_broken(link, error)
        finally:
            if data:
                wake = self._end_write(mine) or wake
        link = self.link
        if wake and link is not None and threading.current_thread() is not self.thread:
            link.wake()
        return accepted

    def _end_write(self, mine: Tuple[int, Optional[Link]]) -> bool:
        """Let others write; return whether they have left bytes, which the reading thread sends."""
        with self.lock:
            if self.writer is mine:
                self.writer = None
            if self.queuing:
                self.changed.notify_all()
            if self.core.session.out:
                self.core.due_s = -math.inf
            return bool(self.core.session.out)

    def await_writer(self, done: Callable[[], bool]) -> bool:
        """Wait for the write of another thread, which takes long only if the port blocks; with the lock."""
        self.queuing += 1
        in_time = self.changed.wait_for(done, WRITE_TIMEOUT_S)
        self.queuing -= 1
        return in_time

    def _await_line(self) -> None:
        """Wait until the line has carried all but `QUEUE_BYTES` of what was written; with the lock.

        Ports and networks accept more than the line carries.
        """
        while self.thread is not None and not self.closing:
            queued_s = QUEUE_BYTES * BITS / (FAST_BAUD if self.links.fast else self._line_baud)
            behind_s = self._line_free_s - queued_s - self.clock()
            if behind_s <= 0:
                return
            self._asking += 1  # the reading thread wakes this one
            self.changed.wait(behind_s)
            self._asking -= 1

    def may_write(self) -> bool:
        """Return whether this thread may write: no other does, or another cannot report that it is done."""
        return self.writer is None or self.writer[0] == threading.get_ident() or self._seized

    def _flush_all(self) -> None:
        """Send the session's bytes at the end, when the reading thread may not send them any more.

        If another thread is writing, wait for it, at most `CLOSE_S`.
        """
        deadline = time.monotonic() + CLOSE_S
        self.flush()
        while (self.core.session.out or not self.may_write()) and time.monotonic() < deadline:
            if self.link is None:
                return
            time.sleep(FLUSH_S)
            self.flush()

    def _on_broken(self, link: Link, error: LinkLost) -> None:
        """A write has found that the port is gone: the reading thread searches it, or stops the robot and ends.

        Raises:
            LinkLost: the driver does not search the port.
        """
        with self.lock:
            if inner(self.link) is not inner(link):
                return  # another thread has found it before
            self._broken = error
            if not self._may_search() and not self.closing:
                self.error = self.error or error
                self.changed.notify_all()
            failed = self.error is error
        link.wake()
        if failed:
            raise error

    def _say_goodbye(self, wait: bool) -> None:
        """Stop the robot, wait for the confirmation, and set the board back to what a 2013 host expects.

        Without `wait` the reading thread cannot go on, because it is the caller or because the caller holds the lock.
        So this method reads the link.
        """
        try:
            core = self.core
            if self.error is not None:
                self.stop_for_good()  # the port may still take it
                return
            if wait:
                self.stop_for_good()
            else:
                self._halt()
            deadline = time.monotonic() + (0.0 if self.identifies else CLOSE_S)
            while wait and self.ready and not self.stopped and time.monotonic() < deadline:
                time.sleep(0.01)
            with self.lock:
                if not self.stopped:  # telemetry may not confirm the stop any more, so send it again
                    core.session.stop(self.clock(), StopReason.CLOSED)
                core.session.end()
                if self.links.fast:
                    core.session.request(BY_NAME["set_baud"].code, 0)
            self._flush_all()
        except MrlError:
            return

    def stop_for_good(self) -> None:
        """Stop the robot, and refuse further commands."""
        with self.lock:
            self.core.leaving = True
            self.core.limiter.drop()
            self.core.session.stop(self.clock(), StopReason.CLOSED)
        self._flush_all()

    def _give_up(self, error: MrlError) -> None:
        try:
            self._halt()
        except MrlError:
            return
        finally:
            self.fail(self.links.explained(error))

    def _halt(self) -> None:
        """Stop the robot and repeat the stop until telemetry confirms it; 2013 boards have no watchdog to do it."""
        core, link = self.core, self.link
        session = core.session
        self.remark(ENDED + CLOSED)  # no listener is called for what is read here
        self.stop_for_good()
        deadline = time.monotonic() + CLOSE_S
        while link is not None and session.ready and session.motion.stopping and time.monotonic() < deadline:
            data = link.read(min(core.due_s, deadline) - time.monotonic())
            with self.lock:
                self.turn_recorded(data, now_s())
            if session.out:
                self.flush()

    def fail(self, error: MrlError) -> None:
        """End the driver with this error."""
        with self.changed:
            if self.closing:
                return
            self.error = error
            self._settle()
        self.remark(ENDED + f"{type(error).__name__}: {error}".encode("utf-8", "replace"))
        self.report([error])
