"""The driver on a recording: the same class, but its bytes and times come from the file, and it sends nothing.

    robot = RecordedDriver("drive.mrl")
    robot.on_telemetry(lambda telemetry: print(robot.time_s, telemetry.pose))
    robot.play()

A recording that begins before the greeting (option `record`) gives the listeners exactly what those of the recorded
driver got, to the last bit.  One that begins later (`recorder.start`, or a damaged file) gives the same poses; the
board's time is matched to the host's clock again, so that stamps differ by milliseconds.
"""

import json
import math
import os
from typing import (
    Any,
    Callable,
    Dict,
    Iterable,
    Iterator,
    List,
    NamedTuple,
    NoReturn,
    Optional,
    Sequence,
    Tuple,
    Union,
)

from mrl_driver import errors
from mrl_driver.arguments import require_function
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.protocol import REPLIES, REQUESTS_TO_ANY, Event, Frame
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.recording.decoded import LINE_BYTES, FrameReader
from mrl_driver.recording.recorded_facts import Gap, gap_of, model_of, numbers_of, pose_of, session_of
from mrl_driver.recording.recording import (
    CLOCK,
    CLOSED,
    ENDED,
    ENDS,
    FROM_BOARD,
    LACKS,
    LOST,
    MODEL,
    OPENED,
    POSE,
    RECONNECTED,
    REMARK,
    SESSION,
    SLOWED,
    STOP,
    Entry,
    Recording,
    started_s,
)
from mrl_driver.robot import models
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.odometry import AnyWheels
from mrl_driver.robot.wheel_odometry import MOVE_OMNI, MOVE_TWIST, commands_of
from mrl_driver.robot.wheel_odometry import STREAMS as WHEEL_STREAMS
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.session.events import Counts, Lost, Reconnected, Slowed
from mrl_driver.session.handshake import Board, board_of, capabilities_of
from mrl_driver.session.motion_command import MOVE
from mrl_driver.session.motion_command import STOP as STOP_CODE
from mrl_driver.session.session import STREAMS, Session
from mrl_driver.transport.link import Link

from .driver import Driver
from .options import DEFAULTS, HEARD, Options, require_options
from .robot_core import Core, DriverEvent

_REPORT_EVERY = 2000
_OPENING_ENTRIES = 2000  # the remarks that hold for a whole recording are looked for in this many entries
_MOST_TURNS = 200  # at most this many are made between two entries of a file without the session's beginning
_LEAST_FRAMES = _LEAST_MOVES = 3
_GREETING_S, _LONG_GREETING_S = 1.0, 5.0
"""A greeting that does not end while the board streams for this time is incomplete in the file: the session goes on
without it.  The longer time is for files that have each turn of the driver [s].  After `_LEAST_MOVES` commands it does
not wait: no driver sends them in a greeting."""
_PROTOCOL_S, _SILENCE_S = 0.5, 0.5
_OLDEST_STAMP_S = 10.0  # a session that is joined has telemetry that is younger, or the file is damaged [s]
_MOST_FAILURES = 3
_INFO, _PROTOCOL, _CHECK, _IMU = (
    BY_NAME[name].code for name in ("robot_info", "read_protocol", "set_check", "read_imu")
)
_GREETING = {
    _CHECK,
    *(
        BY_NAME[name].code
        for name in ("stop_stream", "start_stream", *WHEEL_STREAMS.values(), "read_protocol")
    ),
}
"""Requests of a greeting."""
_OWN_REMARKS = (OPENED, SESSION, POSE, STOP, CLOCK, LOST, RECONNECTED, SLOWED, ENDED, LACKS, ENDS)
"""`RecordedDriver` has a method for each: `_on_opened` and so on."""


class Sent(NamedTuple):
    """A frame, or garbage, that the host sent."""

    time_s: float  # time since the recording began [s]
    event: Event
    data: bytes  # the bytes of this frame, or of the garbage


class Heard(Sent):
    """A frame, or garbage, that the board sent."""


class Remark(NamedTuple):
    """A remark of the driver, or of its user."""

    time_s: float  # time since the recording began [s]
    text: str


class _RecordedSession(Session):
    """A session that never paused, is never refused and stops no motion: the recording has the program's stops."""

    def _resume(self, now: float) -> None:
        pass

    def _refuses(self, least_s: float, now: float) -> bool:
        return False

    def _on_uncommanded_motion(self, now: float) -> None:
        pass


class _RecordedCore(Core):
    """A core that gets a wheel's mismatch from the recording."""

    session: _RecordedSession
    session_kind = _RecordedSession

    def _check_wheels(self, travel: AnyWheels, event: Counts, now: float) -> List[DriverEvent]:
        return []

    def _on_own_stop(self, reason: str) -> List[DriverEvent]:
        return []


class _RecordedPort(Link):
    """The link of a driver that sends nothing, and whose bytes come from a file."""

    def __init__(self, port: str) -> None:
        self.port = port

    def read(self, timeout_s: float) -> bytes:
        """Return nothing."""
        return b""

    def write(self, data: bytes) -> None:
        """Send nothing."""


class _Opening(NamedTuple):
    """What the first entries say about the whole recording."""

    model: Optional[RobotModel]
    ahead_s: Optional[float]
    has_session: bool  # the file holds where its sessions begin
    is_cut: bool  # the file does not begin with a port that was opened
    frames: List[Frame]  # replies that describe the board, if the file is cut


class RecordedDriver(Driver):
    """The robot of a recording.  Listeners are called by `play`, as those of the recorded driver were.

    Args:
        recording: the file, or its name.
        robot: as for `Driver`; `auto` is the model in the recording, else the one that lists the board's robot id.

    Attributes:
        recording: the file.
        time_s: time of the entry that is being played, since the recording began [s].
        gaps: lines that could not be written, so far.
        breaks_off: the end of the recording is missing, and nobody writes it any more; after `play`.

    Raises:
        ConfigError: the file is not a recording, or the robot model is unknown or invalid.
    """

    _core: _RecordedCore
    _core_kind = _RecordedCore

    def __init__(self, recording: Union[str, Recording], robot: Union[str, RobotModel] = "auto") -> None:
        self.recording = recording if isinstance(recording, Recording) else Recording(recording)
        header, opening = self.recording.header, _opening(self.recording)
        options = _options(header)
        self.time_s = 0.0
        self._start_us = self.recording.start_us
        self._now = self._start_us / 1e6
        started_ahead_s = started_s(header) - self._now
        self._clock_ahead_s = opening.ahead_s if opening.ahead_s is not None else started_ahead_s
        if robot != "auto":
            options = options._replace(any_id=True)
        elif opening.model is not None:
            robot = opening.model
        super().__init__(_RecordedPort(str(header.get("port", ""))), robot, options=options)
        self._core.state.model_tells = False  # the recorded driver has looked
        self._connection.clock = lambda: self._now
        self._connection.closing = True
        self._connection.refusal = f"nothing is sent to the robot of a recording ({self.recording.path})"
        self.gaps: List[Gap] = []
        self.breaks_off = header.get("marks_end") is True and not self.recording.grows
        self._session_known = opening.has_session
        self._played = self._quiet = False
        self._serving = not opening.has_session
        """The bytes of the board go to the driver; not those of the time in which the port was opened."""
        self._requests, self._replies = FrameReader(REQUESTS_TO_ANY), FrameReader(REPLIES)
        self._missing = _MissingGreeting()
        for frame in opening.frames:
            self._missing.heard(frame, -math.inf)
        if opening.is_cut and self._missing.robot_id is None and self.model is not None:
            self._missing.assume(self.model)
        self._missing.end(greeted=False)
        self._failures = 0
        self._on_sent: List[Callable[[Sent], None]] = []
        self._on_heard: List[Callable[[Heard], None]] = []
        self._on_remark: List[Callable[[Remark], None]] = []

    # -- for users

    @property
    def clock_ahead_s(self) -> float:
        """Time by which the wall clock was ahead of `now_s` [s]."""
        return self._clock_ahead_s

    @property
    def ready(self) -> bool:
        """As for `Driver`, of the recorded one: telemetry is not stale, and the driver has not ended."""
        return self._core.begun and self._core.session.ready and not self._quiet

    def on_sent(self, callback: Callable[[Sent], None]) -> None:
        """Call `callback` for each frame, or garbage, that the host sent."""
        self._on_sent.append(require_function("callback", callback))

    def on_heard(self, callback: Callable[[Heard], None]) -> None:
        """Call `callback` for each frame, or garbage, that the board sent, before the events that follow from it."""
        self._on_heard.append(require_function("callback", callback))

    def on_remark(self, callback: Callable[[Remark], None]) -> None:
        """Call `callback` for each remark."""
        self._on_remark.append(require_function("callback", callback))

    def play(self, advance: Callable[[float], None] = lambda share: None) -> None:
        """Play the whole recording.

        `advance` is called with the share of the work done since its last call; the shares add up to 1.0.

        Raises:
            ConfigError: the recording holds nothing, or no model lists its robot.
            MrlError: it was played before.
        """
        require_function("advance", advance)
        if self._played:
            raise MrlError(
                "this recording was played already; create another RecordedDriver to play it again"
            )
        self._played = True
        size, done, seen, number = max(1, os.path.getsize(self.recording.path)), 0.0, 0, 0
        for number, entry in enumerate(_clock_first(self.recording), 1):
            self._take(entry)
            seen += len(entry.data) + LINE_BYTES
            if number % _REPORT_EVERY == 0:
                share = min(1.0, seen / size)
                advance(share - done)
                done = share
        advance(1.0 - done)
        self._require_content(number)

    def connect(self) -> NoReturn:
        """Raise MrlError: a recording is played."""
        raise MrlError("a recording cannot be connected; call play()")

    def __enter__(self) -> "RecordedDriver":
        return self

    def _require_content(self, entries: int) -> None:
        path, robot_id = self.recording.path, self._missing.robot_id
        if not entries:
            raise ConfigError(f"{path} holds nothing, expected lines of a recording")
        if self.model is None and robot_id is not None and not models.by_id(robot_id):
            raise ConfigError(
                f"{path}: no packaged model lists robot id {robot_id}; give its file with --robot"
            )

    # -- entries

    def _take(self, entry: Entry) -> None:
        self.time_s, direction, data = entry
        self._now = now = (self._start_us + round(self.time_s * 1e6)) / 1e6
        if direction == REMARK:
            self._take_remark(data, now)
            return
        if not self._session_known:
            if not self._core.begun:
                self._begin(now)
            self._make_turns(now)
        if direction == FROM_BOARD:
            self._take_read(data, now)
        else:
            self._take_sent(data, now)

    def _begin(self, now: float) -> None:
        """Begin with a session whose beginning is not in the file, or not known exactly."""
        self._core.begin(now)
        self._core.session.relink(now, same=False)
        self._serving = True

    def _make_turns(self, until_s: float) -> None:
        """Do what was due before this time, which a damaged file may lack."""
        core, now = self._core, -math.inf
        for _ in range(_MOST_TURNS):
            now = max(core.deadline(until_s), now + 1e-3)
            if now >= until_s:
                return
            self._tell(self._turn(b"", now))

    def _turn(self, data: bytes, now: float) -> Sequence[DriverEvent]:
        core = self._core
        try:
            events: Sequence[DriverEvent] = core.turn(data, now)
            self._failures = 0
        except MrlError:  # a remark says what became of it
            events, self._failures = (), self._failures + 1
            if not self._session_known or self._failures > _MOST_FAILURES:
                core.session.relink(now, same=False)
        core.session.out.clear()
        return events

    def _tell(self, events: Sequence[Any]) -> None:
        if not self._quiet:
            self._connection.report(events)

    def _take_read(self, data: bytes, now: float) -> None:
        core = self._core
        before, greets = core.begun and core.session.checked, not core.begun or not core.session.ready
        events = self._turn(data, now) if core.begun and self._serving else ()
        checked = core.begun and core.session.checked
        ready = core.begun and self._serving and core.session.ready
        if data and (self._on_heard or not ready):
            for event, raw in self._replies.read(data, before, checked != before or greets):
                for listener in self._on_heard:
                    listener(Heard(self.time_s, event, raw))
                if isinstance(event, Frame) and not ready:
                    self._missing.heard(event, now)
        if ready:
            self._missing.end()
        elif data:
            events = [*events, *self._go_on(now)]
        self._tell(events)

    def _go_on(self, now: float) -> Sequence[DriverEvent]:
        """Go on without a greeting if the board streams and the greeting is not in the file."""
        core = self._core
        board = self._missing.board(now, self._session_known)
        if board is None:
            return ()
        if not core.begun or not self._serving:
            self._begin(now)
        return self._join(board, self._missing.stream_code, core.session.checked, now)

    def _join(
        self, board: Board, stream_code: int, checked: bool, now: float, last: Optional[Frame] = None
    ) -> Sequence[DriverEvent]:
        self._missing.end()
        try:
            return self._core.join(board, stream_code, checked, now, last)
        except MrlError:  # no model lists the board
            self._core.session.relink(now, same=False)
            return ()

    def _take_sent(self, data: bytes, now: float) -> None:
        core = self._core
        checked = core.begun and core.session.checked
        if core.begun:
            core.session.counters.bytes_out += len(data)
        for event, raw in self._requests.read(data, checked, True):
            for listener in self._on_sent:
                listener(Sent(self.time_s, event, raw))
            if isinstance(event, Frame) and core.begun:
                self._missing.sent(event, core.session.ready)
                if core.session.ready:
                    self._follow(event, now)

    def _follow(self, frame: Frame, now: float) -> None:
        """Put the command that the host sent in force."""
        model, motion = self.model, self._core.session.motion
        speeds: Tuple[int, ...] = frame.args
        if frame.code == STOP_CODE:
            if motion.target is not None:
                motion.stop()
                motion.take(now)
            return
        commands = commands_of(model.drive) if model is not None else None
        if commands is not None and frame.code == commands.code:
            speeds = tuple(round(1000 * speed) for speed in commands.read(frame.args))
        elif frame.code != MOVE:
            return
        elif commands is not None:
            speeds = (*speeds, 0)  # the recording is that of a base that does not move sideways
        self._core.mismatch = None
        if speeds != motion.target:
            motion.drive(speeds, now)
            motion.take(now)

    # -- remarks

    def _take_remark(self, data: bytes, now: float) -> None:
        word, space, rest = data.partition(b" ")
        if word + space in _OWN_REMARKS:
            getattr(self, "_on_" + word.decode())(rest, now)
        for listener in self._on_remark:
            listener(Remark(self.time_s, data.decode("utf-8", "replace")))

    def _on_opened(self, _: bytes, now: float) -> None:
        if self._session_known:
            self._serving = False
        elif not self._core.begun:
            self._begin(now)
        else:
            self._core.session.relink(now, same=True)

    def _on_session(self, data: bytes, now: float) -> None:
        core, (kind, _, rest) = self._core, data.partition(b" ")
        self._session_known = self._serving = True
        self._failures = 0
        if not core.begun:
            core.begin(now)
            if kind != b"new":
                core.session.relink(now, same=False)
        if kind == b"again":
            core.session.relink(now, rest == b"same")
        joined = session_of(rest.decode("utf-8", "replace")) if kind == b"joined" else None
        if joined is not None:
            board, stream_code, checked, stamp_s, last, bias = joined
            if last is None or abs(now - stamp_s) > _OLDEST_STAMP_S:
                stamp_s, last = now, None
            self._tell(self._join(board, stream_code, checked, stamp_s, last))
            if bias is not None and core.state.tracker is not None:
                core.state.tracker.heading.resume(bias)

    def _on_pose(self, data: bytes, _: float) -> None:
        found, odometry = pose_of(data), self._core.state.odometry
        if found is not None and odometry is not None:
            odometry.set_pose(*found)

    def _on_stop(self, data: bytes, now: float) -> None:
        core, (reason, _, detail) = self._core, data.partition(b" ")
        if not core.begun:
            return
        motion, why = core.session.motion, StopReason(reason.decode("utf-8", "replace"))
        if motion.target is not None:
            motion.stop(why)
            motion.take(now)
        motion.stop_reason = why
        facts = _facts(detail, wheel=str, cause=str, expected_m=float, moved_m=float)
        core.mismatch = Mismatch(**facts) if facts else None
        if core.mismatch is not None:
            self._tell([core.mismatch])

    def _on_clock(self, data: bytes, _: float) -> None:
        for number in numbers_of(data)[:1]:
            self._clock_ahead_s = number

    def _on_lost(self, data: bytes, now: float) -> None:
        if self._core.begun:
            self._core.session.lose(now)
        facts = _facts(data, port=str, reason=str, may_move=bool, reported=bool)
        if facts and facts.pop("reported"):
            self._tell([Lost(**facts)])

    def _on_reconnected(self, data: bytes, _: float) -> None:
        if self._core.begun:
            self._core.session.counters.reconnects += 1
        self._tell([Reconnected(data.decode("utf-8", "replace"))])

    def _on_slowed(self, data: bytes, _: float) -> None:
        if data.isdigit() and len(data) < 10:
            self._tell([Slowed(int(data))])

    def _on_file_lacks(self, data: bytes, _: float) -> None:
        gap = gap_of(data, self.time_s)
        if gap is not None:
            self.gaps.append(gap)

    def _on_file_ends(self, _: bytes, __: float) -> None:
        self.breaks_off = False

    def _on_ended(self, data: bytes, now: float) -> None:
        """Report the error that ended the driver; nothing is reported after it."""
        name, _, words = data.decode("utf-8", "replace").partition(": ")
        if data != CLOSED:
            self._quiet, kind = False, getattr(errors, name, MrlError)
            is_error = isinstance(kind, type) and issubclass(kind, MrlError)
            self._tell([kind(words) if is_error else MrlError(words)])
        self._quiet = True


class _MissingGreeting:
    """Notices that the board streams although its greeting is not in the recording, or only a part of it.

    Attributes:
        stream_code: code of the stream's frames.
        robot_id: id of the board that answered last; None before it is known.
    """

    def __init__(self) -> None:
        self.stream_code = 0
        self.robot_id: Optional[int] = None
        self._info: Optional[Board] = None
        self._protocol: Optional[Tuple[int, ...]] = None
        self._capabilities = {"check", "watchdog"}
        self._info_s = self._last_s = self._since_s = -math.inf
        self._frames, self._greeted, self._moves = 0, False, 0

    def assume(self, model: RobotModel) -> None:
        """Take the board for one of this model with new firmware, until it says what it is.

        Without readings of an IMU it has no capabilities, as a board that does not report them.
        """
        self._info = Board(model.ids[0], 2, math.nan, math.nan, math.nan)

    def end(self, greeted: bool = True) -> None:
        """Begin again, because the session is ready."""
        self._frames, self._greeted, self._moves, self._last_s = 0, greeted, 0, -math.inf

    def sent(self, frame: Frame, ready: bool) -> None:
        """Process a request of the host; `ready` says whether the session is."""
        self._greeted = self._greeted or frame.code in _GREETING
        self._moves += not ready and frame.code in (MOVE, MOVE_OMNI, MOVE_TWIST)

    def heard(self, frame: Frame, now: float) -> None:
        """Process a reply of the board while the session is not ready."""
        if frame.code == _INFO:
            self._info = board_of(frame.args)
            if self._info_s == -math.inf:
                self._info_s = now
            self.robot_id = self._info.robot_id
        elif frame.code == _PROTOCOL:
            self._protocol = frame.args
        elif frame.code == _IMU:
            self._capabilities.add("imu")
        elif frame.code in STREAMS:
            if not now - self._last_s <= _SILENCE_S:
                self._frames, self._since_s = 0, now
            self._frames, self._last_s, self.stream_code = self._frames + 1, now, frame.code
            if len(frame.args) > 3:
                self._capabilities.add("sonars")

    def board(self, now: float, session_known: bool) -> Optional[Board]:
        """Return the board, if its greeting is missing; None otherwise, or while it is not known."""
        info = self._info
        if info is None or self._frames < _LEAST_FRAMES:
            return None
        patience_s = _LONG_GREETING_S if session_known else _GREETING_S if self._greeted else 0.0
        if self._moves < _LEAST_MOVES and now - self._since_s < patience_s:
            return None
        if info.version < 2:
            return info
        if self._protocol is not None:
            protocol, bits = self._protocol
            return info._replace(protocol=protocol, capabilities=capabilities_of(bits))
        if now - self._info_s < _PROTOCOL_S:
            return None
        silent = self.robot_id is None and "imu" not in self._capabilities
        return info._replace(
            protocol=2, capabilities=frozenset() if silent else frozenset(self._capabilities)
        )


def _opening(recording: Recording) -> _Opening:
    """Read the first entries; the model comes when the board has answered, the clock when there is a node."""
    model, ahead_s, has_session, is_cut = None, None, False, False
    frames: List[Frame] = []
    reader = FrameReader(REPLIES)
    for number, (_, direction, data) in enumerate(recording):
        if number >= _OPENING_ENTRIES or (model is not None and ahead_s is not None):
            break
        is_cut = is_cut or (number == 0 and not data.startswith(OPENED))
        if is_cut and direction == FROM_BOARD:
            frames += [event for event, _ in reader.read(data, None, True) if isinstance(event, Frame)]
        if direction != REMARK:
            continue
        has_session = has_session or data.startswith(SESSION)
        if data.startswith(MODEL) and model is None:
            model = model_of(data[len(MODEL) :].decode("utf-8", "replace"))
        if data.startswith(CLOCK) and ahead_s is None:
            ahead_s = next(iter(numbers_of(data[len(CLOCK) :])), None)
    return _Opening(model, ahead_s, has_session, is_cut, frames)


def _clock_first(entries: Iterable[Entry]) -> Iterator[Entry]:
    """The entries; a remark on the clock comes before the bytes of the same time, whose listeners used it first."""
    group: List[Entry] = []  # bytes of the board, and the remarks of the same time that follow them
    for entry in entries:
        if group and not (entry.direction == REMARK and entry.time_s == group[0].time_s):
            yield from sorted(group, key=_after_clock) if len(group) > 1 else group
            group.clear()
        if group or entry.direction == FROM_BOARD:
            group.append(entry)
        else:
            yield entry
    yield from sorted(group, key=_after_clock)


def _after_clock(entry: Entry) -> bool:
    return not (entry.direction == REMARK and entry.data.startswith(CLOCK))


def _options(header: Dict[str, Any]) -> Options:
    """The options of the recorded driver that change what its listeners get; the defaults if they are damaged.

    A command stays in force until the recording says otherwise, and a board is never refused for its battery.
    """
    found = header.get("options")
    given = {name: found[name] for name in HEARD if name in found} if isinstance(found, dict) else {}
    options = DEFAULTS._replace(**given)
    try:
        options = require_options(options)
    except ConfigError:
        options = DEFAULTS
    return options._replace(command_timeout_s=None, queued_s=0.0, ignore_battery=True)


def _facts(data: bytes, **kinds: type) -> Dict[str, Any]:
    """The fields of a JSON object that have these types; empty if one is missing or has another."""
    try:
        found = json.loads(data or b"null")
    except (ValueError, RecursionError):
        return {}
    if not isinstance(found, dict) or not all(type(found.get(name)) is kind for name, kind in kinds.items()):
        return {}
    return {name: found[name] for name in kinds}
