"""The real `Driver` and `Commander` on an explored board, in simulated time and in one thread.

The driver's own code serves the link, loses it and finds it again; only its clock, its locks and its ports are
replaced.  A call of `World.run` goes on where the last one ended, in the middle of `Connection.serve`: the link raises
`StepEnd` when it would wait beyond the end of the step.
"""

import contextlib
import math
import threading
from typing import Any, Callable, Iterator, Optional, Tuple

from mrl_driver.clocks import wait_until
from mrl_driver.driver import Driver
from mrl_driver.driver import connection as connection_module
from mrl_driver.driver.options import Options
from mrl_driver.errors import BoardError, BoardTimeout, LinkLost, MrlError
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.recording.recorded_link import DriverRecording
from mrl_driver.session.events import Lost, Reconnected
from mrl_driver.session.handshake import Handshake
from ros1_bridge.control.commander import Commander

from .board import ExploredBoard

LEAST_STEP_S = 1e-4  # Shortest step of the board: about one byte on the wire [s]
PORT = "/dev/explored"
POLL_S, POLLED = 0.02, BY_NAME["read_status"].code
"""While a callback hangs, another thread sends this request so often [s]."""
COUNTS_AHEAD = 900  # The counters of another board are ahead by this much: 0.079 m, which wheels could reach
SETTLE_S = 0.4
DAMAGE = bytes(range(256)).replace(b",", b"?").replace(b"e", b"?")
"""What the line makes of each byte when it damages all frames."""
PROGRAM = Handshake._program
_TIME, _NOW_S = connection_module.time, connection_module.now_s


class StepEnd(BaseException):
    """The end of the step was reached."""


class Lock:
    """A lock, or a condition, of the only thread there is."""

    CONSTANT = True

    def __init__(self, world: "World") -> None:
        self._world = world

    def __enter__(self) -> "Lock":
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def notify(self, _: int = 1) -> None:
        """As of a condition."""

    def notify_all(self) -> None:
        """As of a condition."""

    def wait_for(self, holds: Callable[[], Any], timeout_s: Optional[float] = None) -> Any:
        """As of a condition: time passes, but not in a call of the user, which gives up at once."""
        world, line = self._world, self._world.line
        held = holds()
        if held:
            line.wait_until = -math.inf
        if held or not world.running:
            return held
        if (
            line.wait_until == -math.inf
        ):  # otherwise the wait goes on that the last step's end has interrupted
            line.wait_until = world.board_s + (math.inf if timeout_s is None else timeout_s)
        world.pass_time(line.wait_until - world.board_s)
        line.wait_until = -math.inf
        return holds()


class Clock:
    """Stands for the module `time` in the driver.

    A suspended machine's boot clock goes on, its monotonic clock does not.
    """

    CONSTANT = True

    def __init__(self, world: "World") -> None:
        self._world = world

    def monotonic_ns(self) -> int:
        return round(self._world.host_s * 1e6) * 1000

    def monotonic(self) -> float:
        return self._world.host_s

    def clock_gettime(self, _: int) -> float:
        return self._world.host_s + self._world.slept_s

    def sleep(self, seconds: float) -> None:
        self._world.pass_time(seconds)


class Steps:
    """The generator `Handshake._program` in a form that can be copied: it is run again from its start.

    Its decisions depend on what the board had answered when they were made, so this is kept.
    """

    def __init__(self, handshake: Handshake, make: Callable[[Any], Iterator[Tuple[int, ...]]]) -> None:
        self.handshake, self.make = handshake, make
        self.answers: Tuple[Any, ...] = ()

    def __iter__(self) -> "Steps":
        return self

    def __next__(self) -> Tuple[int, ...]:
        handshake = self.handshake
        self.answers += ((handshake.board, handshake._sure, handshake.stream),)
        stand_in = object.__new__(Handshake)
        stand_in.__dict__.update(handshake.__dict__)
        steps, step = self.make(stand_in), (0,)
        for stand_in.board, stand_in._sure, stand_in.stream in self.answers:
            step = next(steps)
        return step


class Ports:
    """Stands for `LinkSource` and its search: one port, which may go and come back with the same or another board."""

    def __init__(self) -> None:
        self.recording: Optional[DriverRecording] = None
        self.fast = self.searching = False
        self.same_board = self.plugged = True
        self.link: Any = None

    def lose(self, error: MrlError, now: float, may_be_moving: bool) -> Optional[Lost]:
        first, self.searching = not self.searching, True
        return Lost(PORT, str(error), may_be_moving) if first else None

    @property
    def reconnection(self) -> "Ports":
        return self

    def look(self) -> Any:
        return self.link if self.plugged else None

    def judge(self, session: Any, now: float) -> Optional[Reconnected]:
        if not session.ready:
            return None
        self.searching = False
        session.counters.reconnects += 1
        return Reconnected(PORT)

    def close(self) -> None:
        """As of `LinkSource`."""

    def end_recording(self) -> None:
        if self.recording is not None:
            self.recording.close()


class Link:
    """The driver's end of the line."""

    CONSTANT = True
    port = PORT

    def __init__(self, world: "World") -> None:
        self._world = world

    def read(self, timeout_s: float) -> bytes:
        return self._world.read(timeout_s)

    def write(self, data: bytes) -> None:
        self._world.write(data)

    def wake(self) -> None:
        """As `Link.wake` of the transport."""

    def close(self) -> None:
        """As `Link.close` of the transport."""


class Line:
    """What happens to the bytes.  Times are the board's [s]; a fault lasts until its time."""

    def __init__(self) -> None:
        self.lost_until = self.mute_until = self.damaged_until = self.twice_until = (
            self.blocked_until
        ) = -math.inf
        self.zones_until = self.wait_until = self.hung_until = -math.inf
        self.backlog = b""  # Bytes from the board that the host has not read
        self.stop_s = self.heard_s = self.fault_s = self.move_s = -math.inf
        """When an undamaged stop was sent, telemetry was read, the last fault ended, and an undamaged move was sent."""
        self.board_s = self.slept_s = self.end_s = 0.0
        self.ended = ""
        self.planner_drives = False  # A planner sends a command with each step


class _Driver(Driver):
    """A driver on the explorer's thread: it ends with its board, and has nothing to close."""

    def __del__(self) -> None:
        """Stop no robot."""


class World:
    """A robot: board, line, driver and commander."""

    def __init__(self, board: ExploredBoard, timeout_s: Optional[float] = 0.5, period_ms: int = 25) -> None:
        self.board, self.line = board, Line()
        self.timeout_s, self.watchdog_s = timeout_s, 0.25
        self.user_timeout_s = timeout_s or 0.5
        clock, lock = Clock(self), Lock(self)
        module: Any = connection_module
        kind: Any = Handshake
        module.time, module.now_s, module.wait_until = clock, clock.monotonic, lock.wait_for
        kind._program = lambda handshake: Steps(handshake, PROGRAM)
        options = Options(command_timeout_s=timeout_s, period_ms=period_ms, reconnect=True)
        self.driver = driver = _Driver(PORT, "traxbot", options=options)
        mine: Any = driver._connection
        mine.clock, mine.lock, mine.changed = clock.monotonic, lock, lock
        self.ports = Ports()
        self.ports.link = Link(self)
        mine.links = self.ports
        mine.thread = threading.current_thread()
        self.commander = Commander(driver, clock.monotonic)
        self.commander._lock = lock
        self.other_board = b""
        self.running = False  # The driver does its work, or another thread polls

    def end(self) -> None:
        """Give the driver's module its clock back, for those who use it after this world."""
        module: Any = connection_module
        kind: Any = Handshake
        module.time, module.now_s, module.wait_until, kind._program = _TIME, _NOW_S, wait_until, PROGRAM

    # -- start

    def begin(self, record: Optional[str] = None) -> None:
        """Connect, and wait until the robot stands ready; `record` is the file of a recording."""
        driver = self.driver
        link: Any = self.ports.link
        if record is not None:
            self.ports.recording = DriverRecording(PORT, 115200, None, {}, driver._connection.clock)
            self.ports.recording.use(self.ports.recording.create(record))
            link = self.ports.link = self.ports.recording.begin(link)
        driver._connection.link = link
        driver._core.begin(self.host_s)
        self.run(SETTLE_S)
        while not (driver._core.state.settled and driver.ready and driver.stopped):
            self.run(0.05)
        self.other_board = self.board.save()

    # -- time

    @property
    def board_s(self) -> float:
        """The board's time [s]."""
        return self.line.board_s

    @property
    def slept_s(self) -> float:
        """How long the host's machine was suspended [s]."""
        return self.line.slept_s

    @property
    def host_s(self) -> float:
        """The host's time [s]."""
        return self.line.board_s - self.line.slept_s

    def advance(self, to_s: float) -> bytes:
        """Run the board; return its bytes."""
        data = self.board.run(to_s)
        self.line.board_s = max(self.line.board_s, self.board.now_s)
        return data

    def pass_time(self, seconds: float) -> None:
        """Time passes while the driver waits; what arrives is read later."""
        line = self.line
        end_s = min(line.end_s, round(line.board_s + max(seconds, LEAST_STEP_S), 6))
        while line.board_s < end_s:
            line.backlog += self.heard(self.advance(end_s))
        if line.board_s >= line.end_s:
            raise StepEnd

    def run(self, seconds: float) -> None:
        line, driver = self.line, self.driver
        line.end_s = round(line.board_s + seconds, 6)
        if line.ended:
            while line.board_s < line.end_s:
                self.advance(line.end_s)
            return
        self.running = True
        try:
            self._hang()
            while True:
                try:
                    if driver._connection.link is None:
                        driver._connection.seek()
                    else:
                        driver._connection.serve(driver._connection.link)
                except LinkLost as error:
                    driver._connection.lose(error)
                except BoardError as error:
                    if not self.ports.searching:
                        raise
                    driver._connection.lose(error)
        except StepEnd:
            return
        except MrlError as error:
            line.ended = f"{type(error).__name__}: {error}"
            driver._connection.stop_for_good()
        finally:
            self.running = False

    def _hang(self) -> None:
        """A callback hangs, and another thread polls the board."""
        line = self.line
        while line.board_s < line.hung_until:
            self.pass_time(min(POLL_S, line.hung_until - line.board_s))
            with contextlib.suppress(MrlError):
                self.driver.request(POLLED)

    def stand_still(self, seconds: float, suspended: bool = False) -> None:
        """The host does not run; the board goes on."""
        line = self.line
        end_s = round(line.board_s + seconds, 6)
        while line.board_s < end_s:
            line.backlog += self.heard(self.advance(end_s))
        if suspended:
            line.slept_s += seconds

    # -- bytes

    def heard(self, data: bytes) -> bytes:
        line = self.line
        return b"" if line.board_s <= line.mute_until or not self.ports.plugged else data

    def read(self, timeout_s: float) -> bytes:
        line = self.line
        if not self.ports.plugged:
            raise LinkLost(f"{PORT} is gone")
        if line.board_s < line.zones_until and not line.ended:
            self.driver.limit_again()
        data, line.backlog = line.backlog, b""
        if not data:
            if line.board_s >= line.end_s:
                raise StepEnd
            to_s = min(line.end_s, line.board_s + max(timeout_s, LEAST_STEP_S))
            data = self.heard(self.advance(to_s))
        if data:
            line.heard_s = line.board_s
        elif line.board_s >= line.end_s:
            raise StepEnd
        return data

    def write(self, data: bytes) -> None:
        """Put the host's bytes on the line, with its faults."""
        line, now_s = self.line, self.line.board_s
        if not self.ports.plugged or self.driver._connection._broken is not None:
            raise LinkLost(f"{PORT} is gone")
        if now_s < line.lost_until:
            return
        if now_s < line.damaged_until:
            self.board.receive(data.translate(DAMAGE), False)
            return
        if b"@13e" in data:
            line.stop_s = now_s
        if b"@9," in data or b"@11," in data or b"@12," in data:
            line.move_s = now_s
        self.board.receive(data)
        if now_s < line.twice_until:
            self.board.receive(data)

    def block(self) -> None:
        """Another thread's write blocks: what is sent meanwhile waits in the session."""
        self.driver._connection.writer = (-1, self.driver._connection.link)

    def unblock(self) -> None:
        driver = self.driver
        if driver._connection.writer is not None and driver._connection.writer[0] == -1:
            driver._connection.writer = None
            try:
                driver._connection.flush()
            except (LinkLost, BoardTimeout):
                return
