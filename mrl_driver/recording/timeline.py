"""A recording as columns over time, for plots: poses, speeds, ranges, battery."""

import math
import os
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.codec import REPLIES, REQUESTS, Frame, FrameDecoder
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot import models
from mrl_driver.robot.models import OmniDrive, RobotModel
from mrl_driver.robot.odometry import Odometry
from mrl_driver.robot.omni_odometry import MOVE_OMNI, OmniCommands, OmniOdometry
from mrl_driver.robot.robot_state import odometry_of
from mrl_driver.robot.sonar import NAMES, range_m

from .recorded_link import CHECKED, PLAIN
from .recording import REMARK, TO_BOARD, Recording

_CODE = {name: row.code for name, row in BY_NAME.items()}
_OMNI = _CODE["start_omni_stream"]
_COUNTS = (_CODE["read_encoders"], _CODE["read_encoders_and_sonars"], _OMNI)
_REPORT_EVERY = 2000


class Chronicle(NamedTuple):
    """What happened, each list in the order of time; times are seconds since the recording began."""

    path: str
    started: str
    """When, as ISO 8601; empty where the file does not say."""
    model: RobotModel
    robot_id: int
    poses: List[Tuple[float, float, float, float]]
    """Time, x, y, yaw [s m m rad]."""
    twists: List[Tuple[float, float, float]]
    """Time, forward speed, yaw rate [s m/s rad/s], measured."""
    commands: List[Tuple[float, float, float]]
    """The same as asked for; a stop is zero."""
    ranges: Dict[str, List[Tuple[float, float]]]
    """Time and range [s m] by sonar; NaN for no reading, infinity for nothing."""
    battery: List[Tuple[float, float]]
    """Time and voltage [s V]."""


def read(
    recording: Recording,
    model: Optional[RobotModel] = None,
    advance: Callable[[float], None] = lambda part: None,
) -> Chronicle:
    """All of a recording; without `model` the packaged one of the id that the board reports.

    `advance` is told of the progress, 1.0 in all.

    Raises:
        ConfigError: the recording holds no odometry, or no packaged model lists its robot.
    """
    reader = _Reader(model)
    size, done, bytes_seen = max(1, os.path.getsize(recording.path)), 0.0, 0
    for number, (time_s, way, data) in enumerate(recording):
        reader.read(time_s, way, data)
        bytes_seen += len(data) + 12
        if number % _REPORT_EVERY == 0:
            share = min(1.0, bytes_seen / size)
            advance(share - done)
            done = share
    if reader.model is None or not reader.poses:
        raise ConfigError(_nothing(recording, reader))
    started = str(recording.header.get("started", ""))
    return Chronicle(
        recording.path,
        started,
        reader.model,
        reader.robot_id,
        reader.poses,
        reader.twists,
        reader.commands,
        {name: found for name, found in reader.ranges.items() if found},
        reader.battery,
    )


def _nothing(recording: Recording, reader: "_Reader") -> str:
    if reader.model is None and reader.robot_id:
        return f"{recording.path}: robot id {reader.robot_id} is in no packaged model; name its file with --robot"
    return f"{recording.path}: no odometry in it, expected frames of a robot; look with: mrl replay {recording.path}"


class _Reader:
    """Takes entries in."""

    def __init__(self, model: Optional[RobotModel]) -> None:
        self.model, self.robot_id = model, 0
        self.poses: List[Tuple[float, float, float, float]] = []
        self.twists: List[Tuple[float, float, float]] = []
        self.commands: List[Tuple[float, float, float]] = []
        self.ranges: Dict[str, List[Tuple[float, float]]] = {name: [] for name in NAMES}
        self.battery: List[Tuple[float, float]] = []
        self._version = 2
        self._odometry: Optional[Odometry] = None
        self._replies, self._requests = FrameDecoder(REPLIES), FrameDecoder(REQUESTS)

    def read(self, time_s: float, way: str, data: bytes) -> None:
        """One entry."""
        if way == REMARK:
            self._remark(data)
            return
        decoder, take = (
            (self._requests, self._on_request) if way == TO_BOARD else (self._replies, self._on_reply)
        )
        for event in decoder.feed(data):
            if isinstance(event, Frame):
                take(event, time_s)

    def _remark(self, text: bytes) -> None:
        if text in (CHECKED, PLAIN):
            self._replies.checked = self._requests.checked = text == CHECKED
        elif text.startswith(b"opened") and self._odometry is not None:
            self._odometry.reset()

    def _on_request(self, frame: Frame, time_s: float) -> None:
        if frame.code == _CODE["stop"]:
            self.commands.append((time_s, 0.0, 0.0))
        elif frame.code == _CODE["move_differential"]:
            self.commands.append((time_s, frame.args[0] / 1000, frame.args[1] / 1000))
        elif frame.code == MOVE_OMNI and self.model is not None and isinstance(self.model.drive, OmniDrive):
            self.commands.append((time_s, *OmniCommands(self.model, self.model.drive).read(frame.args)[:2]))

    def _on_reply(self, frame: Frame, time_s: float) -> None:
        if frame.code == _CODE["robot_info"]:
            self.battery.append((time_s, frame.args[2] / 100))
            self._version, self.robot_id = frame.args[3], frame.args[4]
            name = models.by_id(self.robot_id)
            self.model = self.model or (models.load(name) if name else None)
        elif frame.code in _COUNTS and self.model is not None:
            self._on_counts(frame, time_s, self.model)

    def _on_counts(self, frame: Frame, time_s: float, model: RobotModel) -> None:
        if self._odometry is None:
            self._odometry = odometry_of(model, False)
        sonars = frame.args[2:5]
        if isinstance(self._odometry, OmniOdometry):
            if frame.code != _OMNI:
                return
            self._odometry.update(frame.args[0], frame.args[1], time_s, frame.args[2])
            sonars = frame.args[3:6]
        else:
            self._odometry.update(frame.args[0], frame.args[1], time_s)
        pose, twist = self._odometry.pose, self._odometry.twist
        self.poses.append((time_s, pose.x_m, pose.y_m, pose.yaw_rad))
        self.twists.append((time_s, twist.linear_m_s, twist.angular_rad_s))
        for name, value in zip(NAMES, sonars):
            if name in model.sonars:
                self.ranges[name].append((time_s, range_m(value, self._version)))


def way_m(chronicle: Chronicle) -> float:
    """Length of the robot's way [m]."""
    points = [pose[1:3] for pose in chronicle.poses]
    return math.fsum(math.dist(start, end) for start, end in zip(points, points[1:]))
