"""The driver in simulated time: the same core, but on a board that is stepped instead of a port.

    board = boards.make(boards.Options(robot="traxbot")).engine
    with SteppedDriver(board) as robot:
        for _ in range(20):
            robot.drive(0.2, 0.0)
            robot.wait(0.1)
        print(robot.pose)

It runs faster than real time, and each run gives exactly the same result.  It behaves as `Driver` does.
"""

import math
from typing import Protocol, Tuple, Union

from mrl_driver.errors import BoardTimeout, LinkLost, MrlError
from mrl_driver.robot import models
from mrl_driver.robot.models import RobotModel
from mrl_driver.session.handshake import Board

from .options import DEFAULTS, Options, require_options
from .readout import Readout
from .robot_core import Core

LEAST_STEP_S = 1e-4
"""Shortest step of the board: about one byte on the wire [s]."""
CLOSE_S, ATTEMPTS, ANSWER_S = 0.8, 3, 0.5
"""As in `runner` and `driver`."""


class Stepped(Protocol):
    """A board in simulated time, such as an engine of the emulator."""

    @property
    def next_event_s(self) -> float:
        """Time of the next call of `advance` if no bytes arrive before [s]."""

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""

    def advance(self, to_s: float) -> bytes:
        """Run until `to_s`, counted from the board's start [s], and return the bytes sent since the last call."""


class SteppedDriver(Readout):
    """A robot on a `stepped` board, without a thread.  Time passes in `connect`, `wait`, `ask`, `pause` and `close`.

    Args:
        stepped: the board; its time starts at 0.
        robot: as for `Driver`.
        options: as for `Driver`, without `reconnect` and `record`.

    Raises:
        ConfigError: the robot model is unknown or invalid, or an option is out of range.
    """

    def __init__(
        self, stepped: Stepped, robot: Union[str, RobotModel] = "auto", options: Options = DEFAULTS
    ) -> None:
        require_options(options)
        model = robot if isinstance(robot, RobotModel) else None if robot == "auto" else models.load(robot)
        super().__init__(Core(model, options))
        self._stepped = stepped
        self._now_s = 0.0
        self._closed = False

    recorder = None
    """Nothing is recorded."""

    @property
    def now_s(self) -> float:
        """Simulated time since the board's start."""
        return self._now_s

    def connect(self) -> Board:
        """As `Driver.connect`, but without the errors of ports."""
        if self._core.begun:
            raise MrlError("this driver was connected already; create another one to connect again")
        self._core.begin(self._now_s)
        while self._core.state.telemetry is None:
            self._step(math.inf)
        return self.board

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> bool:
        """As `Driver.drive`."""
        core = self._connected()
        try:
            return core.drive(linear_m_s, angular_rad_s, self._now_s, lateral_m_s)
        finally:
            self._flush()

    def stop(self) -> None:
        """As `Driver.stop`."""
        self._connected().stop(self._now_s, "user")
        self._flush()

    def request(self, code: int, *args: int) -> None:
        """As `Driver.request`."""
        self._connected().session.request(code, *args)
        self._flush()

    def ask(self, code: int, *args: int, timeout_s: float = ANSWER_S) -> Tuple[int, ...]:
        """As `Driver.ask`."""
        core = self._core
        for _ in range(ATTEMPTS):
            core.replies.pop(code, None)
            self.request(code, *args)
            end_s = self._now_s + timeout_s
            while core.answer(code, args) is None and self._now_s < end_s:
                self._step(end_s)
            reply = core.answer(code, args)
            if reply is not None:
                return reply
        raise BoardTimeout(
            f"no answer to request {code} in {ATTEMPTS} attempts of {timeout_s:g} s; try again"
        )

    def wait(self, timeout_s: float) -> bool:
        """Let `timeout_s` pass; True if the driver was closed during that time.

        Raises:
            MrlError: the driver failed; this is the error.
        """
        end_s = self._now_s + timeout_s
        while self._now_s < end_s and not self._closed:
            self._step(end_s)
        return self._closed

    def pause(self, seconds: float) -> None:
        """Simulate a suspended process: the board keeps running, and its bytes are read after `seconds`.

        Raises:
            MrlError: the driver failed; this is the error.
        """
        core = self._connected()
        self._now_s += seconds
        self._turn(core, self._stepped.advance(self._now_s))

    def close(self) -> None:
        """Stop the robot and end the session with the board."""
        if self._closed or not self._core.begun:
            return
        try:
            self._core.leaving = True
            if self._error is None:
                self._take_leave()
        finally:
            self._closed = True

    def _take_leave(self) -> None:
        self._core.session.stop(self._now_s, "closed")
        self._flush()
        end_s = self._now_s + CLOSE_S
        while not self.stopped and self._now_s < end_s:
            self._step(end_s)
        self._core.session.end()
        self._flush()

    def __enter__(self) -> "SteppedDriver":
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _connected(self) -> Core:
        if self._error is not None:
            raise self._error
        if self._closed or not self._core.begun:
            raise LinkLost("the driver is not connected, or was closed")
        return self._core

    def _step(self, end_s: float) -> None:
        """Advance to the next time at which board or driver has something to do, but not beyond `end_s`."""
        core = self._connected()
        due_s = min(end_s, core.session.deadline(self._now_s), self._stepped.next_event_s)
        self._now_s = min(end_s, max(due_s, self._now_s + LEAST_STEP_S))
        self._turn(core, self._stepped.advance(self._now_s))

    def _turn(self, core: Core, data: bytes) -> None:
        """Give these bytes to the core now, and call the listeners."""
        try:
            notices = core.turn(data, self._now_s)
            self._flush()
        except MrlError as error:
            self._error = error
            core.session.stop(self._now_s, "closed")
            self._flush()
            raise
        self._call(notices)

    def _flush(self) -> None:
        data = self._core.session.take()
        if data:
            self._stepped.receive(data)
