"""Summary of a recording: frames, damage, losses and the robot's path.  Memory does not grow with the file."""

import math
from collections import Counter
from typing import Any, Dict, Optional, Tuple

from mrl_driver.geometry import ORIGIN
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_CODE, SENSOR_BY_NAME
from mrl_driver.robot.models import RobotModel

from .decoded import DecodedPart, RecordedRobot, decode, sensors_in
from .recording import FROM_BOARD, REMARK, TO_BOARD, Recording


def summarise(recording: Recording, model: Optional[RobotModel] = None) -> Dict[str, Any]:
    """Figures of a whole recording, ready for JSON; with the unit at the end of each key.

    Without `model`, the packaged model that lists the board's id is used; if there is none, or its board has no motors,
    pose and `refused_counts` are None.  Garbage is counted by the name of its reason, `lost` and `duplicates` by
    sequence number.  Each sensor has its smallest and its largest value, in `unit`.  `imu` is the state of the IMU at
    the end, one of `robot.imu.STATES`.
    """
    reader = _Reader(model)
    for part in decode(recording):
        reader.read(part)
    robot, odometry = reader.robot, reader.robot.odometry
    moves = robot.model is not None and robot.model.drives
    pose = (odometry.pose if odometry else ORIGIN)._asdict() if moves else None
    refused = odometry.baseline.refused if odometry else 0
    return {
        "file": recording.path,
        "started": recording.header.get("started"),
        "port": recording.header.get("port"),
        "robot": robot.model.name if robot.model else None,
        "robot_id": robot.robot_id,
        "duration_s": reader.duration_s,
        "bytes_from_board": reader.sizes[FROM_BOARD],
        "bytes_to_board": reader.sizes[TO_BOARD],
        "frames": _named(reader.frames),
        "requests": _named(reader.requests),
        "garbage": dict(sorted(reader.garbage.items())),
        "lost": robot.counters.lost,
        "duplicates": robot.counters.duplicates,
        "refused_counts": refused if moves else None,
        "pose": pose,
        "sensors": reader.sensors,
        "imu": robot.imu_state,
        "skipped_lines": recording.skipped_count,
        "skipped": {str(number): reason for number, reason in recording.skipped.items()},
    }


def _named(codes: Dict[int, int]) -> Dict[str, int]:
    return {BY_CODE[code].name: count for code, count in sorted(codes.items())}


class _Reader:
    """Adds up the parts of a recording."""

    def __init__(self, model: Optional[RobotModel]) -> None:
        self.robot = RecordedRobot(model)
        self.duration_s = 0.0
        self.sizes = Counter({FROM_BOARD: 0, TO_BOARD: 0})
        self.frames: Counter[int] = Counter()
        self.requests: Counter[int] = Counter()
        self.garbage: Counter[str] = Counter()
        self.sensors: Dict[str, Dict[str, Any]] = {}

    def read(self, part: DecodedPart) -> None:
        """Add one part."""
        time_s, direction, data, events = part
        self.duration_s = max(self.duration_s, time_s)
        if direction == REMARK:
            self.robot.begin_again()
            return
        self.sizes[direction] += len(data)
        if direction == TO_BOARD:
            self.requests.update(event.code for event in events if isinstance(event, Frame))
            return
        for event in events:
            if isinstance(event, Frame):
                self.frames[event.code] += 1
                self.robot.take(event, time_s)
                for name, found in sensors_in(event, time_s).items():
                    self._sense(name, found.values)
            else:
                self.garbage[event.reason] += 1

    def _sense(self, name: str, values: Tuple[float, ...]) -> None:
        unit = SENSOR_BY_NAME[name].fields[0].base_unit
        known = self.sensors.setdefault(name, {"least": math.inf, "most": -math.inf, "unit": unit})
        known["least"] = float(min(known["least"], *values))
        known["most"] = float(max(known["most"], *values))
