"""The robot as an object: SI units in and out, one thread that reads, nothing printed.

    with Driver("/dev/ttyACM0") as robot:
        robot.drive(0.2, 0.0)
        time.sleep(2)
        print(robot.pose)

Leaving the block stops the robot, and so does the end of the program.  All methods may be called from any thread; `ask`
and `wait` not from callbacks, which run on the thread that reads.
"""

import atexit
import math
import threading
import time
from typing import List, Optional, Tuple, Union

from . import forks, robots
from .address import demand_port
from .core import Core
from .errors import BoardError, BoardTimeout, ConfigError, LinkLost, MrlError, WrongRobot
from .events import Lost, Reconnected, Slowed
from .fast_line import BACK_S, speed_up
from .handshake import Board
from .line_rate import FAST_BAUD, demand_raisable
from .link import BAUD, Link
from .options import DEFAULTS, Options, demand, demand_options
from .readout import Readout
from .reconnect import LOOK_S, Reconnection
from .recording import Recorder
from .robots import RobotModel
from .session import PAUSE_S
from .state import Notice, Telemetry
from .table import BY_NAME
from .tape import Tape
from .wires import AGAIN_S, CONNECT_S, open_link

__all__ = ["Board", "Driver", "Options", "Telemetry"]

CLOCK_BOOTTIME = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
ERRORS, ERROR_SHARE = 20, 100
"""More damaged pieces than these and one frame in so many: a line at a higher speed goes back to 115200."""
CLOSE_S = 0.8
"""`close` waits at most this long for telemetry to confirm the stop [s]."""
ATTEMPTS, ANSWER_S = 3, 0.5
"""`ask` sends so often, and waits each time so long for the answer [s]."""


class Driver(Readout):
    """A robot on a serial port.

    Args:
        port: device name, an URL (`tcp://host:port`, `udp://host:port`, those of pyserial), or an open `Link`.
        robot: name of a packaged model, path of a YAML file, a `RobotModel`, or `auto` for the model that
            lists the id which the board reports.
        baud: of the port, where `port` is a name; of the line behind a network address.  Below 115200 the board
            streams no faster than the line carries.
        options: see `Options`.

    Raises:
        ConfigError: the robot model is unknown or wrong, or an option out of range (when created, before the
            port is opened).
    """

    def __init__(
        self,
        port: Union[str, Link],
        robot: Union[str, RobotModel] = "auto",
        baud: int = BAUD,
        options: Options = DEFAULTS,
    ) -> None:
        demand("baud", baud, 300, 4_000_000, "Bd", int)
        demand_options(options)
        if isinstance(port, str):
            demand_port(port)
        if options.record is not None and isinstance(port, Link):
            raise ConfigError("record is given with an open link, expected a port by name")
        if options.fast:
            demand_raisable(port, baud)
        options = options._replace(line_baud=min(baud, options.line_baud))
        self._port, self._baud, self._options = port, baud, options
        model = robot if isinstance(robot, RobotModel) else None if robot == "auto" else robots.load(robot)
        super().__init__(Core(model, options))
        self._changed = threading.Condition(self._lock)
        self._settled = threading.Event()
        self._link: Optional[Link] = None
        self._thread: Optional[threading.Thread] = None
        self._closing = False
        self._asking = 0
        self._settling = True
        self._broken: Optional[LinkLost] = None
        self._reconnection: Optional[Reconnection] = None
        self._tape: Optional[Tape] = None
        self._slept_s = _slept_s()
        self._fast, self._well_s, self._errors = False, 0.0, 0

    def connect(self) -> Board:
        """Open the port, greet the board, start its stream; the robot is told to stop and stays still.

        Returns:
            Who answers, once the first telemetry is there.

        Raises:
            ConfigError: the recording cannot be written.
            PortMissing, PortDenied, PortBusy, LinkError: the port cannot be opened.
            NotARobot: nothing answers, or not in frames.
            WrongRobot: another robot answers, or one of another protocol.
            BatteryDead: motor power is off, or the battery too low to start (unless `ignore_battery`).
            BoardTimeout, LinkLost: it stopped answering, or went away, meanwhile.
        """
        if self._thread is not None or self._closing:
            raise MrlError("this driver was connected already; create another one to connect again")
        options = self._options
        self._link = self._first_link()
        if options.reconnect and not isinstance(self._port, Link):
            self._reconnection = Reconnection(self._port, self._open, options.greeting_s)
        self._core.begin(time.monotonic())
        self._thread = threading.Thread(target=self._run, name="mrl-driver", daemon=True)
        self._thread.start()
        forks.leave_to_parent(self._abandon)
        atexit.register(self._end_with_program)
        try:
            self._settled.wait()
        except BaseException:
            self.close()
            raise
        if self._error is not None:
            self.close()
            raise self._error
        return self.board

    def close(self) -> None:
        """Stop the robot, wait at most a second for telemetry to confirm it, and give the port back."""
        thread = self._thread
        if thread is None:
            return
        on_thread = thread is threading.current_thread()
        if self._error is None and not self._closing:
            self._say_goodbye(wait=not on_thread)
        with self._changed:
            self._closing = True
            self._changed.notify_all()
            link = self._link
        self._settled.set()
        if link is not None:
            link.close()
        if not on_thread:
            thread.join()
        self._end_tape()
        atexit.unregister(self._end_with_program)

    def _end_with_program(self) -> None:
        """A program that ends in an error may not have closed; boards of 2013 would drive on."""
        self.close()

    def _abandon(self) -> None:
        """In a forked child, which leaves the robot to its parent: closed, and every call says why."""
        self._lock = threading.RLock()
        self._changed, self._settled = threading.Condition(self._lock), threading.Event()
        self._link = self._thread = self._reconnection = self._tape = None
        self._closing = True
        self._error = LinkLost(
            "this process was forked from the one that drives the robot; connect in one of them"
        )

    def _end_tape(self) -> None:
        if self._tape is not None:
            self._tape.close()

    def __enter__(self) -> "Driver":
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def line_baud(self) -> int:
        """Speed of the line now [Bd]: with the option `fast` 500000 where board and line can, else the port's."""
        return FAST_BAUD if self._fast else self._baud

    @property
    def recorder(self) -> Optional[Recorder]:
        """What writes the recording, with the lines it `lost` and its last `error`; None without one."""
        return self._tape.recorder if self._tape is not None else None

    def wait(self, timeout_s: Optional[float] = None) -> bool:
        """Sleep until the driver is closed or has failed; False when `timeout_s` passed before.

        Raises:
            MrlError: what the driver failed with, such as LinkLost.
        """
        with self._changed:
            ended = self._changed.wait_for(lambda: self._closing or self._error is not None, timeout_s)
            if self._error is not None:
                raise self._error
            return ended

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> bool:
        """Drive at these speeds until told otherwise; faster than the model's limits is scaled down on the
        same arc.

        The latest command wins: none is ever queued.  It is repeated to the board by itself, and dropped when
        the board falls silent or restarts, so the robot then waits for a new one.

        Args:
            linear_m_s: forward speed.
            angular_rad_s: yaw rate, counter-clockwise.
            lateral_m_s: speed to the left, where the base can.

        Returns:
            True when the command is in force; False when the board is silent, being greeted, lost and searched,
            the battery empty, a wheel not doing what it was told (see `mismatch`), or the driver being closed.

        Raises:
            FrameError: a speed is NaN or infinite, or lateral where the base cannot; the robot was stopped.
            LinkLost: the port went away.
        """
        with self._lock:
            core = self._connected()
            try:
                return core.drive(linear_m_s, angular_rad_s, time.monotonic(), lateral_m_s)
            finally:
                self._flush()

    def stop(self) -> None:
        """Stop at once; the stop is repeated until telemetry confirms it.

        Raises:
            LinkLost: the port went away.
        """
        with self._lock:
            self._connected().stop(time.monotonic(), "user")
            self._flush()

    def request(self, code: int, *args: int) -> None:
        """Send any other request of the command table; what it brings comes to `on_event`.

        Raises:
            FrameError: the table forbids it.
            BoardTimeout: it would turn motors, and the board is silent; it was not sent.
            LinkLost: the port went away.
        """
        with self._lock:
            core = self._connected()
            if self._link is None:
                raise LinkLost("the port went away and is searched; try again when it is back")
            core.session.request(code, *args)
            self._flush()

    def ask(self, code: int, *args: int, timeout_s: float = ANSWER_S) -> Tuple[int, ...]:
        """Send a request that a `Reply` answers, again where none comes; the reply's fields.

        Not for `robot_info`, `read_status` and the counts, which come by themselves, nor on the reading thread.

        Raises:
            FrameError: the table forbids the request.
            BoardTimeout: no answer within `timeout_s`, for each of three attempts.
            LinkLost: the port went away.
        """
        core = self._core
        for _ in range(ATTEMPTS):
            with self._changed:
                core.replies.pop(code, None)
                self.request(code, *args)
                self._asking += 1
                self._changed.wait_for(lambda: core.answer(code, args) or self._error, timeout_s)
                self._asking -= 1
                self._connected()
                reply = core.answer(code, args)
                if reply is not None:
                    return reply
        raise BoardTimeout(
            f"no answer to request {code} in {ATTEMPTS} attempts of {timeout_s:g} s; try again"
        )

    def _run(self) -> None:
        try:
            while not self._closing:
                self._turn()
        except MrlError as error:
            self._give_up(error)
        finally:
            if not self._closing and self._error is None:
                self._give_up(
                    MrlError("a callback raised; the driver has ended and the robot was told to stop")
                )

    def _turn(self) -> None:
        """Serve the link that there is, or look for one."""
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
        """A line that fails at the higher speed goes back to the usual one, as the board does."""
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
        """After a sleep of the machine, which the driver's clock does not see, the command is stale."""
        before, self._slept_s = self._slept_s, _slept_s()
        if self._slept_s > before + PAUSE_S and self.command is not None:
            self._core.stop(now, "host_paused")

    # -- a lost port

    def _first_link(self) -> Link:
        if isinstance(self._port, Link):
            return self._port
        record, tap = self._options.record, self._options.tap
        if record is not None or tap is not None:
            self._tape = Tape(record, self._port, self._baud, tap)
        try:
            return self._open(self._port, CONNECT_S)
        except BaseException:
            self._end_tape()
            raise

    def _open(self, name: str, patience_s: float = AGAIN_S) -> Link:
        opener = self._tape.open if self._tape is not None else open_link
        link = opener(name, self._baud, patience_s)
        self._fast = self._options.fast and speed_up(link)
        self._well_s, self._errors = time.monotonic(), -1
        return link

    def _lose(self, error: MrlError) -> None:
        """Give the link up and search it, where that is wanted; else raise `error`."""
        now = time.monotonic()
        with self._lock:
            reconnection, link = self._searchable(), self._link
            if reconnection is None or link is None:
                raise error
            self._link = self._broken = None
            self._core.session.lose(now)
            first = reconnection.lose(error, now)
        link.close()
        if first:
            self._call([("state", Lost(reconnection.port, str(error)))])

    def _searchable(self) -> Optional[Reconnection]:
        """What finds a lost port, once there is something to find."""
        was_there = self._settled.is_set() and not self._closing and self._error is None
        return self._reconnection if was_there else None

    def _seek(self) -> None:
        """One look for the port; the robot is greeted on it by the cycles that follow."""
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
        """Is it the robot that was lost?"""
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

    def _give_up(self, error: MrlError) -> None:
        try:
            self._halt()
        except MrlError:
            return
        finally:
            self._fail(error)

    def _halt(self) -> None:
        """Stop, as the last thing, until telemetry confirms it; boards of 2013 have no watchdog that would."""
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

    def _connected(self) -> Core:
        if self._error is not None:
            raise self._error
        if not self._core.begun or self._closing:
            raise LinkLost("the driver is not connected, or was closed")
        return self._core

    def _flush(self) -> None:
        """Send what the session has, and let the reader know if that leaves it less time to sleep."""
        self._send()
        if threading.current_thread() is not self._thread:
            self._wake()

    def _send(self) -> None:
        """Send what the session has, under the lock, so that frames never mix."""
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
        """Wake the reader if something is due before it looks again."""
        if self._link is not None and self._core.session.deadline(time.monotonic()) < self._core.due_s:
            self._link.wake()

    def _say_goodbye(self, wait: bool) -> None:
        """Stop, have it confirmed, and leave the board as a 2013 host would expect it."""
        try:
            with self._lock:
                core = self._connected()
                core.leaving = True
                core.session.stop(time.monotonic(), "closed")
                self._flush()
            deadline = time.monotonic() + CLOSE_S
            while wait and self.ready and not self.stopped and time.monotonic() < deadline:
                time.sleep(0.01)
            with self._lock:
                core.session.end()
                if self._fast:
                    core.session.request(BY_NAME["set_baud"].code, 0)
                self._flush()
        except MrlError:
            return


def _slept_s() -> float:
    """Time that the machine was suspended since it was started [s]."""
    return time.clock_gettime(CLOCK_BOOTTIME) - time.monotonic()
