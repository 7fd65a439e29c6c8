"""Summary of a recording: frames, damage, losses and the robot's path.  Memory does not grow with the file."""

import math
from collections import Counter
from typing import Any, Callable, Dict, List, Optional

from mrl_driver.geometry import ORIGIN
from mrl_driver.protocol import Event, Frame
from mrl_driver.protocol.table import BY_CODE, SENSOR_BY_NAME
from mrl_driver.robot.models import RobotModel

from .decoded import LINE_BYTES, RecordedRobot, decode, sensors_in
from .recording import FROM_BOARD, REMARK, TO_BOARD, Recording


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
            reader.robot.take_remark(data)
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
    """Adds up the frames of a recording."""

    def __init__(self, model: Optional[RobotModel], start_s: float) -> None:
        self.robot = RecordedRobot(model, start_s)
        self.duration_s = 0.0
        self.sizes = Counter({FROM_BOARD: 0, TO_BOARD: 0})
        self.frames: Counter[int] = Counter()
        self.requests: Counter[int] = Counter()
        self.sensors: Dict[str, Dict[str, Any]] = {}
        self.garbage: Counter[str] = Counter()

    def figures(self) -> Dict[str, Any]:
        """Return the figures of the drive."""
        robot, odometry = self.robot, self.robot.odometry
        moves = robot.model is not None and robot.model.drives
        refused = odometry.baseline.refused if odometry else 0
        return {
            "robot": robot.model.name if robot.model else None,
            "robot_id": robot.robot_id,
            "duration_s": self.duration_s,
            "bytes_from_board": self.sizes[FROM_BOARD],
            "bytes_to_board": self.sizes[TO_BOARD],
            "frames": _named(self.frames),
            "requests": _named(self.requests),
            "garbage": dict(sorted(self.garbage.items())),
            "lost": robot.counters.lost,
            "duplicates": robot.counters.duplicates,
            "refused_counts": refused if moves else None,
            "pose": (odometry.pose if odometry else ORIGIN)._asdict() if moves else None,
            "sensors": self.sensors,
            "imu": robot.imu_state,
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
                self.robot.take(event, time_s)
                self._sense(event)
            else:
                self.garbage[event.reason] += 1

    def _sense(self, frame: Frame) -> None:
        for name, found in sensors_in(frame, 0.0).items():
            unit = SENSOR_BY_NAME[name].fields[0].base_unit
            known = self.sensors.setdefault(name, {"least": math.inf, "most": -math.inf, "unit": unit})
            known["least"] = min(known["least"], *found.values)
            known["most"] = max(known["most"], *found.values)
