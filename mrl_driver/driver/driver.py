"""The robot as an object: SI units in and out, one reading thread, no output to the terminal.

    with Driver("/dev/ttyACM0") as robot:
        for _ in range(20):
            robot.drive(0.2, 0.0)
            robot.wait(0.1)
        print(robot.pose)

The robot stops 0.5 s after the last `drive`; `Options(command_timeout_s=...)` changes that time.  The robot also stops
at the end of the `with` block and at the end of the program.  All methods may be called from any thread.  Callbacks run
on the reading thread and must not call `ask` or `wait`.
"""

import atexit
import threading
import time
from typing import Optional, Tuple, Union

from mrl_driver.errors import BoardTimeout, ConfigError, LinkLost, MrlError
from mrl_driver.protocol.table import BAUD
from mrl_driver.recording.recording import Recorder
from mrl_driver.robot import models
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.session.handshake import Board
from mrl_driver.transport.address import require_port
from mrl_driver.transport.baud_rates import FAST_BAUD, require_raisable
from mrl_driver.transport.link import Link

from .options import DEFAULTS, Options, require_options, require_range
from .robot_core import Core
from .runner import Runner

__all__ = ["Board", "Driver", "Options", "Telemetry"]

ATTEMPTS, ANSWER_S = 3, 0.5
"""`ask` sends a request at most this many times and waits this long for each reply [s]."""


class Driver(Runner):
    """A robot on a serial port.

    Args:
        port: device name, URL (`tcp://host:port`, `udp://host:port`, or a pyserial URL), or an open `Link`.
        robot: name of a packaged model, path of a YAML file, a `RobotModel`, or `auto`: the model that lists
            the robot id reported by the board.
        baud: baud rate of the serial port [Bd]; with a network address, baud rate of the serial line behind it.
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
        require_range("baud", baud, 300, 4_000_000, "Bd", int)
        require_options(options)
        if isinstance(port, str):
            require_port(port)
        if options.record is not None and isinstance(port, Link):
            raise ConfigError("record is given with an open link, expected a port by name")
        if options.fast:
            require_raisable(port, baud)
        options = options._replace(line_baud=min(baud, options.line_baud))
        model = robot if isinstance(robot, RobotModel) else None if robot == "auto" else models.load(robot)
        super().__init__(Core(model, options), port, baud, options)

    def connect(self) -> Board:
        """Open the port, greet the board and start its stream.  The robot gets a stop and stays still.

        Returns:
            The board's identity, after the first telemetry has arrived.

        Raises:
            ConfigError: the recording cannot be written.
            PortMissing, PortDenied, PortBusy, LinkError: the port cannot be opened.
            NotARobot: nothing answers, or the answer is not made of frames.
            WrongRobot: another robot answers, or the board speaks another protocol.
            BatteryDead: motor power is off, or the battery is too low to start (unless `ignore_battery`).
            BoardTimeout, LinkLost: the board stopped answering, or the port went away, during the greeting.
        """
        if self._thread is not None or self._closing:
            raise MrlError("this driver was connected already; create another one to connect again")
        self._begin()
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
        """Stop the robot, wait at most a second for telemetry to confirm the stop, and close the port."""
        with self._lock:
            thread, trial = self._thread, self._trial
            self._closing = self._closing or (thread is None and self._beginning)
        if thread is None:
            if trial is not None:
                trial.close()
            return
        on_thread = thread is threading.current_thread()
        if self._error is None and not self._closing:
            self._say_goodbye(wait=not on_thread)
        with self._changed:
            self._closing = True
            self._changed.notify_all()
            links = self._link, self._trial
        self._settled.set()
        for link in links:
            if link is not None:
                link.close()
        if not on_thread:
            thread.join()
        self._end_tape()
        atexit.unregister(self._end_with_program)

    def _end_with_program(self) -> None:
        """Close at the end of the program: after an error the driver may still be open, and 2013 boards drive on."""
        self.close()

    def __enter__(self) -> "Driver":
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def line_baud(self) -> int:
        """Current speed of the line [Bd]: 500000 if the option `fast` has raised it, else the port's baud rate."""
        return FAST_BAUD if self._fast else self._baud

    @property
    def recorder(self) -> Optional[Recorder]:
        """The recorder, with the lines it `lost` and its last `error`; None without a recording."""
        return self._tape.recorder if self._tape is not None else None

    def wait(self, timeout_s: Optional[float] = None) -> bool:
        """Sleep until the driver is closed or has failed; False if `timeout_s` ended first.

        Raises:
            MrlError: the driver failed; this is the error, such as LinkLost.
        """
        with self._changed:
            ended = self._changed.wait_for(lambda: self._closing or self._error is not None, timeout_s)
            if self._error is not None:
                raise self._error
            return ended

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> bool:
        """Drive at these speeds for at most 0.5 s; call again before then to keep driving.

        The option `command_timeout_s` sets another time.  Speeds above the model's limits are scaled down together, so
        the arc stays the same.  The latest command wins; commands are never queued.  If the board falls silent or
        restarts, the command is dropped and the robot waits for a new one.

        Args:
            linear_m_s: forward speed.
            angular_rad_s: yaw rate, counter-clockwise.
            lateral_m_s: speed to the left, if the base can move sideways.

        Returns:
            True if the command is in force.  False if the board is silent or being greeted, the port is lost, the
            battery is empty, a wheel does not follow its command (see `mismatch`), or the driver is being closed.

        Raises:
            FrameError: a speed is NaN or infinite, or the base cannot move sideways; the robot was stopped.
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
        """Send any other request of the command table; `on_event` gets the reply.

        Raises:
            FrameError: the command table does not allow the request.
            BoardTimeout: the request would turn motors, and the board is silent; it was not sent.
            LinkLost: the port went away.
        """
        with self._lock:
            core = self._connected()
            if self._link is None:
                raise LinkLost("the port went away and is searched; try again when it is back")
            core.session.request(code, *args)
            self._flush()

    def ask(self, code: int, *args: int, timeout_s: float = ANSWER_S) -> Tuple[int, ...]:
        """Send a request, wait for its `Reply` and return the reply's fields; repeat the request if no reply comes.

        Do not use it for `robot_info`, `read_status` and the wheel counters, which arrive without a request, nor on
        the reading thread.

        Raises:
            FrameError: the command table does not allow the request.
            BoardTimeout: no reply within `timeout_s`, in each of three attempts.
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
