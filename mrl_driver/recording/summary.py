"""Summary of a recording: frames, damage, losses and the robot's path.  Memory does not grow with the file."""

import math
from collections import Counter
from typing import Any, Callable, Dict, FrozenSet, List, Optional, Tuple

from mrl_driver.geometry import ORIGIN
from mrl_driver.protocol import Event, Frame
from mrl_driver.protocol.table import BY_CODE, BY_NAME, SENSOR_BY_NAME
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
from mrl_driver.session.sensor_polling import SENSOR_STREAM, reading, streamed
from mrl_driver.session.sequence import Stream
from mrl_driver.session.session import STALE_S

from .decoded import LINE_BYTES, decode
from .recorded_facts import model_of, pose_of, session_of
from .recording import CHECKED, FROM_BOARD, MODEL, OPENED, PLAIN, POSE, REMARK, SESSION, TO_BOARD, Recording

_JOINED = SESSION + b"joined "
_INFO, _PROTOCOL = BY_NAME["robot_info"].code, BY_NAME["read_protocol"].code
_OMNI, _IMU = BY_NAME[STREAM].code, BY_NAME["read_imu"].code
_SENSING = BY_NAME[SENSOR_STREAM].code
_COUNTS = {
    code
    for code, row in BY_CODE.items()
    if row.stamped and [field.name for field in row.reply[:2]] == ["right", "left"] and code != _OMNI
}


def summarise(
    recording: Recording,
    model: Optional[RobotModel] = None,
    advance: Callable[[float], None] = lambda read_bytes: None,
) -> Dict[str, Any]:
    """Figures of a whole recording, ready for JSON; with the unit at the end of each key.

    Without `model`, the packaged model that lists the board's id is used; if there is none, or its board has no motors,
    pose and `refused_counts` are None.  Garbage is counted by the name of its reason, `lost` and `duplicates` by
    sequence number.  Each sensor has its smallest and its largest value, in `unit`.  `imu` is the state of the IMU at
    the end, one of `robot.imu.STATES`.  `advance` is called with the number of bytes read since its last call, about.
    """
    reader = _Reader(model, recording.start_us / 1e6)
    for time_s, direction, data, events in decode(recording):
        if direction == REMARK:
            reader.take_remark(data)
        else:
            reader.read(time_s, direction, len(data), events)
            advance(len(data) + LINE_BYTES)
    return {
        "file": recording.path,
        "started": recording.header.get("started"),
        "port": recording.header.get("port"),
        **reader.figures(),
        "skipped_lines": recording.skipped_count,
        "skipped": {str(number): reason for number, reason in recording.skipped.items()},
    }


def _named(codes: Dict[int, int]) -> Dict[str, int]:
    return {BY_CODE[code].name: count for code, count in sorted(codes.items())}


class _Reader:
    """Adds up the frames of a recording, and follows its robot: the model, the path, and the frames that were lost.

    `start_s` is the time at which the recording began, on the driver's clock.  Without `model`, `self.model` is that of
    the recording, or the packaged model that lists the first id of the board, or None.
    """

    def __init__(self, model: Optional[RobotModel], start_s: float) -> None:
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
        self.duration_s = 0.0
        self.sizes = Counter({FROM_BOARD: 0, TO_BOARD: 0})
        self.frames: Counter[int] = Counter()
        self.requests: Counter[int] = Counter()
        self.sensors: Dict[str, Dict[str, Any]] = {}
        self.garbage: Counter[str] = Counter()

    def figures(self) -> Dict[str, Any]:
        """Return the figures of the drive."""
        model, odometry = self.model, self.odometry
        moves = model is not None and model.drives
        refused = odometry.baseline.refused if odometry else 0
        return {
            "robot": model.name if model else None,
            "robot_id": self.robot_id,
            "duration_s": self.duration_s,
            "bytes_from_board": self.sizes[FROM_BOARD],
            "bytes_to_board": self.sizes[TO_BOARD],
            "frames": _named(self.frames),
            "requests": _named(self.requests),
            "garbage": dict(sorted(self.garbage.items())),
            "lost": self.counters.lost,
            "duplicates": self.counters.duplicates,
            "refused_counts": refused if moves else None,
            "pose": (odometry.pose if odometry else ORIGIN)._asdict() if moves else None,
            "sensors": self.sensors,
            "imu": imu.state_of(self._tracker, self.capabilities),
        }

    def read(self, time_s: float, direction: str, size: int, events: List[Event]) -> None:
        """Add what was sent in a direction."""
        self.duration_s = time_s
        self.sizes[direction] += size
        for event in events:
            if direction == TO_BOARD:
                if isinstance(event, Frame):
                    self.requests[event.code] += 1
            elif isinstance(event, Frame):
                self.frames[event.code] += 1
                self.take(event, time_s)
                self._sense(event)
            else:
                self.garbage[event.reason] += 1

    def _sense(self, frame: Frame) -> None:
        row = SENSOR_BY_CODE.get(frame.code)
        readings = streamed(frame.args, 0.0) if frame.code == _SENSING else {}
        for name, found in ({row.name: reading(row, frame.args, 0.0)} if row else readings).items():
            unit = SENSOR_BY_NAME[name].fields[0].base_unit
            known = self.sensors.setdefault(name, {"least": math.inf, "most": -math.inf, "unit": unit})
            known["least"] = min(known["least"], *found.values)
            known["most"] = max(known["most"], *found.values)

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

    def take(self, frame: Frame, time_s: float) -> None:
        """Handle a reply."""
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
                return
            self._stream.clock.update(stamp.time, time_s, not missing)
            made_s = self._stream.clock.board_s
        if counts:
            self._move(frame, made_s)

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
