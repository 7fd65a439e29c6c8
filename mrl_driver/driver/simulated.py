"""The driver in simulated time: the same class, but on a board that is stepped instead of a port.

    from sim_arduino.serve import factory

    board = factory.make(factory.Options(robot="traxbot")).board
    with SteppedDriver(board) as robot:
        for _ in range(20):
            robot.drive(0.2, 0.0)
            robot.wait(0.1)
        print(robot.pose)

It runs faster than real time, and each run gives exactly the same result.
"""

import math
from typing import Callable, Optional, Protocol, Tuple, Union

from mrl_driver.arguments import shown
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.recording.recording import CLOSED, ENDED
from mrl_driver.robot.models import RobotModel
from mrl_driver.transport.link import Link

from .connection import CLOSE_S, Connection
from .driver import Driver
from .link_source import LinkSource
from .options import DEFAULTS, Options, require_range, require_timeout
from .robot_core import Core

LONGEST_PAUSE_S = 1e6
LEAST_STEP_S = 1e-4
"""Shortest step of the board: about one byte on the wire [s]."""


class Stepped(Protocol):
    """A board in simulated time, such as an engine of the emulator."""

    @property
    def next_event_s(self) -> float:
        """Time of the next call of `advance` if no bytes arrive before [s]."""

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""

    def advance(self, to_s: float) -> bytes:
        """Run until `to_s`, counted from the board's start [s], and return the bytes sent since the last call."""


def whole_us(time_s: float) -> float:
    """Return the time rounded up to whole microseconds, so that a recording can hold it [s]."""
    rounded_s = math.ceil(time_s * 1e6) / 1e6
    return rounded_s if rounded_s >= time_s else (math.ceil(time_s * 1e6) + 1) / 1e6


class SteppedLink(Link):
    """A link to a stepped board; its time passes while it is read.

    Args:
        stepped: the board.
        round_up: rounds each time up; see `whole_us`.

    Attributes:
        now_s: simulated time since the board's start [s].
    """

    port = "a board in simulated time"

    def __init__(self, stepped: Stepped, round_up: Callable[[float], float] = float) -> None:
        self._stepped, self._round_up = stepped, round_up
        self.now_s = 0.0

    def read(self, timeout_s: float) -> bytes:
        """As `Link.read`: run the board until it has something to do, but not longer than `timeout_s`."""
        end_s = self.now_s + timeout_s
        self.now_s = self._round_up(min(end_s, max(self._stepped.next_event_s, self.now_s + LEAST_STEP_S)))
        return self._stepped.advance(self.now_s)

    def skip(self, seconds: float) -> bytes:
        """Run the board for `seconds` in one step, and return its bytes."""
        self.now_s = self._round_up(self.now_s + seconds)
        return self._stepped.advance(self.now_s)

    def write(self, data: bytes) -> None:
        self._stepped.receive(data)


class SteppedConnection(Connection):
    """A connection without a thread: it reads while the program waits.

    Attributes:
        stepped: the link to the board; `link` records it.
        record: file of a recording that begins with `connect`; None without one.
    """

    record: Optional[str] = None

    def __init__(self, core: Core, links: LinkSource, line_baud: int, identifies: bool) -> None:
        super().__init__(core, links, line_baud, identifies)
        self.stepped: SteppedLink = links.first(self.report)  # type: ignore[assignment]
        self.clock = lambda: self.stepped.now_s

    def connect(self) -> None:
        if self.core.begun:
            raise MrlError("this driver was connected already; create another one to connect again")
        self.link = self.stepped
        if self.record is not None:
            self.link = self.links.record_stepped(self.stepped, self.record, self.clock)
        self.core.begin(self.clock())
        while not self.core.state.settled:
            self._step(math.inf)

    def _ask_once(self, code: int, args: Tuple[int, ...], wait_s: float) -> Optional[Tuple[int, ...]]:
        self.request(code, *args)
        self.core.replies.pop(code, None)
        end_s = self.clock() + wait_s
        while self.core.answer(code, args) is None and self.clock() < end_s:
            self._step(end_s)
        return self.core.answer(code, args)

    def wait(self, timeout_s: Optional[float] = None) -> bool:
        with self.stop_if_refused():
            timeout_s = require_timeout("timeout_s", timeout_s)
        end_s = self.clock() + (math.inf if timeout_s is None else timeout_s)
        while self.clock() < end_s and not self.closing:
            self._step(end_s)
        return self.closing

    def close(self) -> None:
        """Stop the robot and end the session with the board."""
        if self.closing or not self.core.begun:
            return
        try:
            self.core.leaving = True
            if self.error is None:
                self.stop_for_good()
                end_s = self.clock() + CLOSE_S
                while not self.stopped and self.clock() < end_s:
                    self._step(end_s)
                self.core.session.end()
                self.flush()
        finally:
            self.closing = True
            self.remark(ENDED + CLOSED)
            self.links.end_recording()

    def _step(self, end_s: float) -> None:
        """Advance to the next time at which board or driver has something to do, but not beyond `end_s`."""
        core = self.connected()
        now = self.clock()
        due_s = min(end_s, max(core.deadline(now), now + LEAST_STEP_S))
        self.process(self.stepped.read(due_s - now))

    def process(self, data: bytes) -> None:
        """Give these bytes to the core now, and call the listeners."""
        try:
            events = self.turn_recorded(data, self.clock())
            self.flush()
        except MrlError as error:
            self.error = error
            self.remark(ENDED + f"{type(error).__name__}: {error}".encode("utf-8", "replace"))
            self.core.session.stop(self.clock(), StopReason.CLOSED)
            self.flush()
            raise
        self.report(events)


class SteppedDriver(Driver):
    """A robot on a `stepped` board, without a thread.  Time passes in `connect`, `wait`, `ask`, `pause` and `close`.

    Errors are those of `Driver`, but for those of ports.

    Args:
        stepped: the board; its time starts at 0.
        robot: as for `Driver`.
        options: as for `Driver`, without `reconnect`.  With `record`, times are simulated ones, in whole microseconds.

    Raises:
        ConfigError: the robot model is unknown or invalid, or an option is out of range.
    """

    _connection: SteppedConnection
    _connection_kind = SteppedConnection

    def __init__(
        self, stepped: Stepped, robot: Union[str, RobotModel] = "auto", options: Options = DEFAULTS
    ) -> None:
        # Not isinstance: from Python 3.12 on it does not see what an object passes on to another one.
        if not all(hasattr(stepped, name) for name in ("receive", "advance", "next_event_s")):
            raise ConfigError(f"stepped is {shown(stepped)}, expected a board in simulated time")
        board = SteppedLink(stepped, float if options.record is None else whole_us)
        super().__init__(board, robot, options=options._replace(record=None))
        self._connection.record = options.record

    def pause(self, seconds: float) -> None:
        """Simulate a suspended process: the board keeps running, and its bytes are read after `seconds`.

        Raises:
            ConfigError: `seconds` is not a number from 0 to `LONGEST_PAUSE_S`.
            MrlError: the driver failed; this is the error.
        """
        connection = self._connection
        with connection.stop_if_refused():
            seconds = require_range("seconds", seconds, 0, LONGEST_PAUSE_S, "s", whole=False)
        connection.connected()
        connection.process(connection.stepped.skip(seconds))
