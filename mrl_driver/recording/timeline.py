"""A recording as columns over time, for plots: poses, speeds, ranges, sensors, battery."""

import math
import os
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot.models import OmniDrive, RobotModel
from mrl_driver.robot.omni_odometry import MOVE_OMNI, STREAM, OmniCommands
from mrl_driver.robot.sonar import NAMES, range_m

from .decoded import LINE_BYTES, DecodedPart, RecordedRobot, decode, sensors_in
from .recording import REMARK, TO_BOARD, Recording

_CODE = {name: row.code for name, row in BY_NAME.items()}
_WITH_SONARS = (_CODE["read_encoders_and_sonars"], _CODE[STREAM])
_REPORT_EVERY = 2000
_SENSOR_S = 0.5


class Timeline(NamedTuple):
    """The columns of a recording, each in order of time; times are seconds since the recording began."""

    path: str
    started: str
    """Start time as ISO 8601; empty if the file does not hold it."""
    model: RobotModel
    robot_id: int
    poses: List[Tuple[float, float, float, float]]
    """Time, x, y, yaw [s m m rad]."""
    twists: List[Tuple[float, float, float]]
    """Time, measured forward speed, measured yaw rate [s m/s rad/s]."""
    commands: List[Tuple[float, float, float]]
    """Time, commanded forward speed, commanded yaw rate [s m/s rad/s]; a stop is zero."""
    ranges: Dict[str, List[Tuple[float, float]]]
    """Time and range [s m] by sonar; NaN for no reading, infinity for nothing in range."""
    battery: List[Tuple[float, float]]
    """Time and voltage [s V]."""
    sonars_known: bool
    """The recording shows whether the board has sonars; if not, `ranges` may be other values."""
    gyro: List[Tuple[float, float]]
    """Time and yaw rate of the IMU's gyro, without its bias [s rad/s]; empty without an IMU."""
    sensors: Dict[str, List[Tuple[float, ...]]]
    """Time [s] and values in the sensor's unit, by name: each change, and at least two rows a second."""


def read(
    recording: Recording,
    model: Optional[RobotModel] = None,
    advance: Callable[[float], None] = lambda part: None,
) -> Timeline:
    """Read a whole recording; without `model`, the packaged model that lists the board's id is used.

    `advance` is called with the share of the work done since its last call; the shares add up to at most 1.0.

    Raises:
        ConfigError: the recording holds no odometry, or no packaged model lists its robot.
    """
    reader = _Reader(model)
    robot = reader.robot
    size, done, bytes_seen = max(1, os.path.getsize(recording.path)), 0.0, 0
    for number, part in enumerate(decode(recording)):
        reader.read(part)
        bytes_seen += len(part.data) + LINE_BYTES
        if number % _REPORT_EVERY == 0:
            share = min(1.0, bytes_seen / size)
            advance(share - done)
            done = share
    if robot.model is None or not reader.poses:
        raise ConfigError(_nothing(recording, robot))
    started = str(recording.header.get("started", ""))
    return Timeline(
        recording.path,
        started,
        robot.model,
        robot.robot_id or 0,
        reader.poses,
        reader.twists,
        reader.commands,
        {name: found for name, found in reader.ranges.items() if found},
        reader.battery,
        robot.sonars_known,
        reader.gyro,
        reader.sensors,
    )


def _nothing(recording: Recording, robot: RecordedRobot) -> str:
    if robot.model is None and robot.robot_id:
        return (
            f"{recording.path}: no packaged model lists robot id {robot.robot_id}; give its file with --robot"
        )
    if robot.model is not None and not robot.model.drives:
        return (
            f"{recording.path} holds no odometry, because {robot.model.name} is a board without motors; its sensors "
            f"are shown by: mrl replay {recording.path}"
        )
    return f"{recording.path} holds no odometry, expected frames of a robot; check it with: mrl replay {recording.path}"


class _Reader:
    """Collects the columns from the parts of a recording."""

    def __init__(self, model: Optional[RobotModel]) -> None:
        self.robot = RecordedRobot(model)
        self.poses: List[Tuple[float, float, float, float]] = []
        self.twists: List[Tuple[float, float, float]] = []
        self.commands: List[Tuple[float, float, float]] = []
        self.ranges: Dict[str, List[Tuple[float, float]]] = {name: [] for name in NAMES}
        self.battery: List[Tuple[float, float]] = []
        self.gyro: List[Tuple[float, float]] = []
        self.sensors: Dict[str, List[Tuple[float, ...]]] = {}

    def read(self, part: DecodedPart) -> None:
        """Add one part."""
        if part.direction == REMARK:
            self.robot.begin_again()
            return
        take = self._on_request if part.direction == TO_BOARD else self._on_reply
        for event in part.events:
            if isinstance(event, Frame):
                take(event, part.time_s)

    def _on_request(self, frame: Frame, time_s: float) -> None:
        model = self.robot.model
        if frame.code == _CODE["stop"]:
            self.commands.append((time_s, 0.0, 0.0))
        elif frame.code == _CODE["move_differential"]:
            self.commands.append((time_s, frame.args[0] / 1000, frame.args[1] / 1000))
        elif frame.code == MOVE_OMNI and model is not None and isinstance(model.drive, OmniDrive):
            self.commands.append((time_s, *OmniCommands(model.drive).read(frame.args)[:2]))

    def _on_reply(self, frame: Frame, time_s: float) -> None:
        if frame.code == _CODE["robot_info"]:
            self.battery.append((time_s, frame.args[2] / 100))
        for name, found in sensors_in(frame, time_s).items():
            rows = self.sensors.setdefault(name, [])
            if not rows or rows[-1][1:] != found.values or time_s - rows[-1][0] >= _SENSOR_S:
                rows.append((time_s, *found.values))
        if not self.robot.take(frame, time_s):
            if frame.code == _CODE["read_imu"] and self.robot.imu is not None:
                imu = self.robot.imu
                self.gyro.append((time_s, imu.angular_velocity_rad_s[2] - imu.bias_rad_s))
            return
        model, odometry = self.robot.model, self.robot.odometry
        assert model is not None and odometry is not None
        pose, twist = odometry.pose, odometry.twist
        self.poses.append((time_s, pose.x_m, pose.y_m, pose.yaw_rad))
        self.twists.append((time_s, twist.linear_m_s, twist.angular_rad_s))
        if frame.code not in _WITH_SONARS or not self.robot.has_sonars:
            return
        for name, value in zip(NAMES, frame.args[3 if isinstance(model.drive, OmniDrive) else 2 :]):
            if name in model.sonars:
                self.ranges[name].append((time_s, range_m(value, self.robot.version)))


def path_length_m(timeline: Timeline) -> float:
    """Length of the robot's path [m]."""
    points = [pose[1:3] for pose in timeline.poses]
    return math.fsum(math.dist(start, end) for start, end in zip(points, points[1:]))
