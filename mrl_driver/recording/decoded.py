"""A recording, read once from its start: frames and garbage of both directions, and the robot's path by its counters.

Summaries and calibrations read recordings through this module: faster than `driver.recorded`, and without what
listeners of the driver get.  Memory does not grow with the file.
"""

import math
from collections import deque
from typing import Deque, Dict, FrozenSet, Iterable, Iterator, List, NamedTuple, Optional, Tuple

from mrl_driver.geometry import ORIGIN
from mrl_driver.protocol import REPLIES, REQUESTS_TO_ANY, Event, Frame, FrameDecoder
from mrl_driver.protocol.table import BY_CODE, BY_NAME
from mrl_driver.robot import imu, models
from mrl_driver.robot.imu import ImuTracker
from mrl_driver.robot.models import OmniDrive, RobotModel
from mrl_driver.robot.odometry import Odometry
from mrl_driver.robot.omni_odometry import STREAM, OmniOdometry
from mrl_driver.robot.robot_state import odometry_of
from mrl_driver.session.events import imu_reading
from mrl_driver.session.handshake import capabilities_of
from mrl_driver.session.link_counters import Counters
from mrl_driver.session.sensor_polling import BY_CODE as SENSOR_BY_CODE
from mrl_driver.session.sensor_polling import SENSOR_STREAM, Reading, reading, streamed
from mrl_driver.session.sequence import Stream
from mrl_driver.session.session import STALE_S

from .recorded_facts import model_of, pose_of, session_of
from .recording import (
    CHECKED,
    FROM_BOARD,
    MODEL,
    OPENED,
    PLAIN,
    POSE,
    REMARK,
    SESSION,
    TO_BOARD,
    Entry,
    Recording,
)

LINE_BYTES = 12  # a line of the file takes about this many bytes besides its data
HELD_BYTES = 8192
"""An entry waits until this many bytes of the file follow it: the driver remarks that checksums begin or end only
after it has read the first such frames.
"""
_TAIL_BYTES = 4096
"""The first such frame is at most this far from the end of the board's bytes before the remark."""
_JOINED = SESSION + b"joined "
_INFO, _PROTOCOL = BY_NAME["robot_info"].code, BY_NAME["read_protocol"].code
_OMNI, _IMU = BY_NAME[STREAM].code, BY_NAME["read_imu"].code
_SENSING = BY_NAME[SENSOR_STREAM].code
_COUNTS = {
    code
    for code, row in BY_CODE.items()
    if row.stamped and [field.name for field in row.reply[:2]] == ["right", "left"] and code != _OMNI
}


class DecodedPart(NamedTuple):
    """An entry, or a piece of one, and the frames and garbage that it completes; a remark has none."""

    time_s: float
    direction: str
    data: bytes
    events: List[Event]


def decode(recording: Recording) -> Iterator[DecodedPart]:
    """Decode a whole recording; a remark on checksums comes before the first reply that it applies to."""
    decoders, size = _decoders(), 0
    held: Deque[Entry] = deque()
    for entry in recording:
        time_s, direction, data = entry
        if direction != REMARK:
            held.append(entry)
            size += _size(entry)
            while size - _size(held[0]) >= HELD_BYTES:
                size -= _size(held[0])
                yield from _feed([held.popleft()], decoders)
            continue
        if data in (CHECKED, PLAIN):
            yield from _switch(list(held), entry, decoders)
        elif data.startswith(OPENED):
            yield from _feed([*held, entry], decoders)
            decoders = _decoders()
        elif data.startswith((MODEL, POSE, SESSION)):
            held.append(Entry(time_s, direction, data))
            continue
        else:
            continue
        held.clear()
        size = 0
    yield from _feed(held, decoders)


def _size(entry: Entry) -> int:
    """Return the bytes of the file that an entry stands for; a remark does not count."""
    return 0 if entry.direction == REMARK else len(entry.data) + LINE_BYTES


def _decoders() -> Dict[str, FrameDecoder]:
    return {TO_BOARD: FrameDecoder(REQUESTS_TO_ANY), FROM_BOARD: FrameDecoder(REPLIES)}


def _feed(entries: Iterable[Entry], decoders: Dict[str, FrameDecoder]) -> Iterator[DecodedPart]:
    for time_s, direction, data in entries:
        yield DecodedPart(
            time_s, direction, data, decoders[direction].feed(data) if direction != REMARK else []
        )


def _switch(held: List[Entry], remark: Entry, decoders: Dict[str, FrameDecoder]) -> Iterator[DecodedPart]:
    """The entries before a remark on checksums, and the remark between the two groups."""
    checked = remark.data == CHECKED
    before, behind = split(held, checked) if checked != decoders[FROM_BOARD].checked else (held, [])
    yield from _feed([*before, remark], decoders)
    decoders[FROM_BOARD].checked = checked
    yield from _feed(behind, decoders)
    decoders[TO_BOARD].checked = checked


def split(entries: List[Entry], checked: bool) -> Tuple[List[Entry], List[Entry]]:
    """Split the entries at the first reply near their end after which only the rules of `checked` give frames."""
    left = _first_frame(b"".join(data for _, direction, data in entries if direction == FROM_BOARD), checked)
    for i, (time_s, direction, data) in enumerate(entries):
        if direction == FROM_BOARD and len(data) > left:
            pieces = Entry(time_s, direction, data[:left]), Entry(time_s, direction, data[left:])
            return [*entries[:i], pieces[0]], [pieces[1], *entries[i + 1 :]]
        left -= len(data) if direction == FROM_BOARD else 0
    return entries, []


def _first_frame(data: bytes, checked: bool) -> int:
    """Offset of the first frame near the end of `data` after which only the rules of `checked` give frames."""
    found = end = len(data)
    while end > max(0, len(data) - _TAIL_BYTES):
        start = data.rfind(b"e", 0, end - 1) + 1
        frame = b"\r\n" + data[start:end]
        if _is_frame(frame, not checked):
            break
        found = start if _is_frame(frame, checked) else found
        end = start
    return found


def _is_frame(data: bytes, checked: bool) -> bool:
    return any(isinstance(event, Frame) for event in FrameDecoder(REPLIES, checked).feed(data))


def sensors_in(frame: Frame, time_s: float) -> Dict[str, Reading]:
    """Return the readings of sensors in a reply, by name; empty if it has none."""
    if frame.code == _SENSING:
        return streamed(frame.args, time_s)
    row = SENSOR_BY_CODE.get(frame.code)
    return {} if row is None else {row.name: reading(row, frame.args, time_s)}


class RecordedRobot:
    """The robot in a recording: its model, its path, and the frames that were lost.

    `start_s` is the time at which the recording began, on the driver's clock.  Without `model`, `self.model` is that of
    the recording, or the packaged model that lists the first id of the board, or None.
    """

    def __init__(self, model: Optional[RobotModel], start_s: float = 0.0) -> None:
        self.model, self._start_s = model, start_s
        self.robot_id: Optional[int] = None
        self.capabilities: FrozenSet[str] = frozenset()
        self.odometry: Optional[Odometry] = None
        self._pose = ORIGIN  # pose before the first reading of the counters
        self._tracker: Optional[ImuTracker] = None
        self._counted_s = -math.inf
        self.counters = Counters()
        self._stream = Stream(self.counters)
        self._exact = False
        self._last_stamp_s = -math.inf

    @property
    def imu_state(self) -> str:
        """The state of the board's IMU, one of `robot.imu.STATES`."""
        return imu.state_of(self._tracker, self.capabilities)

    def take_remark(self, data: bytes) -> None:
        """Handle a remark: other rules or another port, model (used if there is none yet), pose, session joined."""
        if data in (CHECKED, PLAIN) or data.startswith(OPENED):  # the next reading is only a new baseline
            self._stream.begin_anew()
            for each in (self.odometry, self._tracker):
                if each is not None:
                    each.reset()
        if data.startswith(MODEL):
            self.model = self.model or model_of(data[len(MODEL) :].decode("utf-8", "replace"))
        joined = (
            session_of(data[len(_JOINED) :].decode("utf-8", "replace")) if data.startswith(_JOINED) else None
        )
        if joined is not None:
            self.capabilities = joined.board.capabilities
            if joined.last is not None:  # go on from the last frame before the recording
                self.take(joined.last, joined.stamp_s - self._start_s)
        found = pose_of(data[len(POSE) :]) if data.startswith(POSE) else None
        if found is not None:
            self._pose = found[0]
            if self.odometry is not None:
                self.odometry.set_pose(self._pose)

    def take(self, frame: Frame, time_s: float) -> bool:
        """Handle a reply; return True if it is a reading of the counters, which then has updated `odometry`."""
        code, stamp, made_s = frame.code, frame.stamp, time_s
        codes = {_OMNI} if self.model is not None and isinstance(self.model.drive, OmniDrive) else _COUNTS
        counts = self.model is not None and self.model.drives and code in codes
        if code == _INFO:
            self._on_info(frame)
        elif code == _PROTOCOL:
            self.capabilities = capabilities_of(frame.args[1])
        elif code == _SENSING and not self.capabilities:
            self.capabilities = frozenset({"environment"})
        if stamp is not None:
            silent = time_s - self._last_stamp_s >= STALE_S
            self._last_stamp_s = time_s
            missing = self._stream.missing(stamp[0], silent)
            if code == _IMU and missing >= 0:
                self._on_imu(frame.args, *self._stream.clock.beside(stamp.time, time_s, not missing), time_s)
            if not counts or missing < 0:
                return False
            self._stream.clock.update(stamp.time, time_s, not missing)
            made_s = self._stream.clock.board_s
        if counts:
            self._move(frame, made_s)
        return counts

    def _on_info(self, frame: Frame) -> None:
        robot_id = frame.args[4]
        if self.robot_id is None:
            self.robot_id = robot_id
            name = models.by_id(robot_id)
            self.model = self.model or (models.load(name) if name else None)

    def _on_imu(self, args: Tuple[int, ...], made_s: float, stamp_s: float, time_s: float) -> None:
        """Use a reading of the IMU for the heading, as the driver does."""
        odometry = self.odometry
        if self.model is None or odometry is None:
            return
        if self._tracker is None:
            self._tracker = ImuTracker(self.model)
        odometry.heading = self._tracker.heading if self._exact else None
        reading = imu_reading(args, made_s, stamp_s, time_s)
        self._tracker.update(reading, self._counted_s, odometry)

    def _move(self, frame: Frame, time_s: float) -> None:
        odometry = self._odometry(frame.stamp is not None)
        if self._tracker is not None:
            self._tracker.check(time_s)
        self._counted_s = time_s
        right, left = frame.args[:2]
        if isinstance(odometry, OmniOdometry):
            odometry.update(right, left, time_s, frame.args[2])
        else:
            odometry.update(right, left, time_s)

    def _odometry(self, exact: bool) -> Odometry:
        """Odometry for board time, or for arrival times; another one continues from the pose of the one before."""
        before = self.odometry
        if before is not None and exact == self._exact:
            return before
        assert self.model is not None
        odometry = odometry_of(self.model, exact)
        odometry.uncertainty = None
        odometry.pose = self._pose
        if before is not None:
            odometry.pose, odometry.baseline.refused = before.pose, before.baseline.refused
        self.odometry, self._exact = odometry, exact
        return odometry
