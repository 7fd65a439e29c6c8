"""Opens the links of one driver, one after the other: the first one, and those of the search for a lost port.

A recording goes on over all of them.  With the option `fast` each line is raised to 500000 baud.
"""

import time
from typing import Callable, Optional, Sequence, Tuple, Union

from mrl_driver.errors import BoardTimeout, ConfigError, LinkLost, MrlError, NotARobot
from mrl_driver.lock_order import new_lock
from mrl_driver.recording.recorded_link import DriverRecording
from mrl_driver.recording.recording import Recorder
from mrl_driver.robot.robot_state import RobotState
from mrl_driver.session.events import Awaited, Lost, Reconnected
from mrl_driver.session.session import Session
from mrl_driver.transport.address import is_url
from mrl_driver.transport.link import Link, busy
from mrl_driver.transport.open_link import AGAIN_S, BACK_S, CONNECT_S, Opening, open_link, speed_up
from mrl_driver.transport.port_info import opened_by
from mrl_driver.transport.reconnect import LOOK_S, Reconnection

from .options import HEARD, Options

# A link at 500000 baud goes back to 115200 after more than `ERRORS` damages plus one per `ERROR_SHARE` frames.  The
# count starts again after `COUNTED_FRAMES` frames, a minute of driving, so that hours without damage do not hide it.
ERRORS, ERROR_SHARE, COUNTED_FRAMES = 20, 100, 3000


class LinkSource:
    """The links of one driver.  `close`, `start_recording` and `stop_recording` may be called from any thread; all else
    only from the thread that reads.

    Attributes:
        recording: the recording; None without one, and without the option `tap`.
        reconnection: the search of a lost port; None without the option `reconnect`, and before `first`.
        fast: the line runs at 500000 baud.
        searching: the port is lost, or a robot on a new port is not yet known to be the one that was lost.
    """

    def __init__(self, port: Union[str, Link], baud: int, options: Options) -> None:
        self._port, self._baud, self._options = port, baud, options
        self.recording: Optional[DriverRecording] = None
        self._record = options.record  # the file that is recorded as soon as the port is open; then None
        self.fast = self.searching = False
        self.reconnection: Optional[Reconnection] = None
        self._well_s = 0.0
        self._begun: Optional[Tuple[int, int]] = None  # frames and damages when the count of damages started
        self._lock = new_lock("links")
        self._creating = ""  # path of a recording that is being created
        self._trial: Optional[Link] = None
        self._closed = False

    def first(self, report: Callable[[Sequence[object]], None]) -> Link:
        """Open the driver's port; `report` gets an `Awaited` for each new reason to wait for it.

        Raises:
            ConfigError: the recording cannot be written.
            LinkError: the port cannot be opened, or the driver was closed meanwhile.
        """
        port = self._port
        if not isinstance(port, str):
            return port
        if self._record is not None or self._options.tap is not None:
            self.recording = self._new_recording(port)
        try:
            link = self._await(port, report)
        except BaseException:
            self.end_recording()
            raise
        if self._options.reconnect:
            self.reconnection = Reconnection(port, self._open, self._options.greeting_s)
        return link

    def _await(self, port: str, report: Callable[[Sequence[object]], None]) -> Link:
        """Open the port as soon as that is possible, within the time of the options."""
        opening, told = Opening(lambda: self._open(port, CONNECT_S), self._options.port_timeout_s), ""
        while True:
            link = opening.attempt()
            if link is not None:
                return link
            if opening.reason != told:
                told = opening.reason
                report([Awaited(port, told)])
            time.sleep(LOOK_S)
            if self._closed:
                raise LinkLost("the driver was closed")

    def _open(self, name: str, patience_s: float = AGAIN_S) -> Link:
        link = open_link(name, self._baud, patience_s)
        try:
            if self.recording is not None:
                if self._record is not None:  # not before: without the port, an older file stays as it was
                    self.recording.use(self.recording.create(self._record))
                    self._record = None
                link = self.recording.begin(link)
            self.fast = self._options.fast and self._speed_up(link)
        except BaseException:
            link.close()
            raise
        self._well_s, self._begun = time.monotonic(), None
        return link

    def _speed_up(self, link: Link) -> bool:
        """Call `speed_up`.  It takes seconds if nothing answers, so `close` may interrupt it."""
        with self._lock:
            if self._closed:
                raise LinkLost("the driver was closed")
            self._trial = link
        try:
            return speed_up(link)
        finally:
            self._trial = None

    def close(self) -> None:
        """Open no further link; one whose speed is being raised is closed."""
        with self._lock:
            self._closed, trial = True, self._trial
        if trial is not None:
            trial.close()

    def start_recording(self, path: str) -> None:
        """Start a recording; it begins with the next link, or with `exchange`.

        Raises:
            ConfigError: one is running, the file cannot be created, or the link was given open.
        """
        with self._lock:
            if not isinstance(self._port, str):
                raise ConfigError("a recording of an open link is requested, expected a port by name")
            recording = self.recording or self._new_recording(self._port)
            busy = self._creating or (recording.recorder.path if recording.recorder is not None else "")
            if busy:
                raise ConfigError(f"{busy} is being recorded; stop that recording first")
            self._creating = path
        try:
            recorder = recording.create(path)  # a slow disk must not hold up the thread that reads
        except BaseException:
            self._creating = ""
            raise
        with self._lock:
            self._creating = ""
            if self._closed:
                recorder.close()
                raise LinkLost("the driver was closed")
            recording = self.recording or recording
            recording.use(recorder)
            self.recording = recording

    def record_stepped(self, link: Link, path: str, clock: Callable[[], float]) -> Link:
        """Record a board in simulated time from its start; return the link to go on with.

        Raises:
            ConfigError: the file cannot be created.
        """
        self.recording = self._new_recording(link.port, clock)
        self.recording.use(self.recording.create(path))
        link = self.recording.begin(link)
        self.recording.new(clock())
        return link

    def _new_recording(self, port: str, clock: Optional[Callable[[], float]] = None) -> DriverRecording:
        heard = {name: getattr(self._options, name) for name in HEARD}
        return DriverRecording(port, self._baud, self._options.tap, heard, clock)

    def stop_recording(self) -> Recorder:
        """Stop the recording; return its recorder, which the caller closes.  Raise ConfigError if none is running."""
        with self._lock:
            recorder = self.recording.stop() if self.recording is not None else None
        if recorder is None:
            raise ConfigError("no recording is running, expected one that was started")
        return recorder

    def exchange(self, link: Link, session: Session, state: RobotState) -> Link:
        """Return the link to go on with, after a recording was started or stopped."""
        with self._lock:
            recording = self.recording
            if recording is None:
                return link
            link = recording.exchange(link, session, state)
            if recording.recorder is not None:
                session.identify()
            elif recording.idle:
                self.recording = None
            return link

    def end_recording(self) -> None:
        """Finish the recording."""
        if self.recording is not None:
            self.recording.close()

    def lose(self, error: MrlError, now: float, may_be_moving: bool) -> Optional[Lost]:
        """The link is gone: start the search, or go on with it; return the event if the search has just begun."""
        reconnection = self.reconnection
        assert reconnection is not None
        first, self.searching = reconnection.lose(error, now), True
        return Lost(reconnection.port, str(error), may_be_moving) if first else None

    def judge(self, session: Session, now: float) -> Optional[Reconnected]:
        """Check in a search that the robot that answers is the one that was lost; return the event if it is found.

        Raises:
            WrongRobot: another robot answers, or others must be tried first.
            BoardTimeout: no answer in time.
        """
        assert self.reconnection is not None
        if not self.reconnection.judge(session.ready, now):
            return None
        self.searching = False
        session.counters.reconnects += 1
        return Reconnected(self.reconnection.port)

    def explained(self, error: MrlError) -> MrlError:
        """Return why the driver ends: another program that has the port open takes what the board answers."""
        if not isinstance(error, (NotARobot, BoardTimeout, LinkLost)) or not isinstance(self._port, str):
            return error
        port = self.reconnection.port if self.reconnection is not None else self._port
        holder = "" if is_url(port) else opened_by(port)
        return busy(port, holder, f", which takes what the board answers ({error})") if holder else error

    def is_failing(self, session: Session, now: float) -> bool:
        """Return whether the link fails at the higher speed."""
        frames, errors = session.counters.frames, sum(session.counters.garbage.values())
        if self._begun is None or frames - self._begun[0] >= COUNTED_FRAMES:
            self._begun = frames, errors
        if session.ready:
            self._well_s = now
        most = (frames - self._begun[0]) // ERROR_SHARE + ERRORS
        return now - self._well_s > BACK_S or errors - self._begun[1] > most

    def abandon(self) -> None:
        """In a forked child: forget the links and the recording, which stay with the parent."""
        self._lock = new_lock("links")
        self._trial = self.reconnection = self.recording = None
        self._closed = True
