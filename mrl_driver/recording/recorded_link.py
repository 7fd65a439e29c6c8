"""Links that pass every byte to a recorder, or to any other function, while the robot drives."""

from typing import Any, Callable, Mapping, Optional, Sequence, TypeVar

from mrl_driver.geometry import Pose
from mrl_driver.json_text import exact_json
from mrl_driver.robot.covariance import AT_START, Spread
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.robot_state import RobotState
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.session.events import Lost
from mrl_driver.session.session import Session
from mrl_driver.transport.link import Link

from . import recording
from .recorded_facts import model_text, session_text
from .recording import FROM_BOARD, REMARK, TO_BOARD, Recorder, now_s

Tap = Callable[[str, bytes], None]
"""Called with each chunk of bytes: its direction (`>` to the board, `<` from it), and the bytes."""


class RecordedLink:
    """A link that passes each chunk to `tap`: before it is written, or after it was read."""

    def __init__(self, link: Link, tap: Tap) -> None:
        self.port, self.link, self._tap = link.port, link, tap

    def read(self, timeout_s: float) -> bytes:
        data = self.link.read(timeout_s)
        if data:
            self._tap(FROM_BOARD, data)
        return data

    def write(self, data: bytes) -> None:
        self._tap(TO_BOARD, data)
        self.link.write(data)

    def wake(self) -> None:
        self.link.wake()

    def close(self) -> None:
        self.link.close()

    def fileno(self) -> int:
        return self.link.fileno()

    def set_baud(self, baud: int) -> None:
        self.link.set_baud(baud)


AnyLink = TypeVar("AnyLink", Link, Optional[Link])


def inner(link: AnyLink) -> AnyLink:
    """Return the link without its recording."""
    return link.link if isinstance(link, RecordedLink) else link


class DriverRecording:
    """Records all links of one driver, from `use` to `stop`, and calls `tap` with their bytes.

    A link that is in use is exchanged by `exchange` after `due` has been set.  The links may be used by any thread; all
    else is called by one thread at a time.  Times are those of the driver's clock [s].
    """

    due: bool  # a recording was started or stopped, and the link in use is still the one before
    _serving: bool
    """The driver itself records the bytes that it has read, with the time that it uses."""

    def __init__(
        self,
        port: str,
        baud: int,
        tap: Optional[Tap],
        options: Mapping[str, Any],
        clock: Optional[Callable[[], float]],
    ) -> None:
        """`options` are those of the driver that change what its listeners get; `clock` is simulated time, if any."""
        self._facts = {"port": port, "baud": baud, "options": dict(options)}
        self._tap, self._simulated, self._now = tap, clock, clock or now_s
        self.recorder: Optional[Recorder] = None  # the file that is written; None without one
        self._written: Optional[Recorder] = None
        """The recorder after its first remarks: what is read and written goes there."""
        self._turn_s: Optional[float] = None  # time of the driver's last turn; None before the first
        self._checked: Optional[bool] = None
        self._model: Optional[RobotModel] = None
        self._stops = 0

    def create(self, path: str) -> Recorder:
        """Create a file for `use`, on any thread; raise ConfigError if that is not possible."""
        return Recorder(path, self._simulated, **self._facts)

    def use(self, recorder: Recorder) -> None:
        """Record into a file; bytes follow from the next `begin` or `exchange`."""
        self.recorder, self.due = recorder, True

    def stop(self) -> Optional[Recorder]:
        """Record no more; return the recorder, which the caller closes, or None."""
        recorder, self.recorder, self._written = self.recorder, None, None
        self.due = True
        return recorder

    def begin(self, link: Link) -> Link:
        """Begin with a link, before the driver greets its board; return the link to go on with."""
        self._begin(link.port)
        return self._tapped(link)

    def exchange(self, link: Link, session: Session, state: RobotState) -> Link:
        """Begin, or end, a recording with a link that is in use; return the link to go on with."""
        link = inner(link)
        self._begin(link.port)
        self._serving, self._turn_s = True, self._now()
        if self._written is not None:
            self._join(session, state)
        return self._tapped(link)

    def _join(self, session: Session, state: RobotState) -> None:
        """Record what a reader must know about the conversation so far, and the frame that has begun."""
        self._stops, odometry = session.motion.stops, state.odometry
        self._compare(session, state, ())
        if session.ready and state.info is not None:
            stamp_s = state.telemetry.stamp_s if state.telemetry is not None else session.heard_s
            bias = state.tracker.heading.known_bias if state.tracker is not None else None
            text = session_text(session, state.info, stamp_s, bias)
            self.remark(recording.SESSION + b"joined " + text.encode(), self._turn_s)
        else:
            self.again(self._turn_s, same=False)
        if odometry is not None:
            self.pose(odometry.pose, odometry.uncertainty.spread if odometry.uncertainty else AT_START)
        if session.pending:
            self._record(FROM_BOARD, session.pending, self._turn_s)

    def _begin(self, port: str) -> None:
        self.due, self._checked, self._model, self._written = False, None, None, self.recorder
        self._serving = False
        self.remark(recording.OPENED + port.encode(errors="replace"))

    def _tapped(self, link: Link) -> Link:
        return link if self.idle else RecordedLink(link, self._add)

    @property
    def idle(self) -> bool:
        """There is nothing to do with the bytes of a link."""
        return self.recorder is None and self._tap is None

    def _add(self, direction: str, data: bytes) -> None:
        recorder = self._written
        if recorder is not None and not (self._serving and direction == FROM_BOARD):
            recorder.add(direction, data)
        if self._tap is not None:
            self._tap(direction, data)

    # -- what the driver does, with its times

    def new(self, now: float) -> None:
        """The driver begins to greet a board."""
        self._serving, self._turn_s = True, now
        self.remark(recording.SESSION + b"new", now)

    def again(self, now: Optional[float], same: bool) -> None:
        """The driver begins to greet a board again, on another link; `same` as for `Session.relink`."""
        self._serving = True
        self.remark(recording.SESSION + (b"again same" if same else b"again other"), now)

    def heard(self, data: bytes, now: float) -> None:
        """The driver takes these bytes; call it before its turn."""
        self._turn_s = now
        if data:
            self._record(FROM_BOARD, data, now)

    def turned(self, data: bytes, events: Sequence[Any], session: Session, state: RobotState) -> None:
        """The driver has taken the bytes, and its listeners get these events."""
        if not data and (events or (session.out and not session.ready)):
            self._record(FROM_BOARD, data, self._turn_s)
        self._compare(session, state, events)

    def _compare(self, session: Session, state: RobotState, events: Sequence[Any]) -> None:
        """Record what has changed: checksums, the model, the command in force."""
        if session.checked != self._checked:
            self._checked = session.checked
            self.remark(recording.CHECKED if session.checked else recording.PLAIN, self._turn_s)
        if state.model is not None and self._model is None:
            self._model = state.model
            self.remark(recording.MODEL + model_text(state.model).encode(), self._turn_s)
        found = [" " + exact_json(event._asdict()) for event in events if isinstance(event, Mismatch)]
        if session.motion.stops != self._stops or found:
            self._stops = session.motion.stops
            text = session.motion.stop_reason + "".join(found[:1])
            self.remark(recording.STOP + text.encode(), self._turn_s)

    def pose(self, pose: Pose, spread: Spread) -> None:
        """The odometry continues from this pose, after the bytes of the last turn."""
        self.remark(
            recording.POSE + " ".join(repr(float(each)) for each in (*pose, *spread)).encode(), self._turn_s
        )

    def clock(self, ahead_s: float) -> None:
        """The wall clock is ahead of the driver's by this time [s], from the bytes of the last turn on."""
        self.remark(recording.CLOCK + repr(float(ahead_s)).encode(), self._turn_s)

    def lost(self, event: Lost, reported: bool, now: float) -> None:
        """The port is lost; `reported` says that listeners get the event."""
        self.remark(recording.LOST + exact_json({**event._asdict(), "reported": reported}).encode(), now)

    def remark(self, data: bytes, now: Optional[float] = None) -> None:
        """Record a remark."""
        self._record(REMARK, data, now)

    def _record(self, direction: str, data: bytes, now: Optional[float]) -> None:
        recorder = self._written
        if recorder is not None:
            recorder.add(direction, data, now)

    def close(self) -> None:
        """Write all pending entries, and close the file."""
        if self.recorder is not None:
            self.recorder.close()
