"""The robot as an object: SI units in and out, one reading thread, no output to the terminal.

    with Driver("/dev/ttyACM0") as robot:
        for _ in range(20):
            robot.drive(0.2, 0.0)
            robot.wait(0.1)
        print(robot.pose)

The robot stops 0.5 s after the last `drive`; `Options(command_timeout_s=...)` changes that time.  The robot also stops
at the end of the `with` block and at the end of the program.  All methods may be called from any thread.  Callbacks run
on the reading thread and must not call `ask` or `wait`.  `lock_order` has the threads and the order of the locks.
"""

import atexit
import contextlib
import math
import threading
import time
from typing import Any, Callable, Dict, Iterator, List, NoReturn, Optional, Sequence, Tuple, Union, cast

from mrl_driver.arguments import (
    require_function,
    require_kind,
    require_number,
    require_numbers,
    require_text,
    require_whole,
    shown,
)
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
from mrl_driver.geometry import ORIGIN, Pose, wrap_angle
from mrl_driver.lock_order import new_lock
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BAUD, BY_NAME, STOP_CODE
from mrl_driver.recording.recorded_link import inner
from mrl_driver.recording.recording import CLOSED, ENDED, OWN_REMARKS, RECONNECTED, SLOWED, Recorder, now_s
from mrl_driver.robot import models
from mrl_driver.robot.covariance import AT_START, LARGEST_VARIANCE, Spread, is_covariance
from mrl_driver.robot.hold import CAPABILITY as HOLD
from mrl_driver.robot.hold import RELEASE, Hold
from mrl_driver.robot.imu import Imu
from mrl_driver.robot.models import Limits, RobotModel
from mrl_driver.robot.odometry import AnyTwist, OmniTwist, Twist
from mrl_driver.robot.radio import CAPABILITY as RADIO
from mrl_driver.robot.radio import DISCOVERY_S, SEARCH, RadioNode, RadioText, Request, text_request
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.safety.speed_limiter import Speeds
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.session.events import MAY_MOVE, Lost, SensorRead, Slowed, Status
from mrl_driver.session.handshake import Board
from mrl_driver.session.link_counters import Statistics
from mrl_driver.session.motion_command import Motion
from mrl_driver.session.sensor_polling import Reading
from mrl_driver.session.session import PAUSE_S, TURNING
from mrl_driver.transport import fork_guard
from mrl_driver.transport.address import require_port
from mrl_driver.transport.baud_rates import FAST_BAUD, require_raisable
from mrl_driver.transport.link import WRITE_TIMEOUT_S, Link
from mrl_driver.transport.reconnect import LOOK_S

from .link_source import LinkSource
from .options import DEFAULTS, Options, require_baud, require_limits, require_options, require_timeout
from .robot_core import Core, DriverEvent

__all__ = ["Board", "Driver", "Options", "Telemetry"]

ATTEMPTS, ANSWER_S = 3, 0.5
"""`ask` sends a request at most this many times and waits this long for each reply [s]."""
CLOSE_S = 0.8
"""The stop at the end waits at most this long for telemetry to confirm it [s]."""
QUEUE_BYTES = 512
"""`request` waits while more bytes than these are on the way to the board, by the baud rate, or queued because the port
blocks, so that a stop does not wait for many others.
"""
BITS = 10
"""A byte on the serial line [bit]."""
CLOSED_EARLY = "the driver was closed while it connected"
FLUSH_S = 1e-3
"""At the end, the driver looks this often whether another thread's write is over [s]."""
EXCHANGE_S = 1.0
"""`start_recording` waits at most this long for the reading thread, which may be in a callback [s]."""
LONGEST_REMARK = 1000
CLOCK_BOOTTIME = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
Listener = Callable[[Any], None]


def _whole(code: Any, args: Sequence[Any]) -> Tuple[int, Tuple[int, ...]]:
    """Return code and arguments of a request as int; raise FrameError if one is not a whole number."""
    whole = tuple(require_whole(f"argument {n}", value, FrameError) for n, value in enumerate(args, 1))
    return require_whole("code", code, FrameError), whole


def _require_remark(text: Any) -> None:
    """Raise ConfigError unless it is a remark of the user."""
    fits = isinstance(text, str) and 0 < len(text) <= LONGEST_REMARK
    if not fits or text.split(" ")[0].encode("utf-8", "replace") in OWN_REMARKS:
        own = ", ".join(word.decode() for word in OWN_REMARKS)
        raise ConfigError(
            f"the remark is {shown(text)}, expected 1 to {LONGEST_REMARK} characters that do not begin with {own}"
        )


def _require_spread(spread: Any) -> Spread:
    """Return a covariance of the pose; raise ConfigError if it is none."""
    parts = ("xx", "xy", "x-yaw", "yy", "y-yaw", "yaw-yaw")
    numbers = cast(Spread, require_numbers("covariance", spread, parts))
    if not is_covariance(numbers):
        raise ConfigError(
            f"the covariance of the pose is {numbers}, expected {' '.join(parts)} with variances from "
            f"0 to {LARGEST_VARIANCE:g} and covariances that fit them; the odometry continues as before"
        )
    return numbers


class Driver:
    """A robot on a serial port.

    Args:
        port: device name, URL (`tcp://host:port`, `udp://host:port`, or a pyserial URL), or an open `Link`.
        robot: name of a packaged model, path of a YAML file, a `RobotModel`, or `auto`: the model that lists
            the robot id reported by the board.
        baud: baud rate of the serial port [Bd]; with a network address, baud rate of the serial link behind it.
            Below 115200 the board streams only as fast as the line allows.
        options: see `Options`.

    Raises:
        ConfigError: the robot model is unknown or invalid, or an option is out of range.  Raised before the
            port is opened.
    """

    def __init__(
        self,
        port: Union[str, Link],
        robot: Union[str, RobotModel] = "auto",
        baud: int = BAUD,
        options: Options = DEFAULTS,
    ) -> None:
        baud, options = require_baud("baud", baud), require_options(options)
        if isinstance(port, str):
            require_port(port)
        elif not hasattr(port, "read"):
            raise ConfigError(f"port is {shown(port)}, expected a name, or an open Link")
        elif options.record is not None:
            raise ConfigError("record is given with an open link, expected a port by name")
        if options.fast:
            require_raisable(port, baud)
        require_kind("robot", robot, (str, RobotModel), "a name, the path of a file, or a RobotModel")
        options = options._replace(line_baud=min(baud, options.line_baud))
        model = robot if isinstance(robot, RobotModel) else None if robot == "auto" else models.load(robot)
        self._core, self._baud = Core(model, options), baud
        self._identifies = options.identify
        self._links = LinkSource(port, self._baud, options)
        self._clock: Callable[[], float] = time.monotonic
        self._lock = new_lock("driver")
        self._changed = threading.Condition(self._lock)
        self._link: Optional[Link] = None
        self._thread: Optional[threading.Thread] = None
        self._error: Optional[MrlError] = None
        self._broken: Optional[LinkLost] = None
        self._beginning = self._closing = False
        self._writer: Optional[Tuple[int, Optional[Link]]] = None
        """Thread and link of the write that is under way."""
        self._asking = self._queuing = 0
        self._line_baud, self._line_free_s = options.line_baud, -math.inf
        """When the line will have carried all that was written [s]."""
        self._settled = False
        """Telemetry has arrived, or the driver has failed before."""
        self._seized = False
        """A signal handler closes the driver while its own thread holds the lock."""
        self._slept_s = math.inf
        self._ahead_s: Optional[float] = None
        """Time by which the wall clock is ahead of `now_s`, if it is known [s]."""
        self._on_state: List[Listener] = []
        self._listeners: Dict[type, List[Listener]] = {
            Telemetry: [],
            Imu: [],
            Status: [],
            Board: [],
            SensorRead: [],
            RadioText: [],
        }

    # -- the connection

    def connect(self) -> Board:
        """Open the port, greet the board and start its stream.  The robot gets a stop and stays still.

        Returns:
            The board's identity, after the first frame of its stream has arrived.

        Raises:
            ConfigError: the recording cannot be written.
            PortMissing, PortDenied, PortBusy, LinkError: the port cannot be opened.
            NotARobot: nothing answers, or the answer is not made of frames.
            WrongRobot: another robot answers, or the board speaks another protocol.
            BatteryDead: motor power is off, or the battery is too low to start (unless `ignore_battery`).
            BoardTimeout, LinkLost: the board stopped answering, or the port went away, during the greeting.
            LinkLost: the driver was closed while it connected.
        """
        if self._thread is not None or self._closing:
            raise MrlError("this driver was connected already; create another one to connect again")
        self._beginning = True
        try:
            self._start(self._links.first(self._tell_state))
        finally:
            self._beginning = False
        fork_guard.leave_to_parent(self._abandon)
        atexit.register(self._end_with_program)
        try:
            with self._changed:
                self._changed.wait_for(lambda: self._settled or self._closing)
        except BaseException:
            self.close()
            raise
        if self._error is not None or self._closing:
            self.close()
            raise self._error or LinkLost(CLOSED_EARLY)
        return self.board

    def _start(self, link: Link) -> None:
        """Start the session and the thread, unless the driver was closed while the port opened."""
        thread = threading.Thread(target=self._run, name="mrl-driver", daemon=True)
        try:
            with self._lock, shortages("the driver cannot start", MrlError):
                if self._closing:
                    raise LinkLost(CLOSED_EARLY)
                self._link = link
                now = now_s()
                if self._links.recording is not None:
                    self._links.recording.new(now)
                self._core.begin(now)
                thread.start()
                self._thread = thread
        except BaseException:
            self._link = None
            link.close()
            self._links.end_recording()
            raise

    def close(self) -> None:
        """Stop the robot, wait at most a second for telemetry to confirm the stop, and close the port.

        Signal handlers may call it as well.
        """
        self._seized = self._seized or self._holds_lock()
        with self._lock:
            thread = self._thread
            self._closing = self._closing or (thread is None and self._beginning)
        if thread is None:
            if self._closing:
                self._links.close()
            return
        alone = thread is threading.current_thread() or self._holds_lock()
        if not self._closing:
            self._say_goodbye(wait=not alone)
        with self._changed:
            self._closing = True
            self._changed.notify_all()
            link = self._link
        self._links.close()
        if link is not None:
            link.close()
        if not alone:
            thread.join()
        self._links.end_recording()
        atexit.unregister(self._end_with_program)

    def _holds_lock(self) -> bool:
        """Return whether this thread holds the driver's lock: a signal handler runs, which has interrupted it."""
        try:
            self._changed.notify(0)
        except RuntimeError:
            return False
        return True

    def _end_with_program(self) -> None:
        """Close at the end of the program: after an error the driver may still be open, and 2013 boards drive on."""
        self.close()

    def __enter__(self) -> "Driver":
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _abandon(self) -> None:
        """Run in a forked child: the parent keeps the robot.  Here the driver is closed, and each call raises why."""
        self._lock = new_lock("driver")
        self._changed = threading.Condition(self._lock)
        self._links.abandon()
        self._link = self._thread = None
        self._closing = True
        self._error = LinkLost(
            "this process was forked from the one that drives the robot; connect in one of them"
        )

    def wait(self, timeout_s: Optional[float] = None) -> bool:
        """Sleep until the driver is closed or has failed; False if `timeout_s` ended first.

        Raises:
            ConfigError: `timeout_s` is not a number, or NaN.
            MrlError: the driver failed; this is the error, such as LinkLost.
        """
        with self._stop_if_refused():
            timeout_s = require_timeout("timeout_s", timeout_s)
        with self._changed:
            ended = self._changed.wait_for(lambda: self._closing or self._error is not None, timeout_s)
            if self._error is not None:
                raise self._error
            return ended

    # -- commands

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> bool:
        """Drive at these speeds for at most 0.5 s; call again before then to keep driving.

        The option `command_timeout_s` sets another time.  **With `command_timeout_s=None` the robot keeps driving while
        the program hangs.**  Speeds above the model's limits are scaled down together, so the arc stays the same.  The
        latest command wins; commands are never queued.  If the board falls silent or restarts, the command is dropped
        and the robot waits for a new one.

        Args:
            linear_m_s: forward speed.
            angular_rad_s: yaw rate, counter-clockwise.
            lateral_m_s: speed to the left, if the base can move sideways.

        Returns:
            True if the port has accepted the command, or does so as soon as the pace of commands allows (5 ms, with
            boards of 2013 0.15 s).  False if the board is silent or being greeted, the port is lost, the battery is
            empty, a wheel does not follow its command (see `mismatch`), another robot holds this one by radio (see
            `hold`), commands are inhibited, the program has just gone on after a pause (with the option `queued_s`), or
            the driver is being closed.  Also False if telemetry is older than 0.1 s, or the port accepts no data for
            0.1 s: then the command may still be in force (see `command`) and is sent as soon as possible.

        Raises:
            FrameError: a speed is not a finite number, or the base cannot move sideways; the robot was stopped.
            ConfigError: the board has no motors, or the function of `restrict` has not returned finite speeds.
            LinkLost: the port went away.
        """
        core = self._core
        if self._error is not None or self._closing or not core.begun:
            self._refuse()
        try:
            with self._lock:
                taken = core.drive(linear_m_s, angular_rad_s, self._clock(), lateral_m_s)
                if self._writer is not None and not self._may_write():
                    self._await_writer(self._may_write)
        finally:
            accepted = self._flush()
        return taken and accepted

    def stop(self) -> None:
        """Stop at once; the stop is repeated until telemetry confirms it.

        If another thread's write is blocked, the stop is sent as soon as the port accepts bytes again.

        Raises:
            BoardTimeout: the link was lost while the robot moved, and its board has no watchdog: it may drive on.  The
                stop is repeated when the board is back.
            LinkLost: the port went away.
        """
        core = self._connected()
        with self._lock:
            core.stop(self._clock(), StopReason.USER)
        self._flush()
        if self.may_be_moving:
            raise BoardTimeout(f"no telemetry arrives: {MAY_MOVE}")

    def inhibit(self, reason: str) -> None:
        """Stop, and refuse commands and requests that turn motors until `allow` is called with each reason; none
        overtakes this.

        Raises:
            BoardTimeout, LinkLost: as `stop`; commands are refused nevertheless.
            ConfigError: the reason is not a text; the robot was stopped.
        """
        with self._stop_if_refused():
            require_text("reason", reason)
        with self._lock:
            self._core.inhibited.add(reason)
        self.stop()

    def allow(self, reason: str) -> None:
        """End an `inhibit` with this reason; the robot waits for a new command.

        Raises:
            ConfigError: the reason is not a text.
        """
        with self._stop_if_refused():
            require_text("reason", reason)
        with self._lock:
            self._core.inhibited.discard(reason)

    def restrict(self, allowed: Optional[Callable[[Speeds, float], Speeds]]) -> None:
        """Let `allowed(speeds, now)` reduce every command, and again with every frame; such as protective zones.

        Speeds are linear, angular and, if the base can, lateral [m/s, rad/s, m/s]; `now` is `now_s`.  The function is
        called with the driver's lock held: it must be quick and must not call the driver.  `limits` hold for what
        it returns; if that is not finite speeds, the robot stops.  None ends the restriction.

        Raises:
            ConfigError: `allowed` is not a function; the robot was stopped.
        """
        if allowed is not None:
            with self._stop_if_refused():
                require_function("allowed", allowed)
        with self._lock:
            self._core.limiter.restrict = allowed

    def limit_again(self) -> None:
        """Apply `limits` and `restrict` to the command in force now, instead of with the next frame.

        Raises:
            LinkLost: the port went away.
        """
        core = self._connected()
        with self._lock:
            core.limit_again(self._clock())
        self._flush()

    def request(self, code: int, *args: int) -> None:
        """Send any other request of the command table; `on_event` gets the reply.  The request of a stop is `stop()`.

        What a request turns is stopped 3 s after the last such request, at the latest.  Boards without a watchdog
        (2013) go on.

        Raises:
            FrameError: the command table does not allow the request; the robot was stopped.
            BoardTimeout: the request would turn motors, and the board is silent; it was not sent.
            LinkLost: the port went away.
            ConfigError: the request would turn motors, and the board has none.
            MrlError: the request would turn motors, and commands are inhibited, the driver is being closed, or a stop
                came while the request waited for the line; it was not sent.
        """
        self._connected()
        with self._stop_if_refused():
            self._request(*_whole(code, args))

    def _request(self, code: int, args: Tuple[int, ...]) -> None:
        core = self._connected()
        session = core.session
        with self._changed:
            if self._link is None:
                raise LinkLost("the port went away and is searched; try again when it is back")
            stops = core.stops
            self._await_line()
            if len(session.out) > QUEUE_BYTES and not self._await_writer(
                lambda: len(session.out) <= QUEUE_BYTES
            ):
                session.counters.blocked_writes += 1
                return
            if code in TURNING:
                core.require_may_turn(code, self._clock())
                if core.stops != stops:
                    raise MrlError(
                        f"a stop came while request {code} waited for the line: not sent, send it again if needed"
                    )
            core.expire(self._clock())
            if code == STOP_CODE:
                core.stop(self._clock(), StopReason.USER)
            else:
                session.request(code, *args)
        self._flush()

    def ask(self, code: int, *args: int, timeout_s: float = ANSWER_S) -> Tuple[int, ...]:
        """Send a request, wait for its `Reply` and return the reply's fields; repeat the request if no reply comes.

        Do not use it for `robot_info`, `read_status`, the wheel counters and the IMU, which arrive without a request,
        nor on the reading thread.

        Raises:
            FrameError: the command table does not allow the request; the robot was stopped.
            ConfigError: `timeout_s` is not a number, or NaN.
            BoardTimeout: no reply within `timeout_s`, in each of three attempts.
            LinkLost: the port went away.
        """
        with self._stop_if_refused():
            wait_s = require_timeout("timeout_s", timeout_s)
            code, args = _whole(code, args)
        core = self._core
        for _ in range(ATTEMPTS):
            with self._lock:
                core.replies.pop(code, None)
                self._asking += 1
            try:
                self.request(code, *args)
                with self._changed:
                    self._changed.wait_for(
                        lambda: core.answer(code, args) or self._error or self._closing, wait_s
                    )
            finally:
                with self._lock:
                    self._asking -= 1
            self._connected()
            reply = core.answer(code, args)
            if reply is not None:
                return reply
        raise BoardTimeout(f"no answer to request {code} in {ATTEMPTS} attempts of {timeout_s} s; try again")

    # -- radio

    def send_text(self, address: int, text: Union[str, bytes]) -> None:
        """Send 1 to 16 ASCII characters, or bytes, to the radio with this 64-bit address.

        `robot.radio.BROADCAST` is the address of all.

        Texts follow each other as fast as the radio's line allows, about 30 in a second.  A text may be lost on the
        air: let the receiver answer if it matters.

        Raises:
            FrameError: address or text is not valid.
            ConfigError: the board has no radio.
            MrlError: too many texts wait already.
            LinkLost: the port went away.
        """
        with self._stop_if_refused():
            request = text_request(address, text)
        self._send_by_radio(request)

    def discover_radios(self, duration_s: float = DISCOVERY_S) -> List[RadioNode]:
        """Search for other radios, and return those that answer within `duration_s`, in the order of their answers.

        An XBee collects answers for 6 s.  Do not use it on the reading thread.

        Raises:
            ConfigError: the board has no radio.
            LinkLost: the port went away, or the driver was closed.
            MrlError: another search is under way, or too many texts wait already.
        """
        with self._stop_if_refused():
            duration_s = require_number("duration_s", duration_s)
        core = self._core
        with self._lock:
            if core.nodes is not None:
                raise MrlError("a search for radios is under way; try again when it has ended")
            core.nodes = {}
        try:
            self._send_by_radio((SEARCH,))
            self.wait(duration_s)
            self._connected()
            with self._lock:
                return list(core.nodes.values())
        finally:
            with self._lock:
                core.nodes = None

    def require_radio(self) -> None:
        """Raise ConfigError if the board has no radio."""
        if RADIO not in self.board.capabilities:
            raise ConfigError(
                "this board has no radio, expected firmware of the radio build; flash it with: mrl flash --build xbee"
            )

    def _send_by_radio(self, request: Request) -> None:
        core = self._connected()
        self.require_radio()
        with self._lock:
            if self._link is None:
                raise LinkLost("the port went away and is searched; try again when it is back")
            core.send_by_radio(request, self._clock())
        self._flush()

    # -- recordings

    def start_recording(self, path: str) -> None:
        """Record all bytes in both directions from now on, as the option `record`; an existing file is overwritten.

        The recording begins between two frames of the board, and contains all later ones.

        Raises:
            ConfigError: a recording is running, the file cannot be created, or the driver was given an open `Link`.
            LinkLost: the driver is not connected, or was closed.
        """
        with self._stop_if_refused():
            require_text("path", path, "the name of a file")
        self._connected()
        self._links.start_recording(path)
        with self._changed:
            if threading.current_thread() is self._thread:
                self._exchange_link()
            elif self._link is not None:
                self._link.wake()
                self._changed.wait_for(self._is_recorded, EXCHANGE_S)
        self._flush()

    def _is_recorded(self) -> bool:
        recording = self._links.recording
        return recording is None or not recording.due or self._link is None or self._closing

    def _exchange_link(self) -> None:
        """Go on with a link that is recorded, or not any more.  Only for the reading thread, with the lock."""
        if self._link is not None:
            self._link = self._links.exchange(self._link, self._core.session, self._core.state)
            if self._ahead_s is not None:
                self.note_clock(self._ahead_s)
        self._changed.notify_all()

    def stop_recording(self) -> str:
        """End the recording, and close its file.

        Returns:
            What the file lacks, in words, such as after a full disk; empty if it is complete.

        Raises:
            ConfigError: no recording is running.
        """
        recorder = self._links.stop_recording()
        if threading.current_thread() is self._thread:  # it must not wait for a disk
            try:
                threading.Thread(target=recorder.close, name="recorder-end", daemon=True).start()
            except RuntimeError:  # no thread can be started
                recorder.close()
        else:
            recorder.close()
        return recorder.loss

    def remark(self, text: str) -> None:
        """Write a remark into the recording; nothing happens while none is running.

        Raises:
            ConfigError: the text is empty, longer than `LONGEST_REMARK`, or begins like a remark of the driver.
        """
        with self._stop_if_refused():
            _require_remark(text)
        self._remark(text.encode("utf-8", "replace"))

    def _remark(self, data: bytes) -> None:
        recording = self._links.recording
        if recording is not None:
            recording.remark(data)

    def note_clock(self, ahead_s: float) -> None:
        """Write into the recording, if one is running, that the wall clock is ahead of `now_s` by this much [s], from
        the event on whose callback calls this.

        Raises:
            ConfigError: it is not a finite number.
        """
        with self._stop_if_refused():
            self._ahead_s = require_number("ahead_s", ahead_s)
        recording = self._links.recording
        if recording is not None:
            recording.clock(self._ahead_s)

    # -- what may be read at any time, from any thread

    @property
    def line_baud(self) -> int:
        """Current baud rate of the link: 500000 if the option `fast` has raised it, else the port's baud rate."""
        return FAST_BAUD if self._links.fast else self._baud

    @property
    def recorder(self) -> Optional[Recorder]:
        """The recorder, with the lines it `lost` and its last `error`; None without a recording."""
        recording = self._links.recording
        return recording.recorder if recording is not None else None

    @property
    def _motion(self) -> Optional[Motion]:
        return self._core.session.motion if self._core.begun else None

    @property
    def now_s(self) -> float:
        """The driver's clock: `time.monotonic()`, or simulated time."""
        return self._clock()

    @property
    def model(self) -> Optional[RobotModel]:
        """The robot's model; None until `connect` if the driver was created with `auto`."""
        return self._core.state.model

    @property
    def limits(self) -> Optional[Limits]:
        """Limits of speed and acceleration in force; None until `connect` if the driver was created with `auto`.

        At first the model's speeds, without a limit of acceleration: the board has its own ramp.  They may be replaced
        at any time, and hold from the next command or frame on.  A command in force is only lowered; after an increase,
        the next command may be faster.

        Raises:
            ConfigError: on setting, a speed is not positive or does not fit into a frame, or an acceleration is not
                positive; the robot was stopped.
        """
        return self._core.limiter.limits or (self.model.limits if self.model else None)

    @limits.setter
    def limits(self, limits: Limits) -> None:
        with self._stop_if_refused():
            limits = require_limits(limits)
        with self._lock:
            self._core.limiter.change(limits)

    @property
    def ready(self) -> bool:
        """The board is greeted, and its telemetry is not stale."""
        return self._core.begun and self._core.session.ready and self._error is None

    @property
    def stopped(self) -> bool:
        """No command is in force, and telemetry has confirmed the last stop."""
        with self._lock:
            motion = self._motion
            return motion is None or not (motion.target or motion.stopping or motion.unconfirmed)

    @property
    def may_be_moving(self) -> bool:
        """The board was cut off while the robot moved, and it has no watchdog to stop it (2013 boards)."""
        return self._core.begun and self._core.session.may_be_moving

    @property
    def since_pause_s(self) -> float:
        """How long ago this program went on after a pause of 0.25 s or longer [s]; infinity if it never stood still.

        Commands that come just after that may have waited in a queue; see `Options.queued_s`.
        """
        core = self._core
        return self._clock() - core.session.resumed_s if core.begun else math.inf

    @property
    def stop_reason(self) -> StopReason:
        """Why the robot was last stopped, as far as is known; `none` before the first stop.

        Reasons of the board are known within half a second.
        """
        motion = self._motion
        return motion.stop_reason if motion else StopReason.NONE

    @property
    def mismatch(self) -> Optional[Mismatch]:
        """The wheel that did not follow its command, or why a board with an H-bridge has stopped the robot for a wheel
        (`wheel_blocked`, `encoder`); or None.  Only `stop` or a command of zero clears it; until then all other
        commands are refused.
        """
        return self._core.mismatch

    @property
    def hold(self) -> Optional[Hold]:
        """Whether other robots hold this one by radio; None without a radio, or before the board has said so.

        After a hold, the robot waits for a new command.
        """
        return self._core.hold

    def release_hold(self) -> bool:
        """Drop the robots that hold this one and have fallen silent; True if it is free of holds.

        Look first whether the place is free: a silent robot may stand there.  One that still speaks is not dropped.

        Raises:
            ConfigError: the board cannot be held by radio.
            BoardTimeout: the board does not answer.
            LinkLost: the port went away.
        """
        if HOLD not in self.board.capabilities:
            raise ConfigError(
                "the board cannot be held by radio, expected firmware of the radio build: mrl flash"
            )
        return self.ask(RELEASE) == (0,)

    @property
    def command(self) -> Optional[AnyTwist]:
        """The command in force, after limiting; None while stopped."""
        motion = self._motion
        target = motion.target if motion else None
        if target is None:
            return None
        speeds = [speed / 1000 for speed in target]
        return OmniTwist(*speeds) if len(speeds) == 3 else Twist(*speeds)

    def limited(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> AnyTwist:
        """The speeds that `drive` would use: scaled down to the limits, on the same arc.

        Raises:
            BoardTimeout: not connected yet.
            ConfigError: the board has no motors.
        """
        if self._core.state.info is None:
            raise BoardTimeout("not connected; call connect() first")
        with self._stop_if_refused():
            return self._core.limited(linear_m_s, angular_rad_s, lateral_m_s)

    @property
    def error(self) -> Optional[MrlError]:
        """The error that ended the driver, or None."""
        return self._error

    @property
    def board(self) -> Board:
        """The board's identity; its battery voltage and temperature are at most 2 s old.

        Raises:
            BoardTimeout: not connected yet.
        """
        if self._core.state.info is None:
            raise BoardTimeout("not connected; call connect() first")
        return self._core.state.info

    @property
    def warning(self) -> str:
        """A warning for the user about this board; empty if there is none."""
        return "; ".join(filter(None, (self.build_warning, self._firmware_warning)))

    @property
    def build_assumed(self) -> bool:
        """A 2013 board is taken to have sonars, because neither the model nor `Options.build` names its build."""
        return self._core.state.build_assumed

    @property
    def build_warning(self) -> str:
        """A part of `warning`: the board has another build than the model or `Options.build` names; or empty."""
        return self._core.state.build_warning

    @property
    def _firmware_warning(self) -> str:
        info, status = self._core.state.info, self.status
        if status is not None and "wiring" in status.faults:
            return (
                "the board refuses to move, because its bridge or wiring is not set; set it with: mrl calibrate wiring "
                "--port PORT"
            )
        if info is None or info.protocol >= 2 or not (self.model and self.model.drives):
            return ""
        name = "1 (2013)" if info.version < 2 else f"{info.version} without protocol"
        return (
            f"board firmware {name} has no watchdog: the robot drives on when the program dies or the cable is "
            "pulled; flash with: mrl flash --port PORT"
        )

    @property
    def telemetry(self) -> Optional[Telemetry]:
        """The last telemetry; None before the first, and with a board without motors."""
        return self._core.state.telemetry

    @property
    def pose(self) -> Pose:
        """Pose in the odom frame; (0, 0, 0) at the start, and always with a board without motors.  It has no jump when
        the board restarts, or when the heading changes from gyro and wheels to the wheels alone.
        """
        return self._core.state.odometry.pose if self._core.state.odometry else ORIGIN

    @property
    def twist(self) -> AnyTwist:
        """Measured speeds in base_link; zero while the board is not ready."""
        return (
            self._core.state.odometry.twist if self._core.state.odometry and self.ready else Twist(0.0, 0.0)
        )

    @property
    def imu(self) -> Optional[Imu]:
        """The last reading of the board's IMU, however old; None before the first."""
        tracker = self._core.state.tracker
        return tracker.last if tracker is not None else None

    @property
    def imu_state(self) -> str:
        """Whether the gyro gives the heading together with the wheels, or why not; one of `robot.imu.STATES`."""
        return self._core.state.imu_state

    @property
    def has_sonars(self) -> bool:
        """The board measures ranges; False before `connect`."""
        return self._core.state.has_sonars

    @property
    def ranges(self) -> Dict[str, float]:
        """Range of each sonar by name [m], by REP 117; empty if telemetry is stale."""
        return dict(self._core.state.ranges) if self.ready else {}

    @property
    def sensors(self) -> Dict[str, Reading]:
        """Readings of the sensors of `table.SENSORS` that answer, by name, without old readings."""
        with self._lock:
            return self._core.session.sensors.fresh(self.now_s) if self._core.begun and self.ready else {}

    @property
    def battery_v(self) -> float:
        """Battery voltage, at most 2 s old; NaN before it is known, and if the board does not measure it, as without
        motors.
        """
        return self._core.state.info.battery_v if self._core.state.info else math.nan

    @property
    def battery_state(self) -> str:
        """`ok`, `low`, `empty` or `off`, see `robot.battery`; `ok` if the board does not measure its battery."""
        return self._core.state.battery_state

    @property
    def temperature_c(self) -> float:
        """Temperature of the motor board; NaN before it is known, and if the board does not measure it."""
        return self._core.state.info.temperature_c if self._core.state.info else math.nan

    @property
    def status(self) -> Optional[Status]:
        """Uptime, stop reason, faults and clamped commands; None with 2013 boards."""
        status = self._core.session.status if self._core.begun else None
        return self._core.state.told(status) if status is not None else None

    @property
    def age_s(self) -> float:
        """Time since the last telemetry arrived; infinity before the first, and with the option `identify`."""
        streams = self._core.begun and not self._identifies
        return self.now_s - self._core.session.heard_s if streams else math.inf

    @property
    def link_delay_s(self) -> float:
        """Time from a request to the board's answer [s]: a command takes less.  Measured once a second, with boards of
        2013 every 2 s.  NaN until then, and while the board is not ready.
        """
        return self._core.session.round_trip_s(self.now_s) if self._core.begun else math.nan

    @property
    def statistics(self) -> Statistics:
        """Counters of the link.

        Raises:
            BoardTimeout: not connected yet.
        """
        with self._lock:
            if not self._core.begun:
                raise BoardTimeout("not connected; call connect() first")
            counters = self._core.session.counters
            counters.refused_counts = (
                self._core.state.odometry.baseline.refused if self._core.state.odometry else 0
            )
            counters.texts_dropped = self._core.radio_queue.dropped
            return counters.snapshot()

    def reset_pose(self, pose: Pose = ORIGIN, spread: Spread = AT_START) -> None:
        """Continue the odometry from `pose`, which has the covariance `spread`; counters and speeds do not change.

        Raises:
            ConfigError: a part of the pose is not finite, `spread` is not a covariance, or the board has no motors.
        """
        if self.model is not None:
            self.model.require_motors()
        with self._stop_if_refused():
            x_m, y_m, yaw_rad = require_numbers("pose", pose, Pose._fields)
            spread = _require_spread(spread)
        with self._lock:
            if self._core.state.odometry is not None:
                pose = Pose(x_m, y_m, wrap_angle(yaw_rad))
                self._core.state.odometry.set_pose(pose, spread)
                if self._links.recording is not None:
                    self._links.recording.pose(pose, spread)

    # -- callbacks: they run on the reading thread, one after the other, without a lock

    def on_telemetry(self, callback: Callable[[Telemetry], None]) -> None:
        """Call `callback` for each telemetry frame; boards without motors have none."""
        self._listen(self._listeners[Telemetry], callback)

    def on_imu(self, callback: Callable[[Imu], None]) -> None:
        """Call `callback` for each reading of the board's IMU, also while the gyro is not used; see `Imu.state`."""
        self._listen(self._listeners[Imu], callback)

    def on_status(self, callback: Callable[[Status], None]) -> None:
        """Call `callback` for each status of the board, twice a second."""
        self._listen(self._listeners[Status], callback)

    def on_battery(self, callback: Callable[[Board], None]) -> None:
        """Call `callback` for each new battery voltage and temperature."""
        self._listen(self._listeners[Board], callback)

    def on_sensor(self, callback: Callable[[SensorRead], None]) -> None:
        """Call `callback` with name and reading for each answer of a sensor of `table.SENSORS`."""
        self._listen(self._listeners[SensorRead], callback)

    def on_text(self, callback: Callable[[RadioText], None]) -> None:
        """Call `callback` for each text that the radio receives; one of more than 16 bytes comes in pieces."""
        self._listen(self._listeners[RadioText], callback)

    def on_event(self, callback: Callable[[Union[DriverEvent, MrlError]], None]) -> None:
        """Call `callback` for each `Awaited`, `Ready`, `Stale`, `Lost`, `Reconnected`, `Slowed`, `PathUnknown`,
        `ImuChanged` and `Reply` of `session.events`, for a wheel's `Mismatch`, a changed `Hold`, and for the `MrlError`
        that ends the driver.
        """
        self._listen(self._on_state, callback)

    def _listen(self, listeners: List[Listener], callback: Listener) -> None:
        with self._stop_if_refused():
            listeners.append(require_function("callback", callback))

    # -- the reading thread

    def _run(self) -> None:
        try:
            self._work()
        finally:
            with self._changed:
                self._changed.notify_all()  # a signal handler may have closed the driver just before a wait began

    def _work(self) -> None:
        try:
            while not self._closing:
                try:
                    if self._link is None:
                        self._seek()
                    else:
                        self._serve(self._link)
                except LinkLost as error:
                    self._lose(error)
                except BoardError as error:
                    if not self._links.searching:
                        raise
                    self._lose(error)
        except MrlError as error:
            self._give_up(error)
        except BaseException as error:
            if not self._closing:
                failure = MrlError(
                    f"a callback raised {error!r}; the driver has ended and sent a stop to the robot"
                )
                failure.__cause__ = error
                self._give_up(failure)
            raise

    def _serve(self, link: Link) -> None:
        """Read the link and do what is due, until it is lost or the driver is closed."""
        core, links, session, clock = self._core, self._links, self._core.session, time.monotonic_ns
        while self._link is link:
            data = link.read(min(1.0, core.due_s - clock() / 1e9))
            now = clock() // 1000 / 1e6  # as `recording.now_s`, without a call
            with self._lock:
                if self._closing:
                    with contextlib.suppress(BoardError):
                        self._take_last(data, now)
                    return
                if self._broken is not None:
                    raise self._broken
                # If the machine was suspended, stop; the driver's clock does not count that time.
                slept_s = time.clock_gettime(CLOCK_BOOTTIME) - time.monotonic()
                if slept_s > self._slept_s + PAUSE_S:
                    session.resumed_s = now
                    if session.motion.target is not None:
                        core.stop(now, StopReason.HOST_PAUSED)
                self._slept_s = slept_s
                if links.recording is None:
                    events = core.turn(data, now)
                else:
                    events = self._turn_recorded(data, now)
                    if links.recording.due:
                        self._exchange_link()
                if self._asking:
                    self._changed.notify_all()
            if links.searching or links.fast:
                events += self._supervise(link, now)
            if session.out:
                self._flush()
            if not self._settled and core.state.settled:
                self._settle()
            for event in events:
                for listener in self._listeners.get(type(event), self._on_state):
                    listener(event)

    def _turn_recorded(self, data: bytes, now: float) -> List[DriverEvent]:
        """As `Core.turn`, and record what a replay needs to do the same; with the lock."""
        recording, core = self._links.recording, self._core
        if recording is None:
            return core.turn(data, now)
        recording.heard(data, now)
        events = core.turn(data, now)
        recording.turned(data, events, core.session, core.state)
        return events

    def _take_last(self, data: bytes, now: float) -> None:
        """Take what was read while the driver was closed: it counts, but no listener is called; with the lock."""
        if self._links.recording is not None:
            self._links.recording.remark(ENDED + CLOSED, now)
        self._turn_recorded(data, now)

    def _settle(self) -> None:
        """Let `connect` return."""
        with self._changed:
            self._settled = True
            self._changed.notify_all()

    def _supervise(self, link: Link, now: float) -> Sequence[DriverEvent]:
        """In a search, check that the robot is the one that was lost; at a raised baud rate, count the link's errors.

        Raises:
            WrongRobot: another robot answers; its session was ended.
        """
        links, session = self._links, self._core.session
        events: List[DriverEvent] = []
        if links.searching:
            try:
                found = links.judge(session, now)
            except WrongRobot:
                with self._lock:
                    session.end()
                with contextlib.suppress(LinkLost):
                    self._flush()
                raise
            if found is not None:
                events.append(found)
                self._remark(RECONNECTED + found.port.encode("utf-8", "replace"))
        if links.fast and links.is_failing(session, now):
            with self._lock:
                alone = self._writer is None
                if alone:  # nobody else writes until the speed is changed
                    self._writer = (threading.get_ident(), link)
            if alone:
                links.fast = False
                try:
                    link.set_baud(BAUD)  # the board does the same by itself
                finally:
                    self._writer = None
                events.append(Slowed(BAUD))
                self._remark(SLOWED + b"%d" % BAUD)
        return events

    def _lose(self, error: MrlError) -> None:
        """Drop the link and start the search; raise `error` if the driver does not reconnect."""
        now = now_s()
        with self._lock:
            link = self._link
            if link is None or not self._may_search():
                raise error
            self._link = self._broken = None
            self._writer = None  # a write that still blocks on the lost link does not hinder the next one
            self._core.session.lose(now)
            may_be_moving = self._core.session.may_be_moving
        lost = self._links.lose(error, now, may_be_moving)
        if self._links.recording is not None:
            event = lost or Lost(link.port, str(error), may_be_moving)
            self._links.recording.lost(event, lost is not None, now)
        link.close()
        if lost is not None:
            self._tell_state(lost)

    def _may_search(self) -> bool:
        """The driver searches a lost port: not before the first connection, and only with the option `reconnect`."""
        return self._links.reconnects and self._settled and not self._closing and self._error is None

    def _seek(self) -> None:
        """Look for the port once.  If it is found, `_serve` greets the robot on it."""
        with self._changed:
            if self._changed.wait_for(lambda: self._closing, LOOK_S):
                return
        link = self._links.look()
        if link is None:
            return
        with self._lock:
            closing = self._closing
            if not closing:
                now, same = now_s(), self._links.same_board
                if self._links.recording is not None:
                    self._links.recording.again(now, same)
                self._core.session.relink(now, same)
                self._link, self._core.due_s = link, -math.inf
        if closing:
            link.close()

    def _tell_state(self, event: object) -> None:
        for listener in self._on_state:
            listener(event)

    # -- what is sent

    @contextlib.contextmanager
    def _stop_if_refused(self) -> Iterator[None]:
        """Stop the robot if an argument of a call is refused."""
        try:
            yield
        except (ConfigError, FrameError) as error:
            drives = self._core.begun and self._core.limiter.limits is not None
            if drives and self._error is None and not self._closing:
                with self._lock:
                    refused = self._core.refuse(error, self._clock())
                self._flush()
                raise refused from None
            raise

    def _connected(self) -> Core:
        if self._error is not None or self._closing or not self._core.begun:
            self._refuse()
        return self._core

    def _refuse(self) -> NoReturn:
        raise self._error or LinkLost("the driver is not connected, or was closed")

    def _flush(self) -> bool:
        """Send the session's bytes, and wake the reading thread if something is now due earlier.

        Only one thread writes at a time, without a lock.  What others add meanwhile, the reading thread sends next.
        A signal handler of the thread that writes may write as well.

        Returns:
            The port has accepted all bytes that were to be sent.
        """
        core, session, data = self._core, self._core.session, b""
        mine, accepted = (threading.get_ident(), self._link), True
        try:
            with self._lock:
                link, due_s = self._link, -math.inf if session.hurried else session.motion.due_s
                wake = due_s < core.due_s
                if wake:
                    core.due_s = due_s
                accepted = not session.out or self._writer is None or self._may_write()
                if session.out and accepted:
                    data = bytes(session.out)
                    self._writer = mine
                    session.out.clear()
                    session.counters.bytes_out += len(data)
                    self._line_free_s = max(self._line_free_s, self._clock()) + self._carries_s(len(data))
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
                with self._lock:
                    if self._writer is mine:
                        self._writer = None
                    link = self._link
                    if self._queuing:
                        self._changed.notify_all()
                    if session.out:
                        core.due_s, wake = -math.inf, True
        if wake and link is not None and threading.current_thread() is not self._thread:
            link.wake()
        return accepted

    def _await_writer(self, done: Callable[[], bool]) -> bool:
        """Wait for the write of another thread, which takes long only if the port blocks; with the lock."""
        self._queuing += 1
        in_time = self._changed.wait_for(done, WRITE_TIMEOUT_S)
        self._queuing -= 1
        return in_time

    def _carries_s(self, count: int) -> float:
        """Return how long the line needs for this many bytes [s]."""
        return count * BITS / (FAST_BAUD if self._links.fast else self._line_baud)

    def _await_line(self) -> None:
        """Wait until the line has carried all but `QUEUE_BYTES` of what was written; with the lock.

        Ports and networks accept more than the line carries.
        """
        while self._thread is not None and not self._closing:
            behind_s = self._line_free_s - self._carries_s(QUEUE_BYTES) - self._clock()
            if behind_s <= 0:
                return
            self._changed.wait(behind_s)

    def _may_write(self) -> bool:
        """Return whether this thread may write: no other does, or another cannot report that it is done."""
        return self._writer is None or self._writer[0] == threading.get_ident() or self._seized

    def _flush_all(self) -> None:
        """Send the session's bytes at the end, when the reading thread may not send them any more.

        If another thread is writing, wait for it, at most `CLOSE_S`.
        """
        deadline = time.monotonic() + CLOSE_S
        self._flush()
        while (self._core.session.out or not self._may_write()) and time.monotonic() < deadline:
            if self._link is None:
                return
            time.sleep(FLUSH_S)
            self._flush()

    def _on_broken(self, link: Link, error: LinkLost) -> None:
        """A write has found that the port is gone: the reading thread searches it, or stops the robot and ends.

        Raises:
            LinkLost: the driver does not search the port.
        """
        with self._lock:
            if inner(self._link) is not inner(link):
                return  # another thread has found it before
            self._broken = error
            if not self._may_search() and not self._closing:
                self._error = self._error or error
                self._changed.notify_all()
            failed = self._error is error
        link.wake()
        if failed:
            raise error

    # -- the end

    def _say_goodbye(self, wait: bool) -> None:
        """Stop the robot, wait for the confirmation, and set the board back to what a 2013 host expects.

        Without `wait` the reading thread cannot go on, because it is the caller or because the caller holds the lock.
        So this method reads the link.
        """
        try:
            core = self._core
            if self._error is not None:
                self._stop_for_good()  # the port may still take it
                return
            if wait:
                self._stop_for_good()
            else:
                self._halt()
            deadline = time.monotonic() + (0.0 if self._identifies else CLOSE_S)
            while wait and self.ready and not self.stopped and time.monotonic() < deadline:
                time.sleep(0.01)
            with self._lock:
                if not self.stopped:  # telemetry may not confirm the stop any more, so send it again
                    core.session.stop(self._clock(), StopReason.CLOSED)
                core.session.end()
                if self._links.fast:
                    core.session.request(BY_NAME["set_baud"].code, 0)
            self._flush_all()
        except MrlError:
            return

    def _stop_for_good(self) -> None:
        with self._lock:
            self._core.leaving = True
            self._core.limiter.drop()
            self._core.session.stop(self._clock(), StopReason.CLOSED)
        self._flush_all()

    def _give_up(self, error: MrlError) -> None:
        try:
            self._halt()
        except MrlError:
            return
        finally:
            self._fail(self._links.explained(error))

    def _halt(self) -> None:
        """Stop the robot and repeat the stop until telemetry confirms it; 2013 boards have no watchdog to do it."""
        core, link = self._core, self._link
        session = core.session
        self._remark(ENDED + CLOSED)  # no listener is called for what is read here
        self._stop_for_good()
        deadline = time.monotonic() + CLOSE_S
        while link is not None and session.ready and session.motion.stopping and time.monotonic() < deadline:
            data = link.read(min(core.due_s, deadline) - time.monotonic())
            with self._lock:
                self._turn_recorded(data, now_s())
            if session.out:
                self._flush()

    def _fail(self, error: MrlError) -> None:
        with self._changed:
            if self._closing:
                return
            self._error = error
            self._settle()
        self._remark(ENDED + f"{type(error).__name__}: {error}".encode("utf-8", "replace"))
        self._tell_state(error)
