"""Summary of a recording: frames, damage, losses and the robot's path.  Memory does not grow with the file."""

import contextlib
import math
from collections import Counter
from typing import Any, Callable, Dict

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_CODE, BY_NAME, SENSOR_BY_NAME
from mrl_driver.session.link_counters import Counters
from mrl_driver.session.sensor_polling import BY_CODE as SENSOR_BY_CODE
from mrl_driver.session.sensor_polling import SENSOR_STREAM, reading, streamed

from .recorded import Heard, RecordedDriver, Sent

_WITH_SENSORS = {BY_NAME[SENSOR_STREAM].code, *SENSOR_BY_CODE}
"""Codes of the frames with readings of sensors; all of them count, not only those that the driver reports."""


class _Tally:
    """Frames of both directions, damage, and the smallest and the largest value of each sensor."""

    def __init__(self) -> None:
        self.frames: Counter[int] = Counter()
        self.requests: Counter[int] = Counter()
        self.garbage: Counter[str] = Counter()
        self.sensors: Dict[str, Dict[str, Any]] = {}

    def hear(self, heard: Heard) -> None:
        event = heard.event
        if isinstance(event, Frame):
            self.frames[event.code] += 1
            if event.code in _WITH_SENSORS:
                self._sense(event)
        else:
            self.garbage[event.reason] += 1

    def send(self, sent: Sent) -> None:
        if isinstance(sent.event, Frame):
            self.requests[sent.event.code] += 1

    def _sense(self, frame: Frame) -> None:
        row = SENSOR_BY_CODE.get(frame.code)
        readings = {row.name: reading(row, frame.args, 0.0)} if row else streamed(frame.args, 0.0)
        for name, found in readings.items():
            unit = SENSOR_BY_NAME[name].fields[0].base_unit
            known = self.sensors.setdefault(name, {"least": math.inf, "most": -math.inf, "unit": unit})
            known["least"] = min(known["least"], *found.values)
            known["most"] = max(known["most"], *found.values)


def summarise(
    recorded: RecordedDriver, advance: Callable[[float], None] = lambda share: None
) -> Dict[str, Any]:
    """Play a recording, and return its figures, ready for JSON; with the unit at the end of each key.

    What the driver knew at the end (losses, refused counts, pose, IMU) is as it had it; `refused_counts` and `pose` are
    None without a robot with odometry.  Garbage is counted by the name of its reason.  Each sensor has its smallest and
    its largest value, in `unit`.  `advance` and the errors are those of `RecordedDriver.play`.
    """
    tally = _Tally()
    recorded.on_heard(tally.hear)
    recorded.on_sent(tally.send)
    recorded.play(advance)
    recording, model, board, seen = recorded.recording, recorded.model, None, Counters()
    with contextlib.suppress(BoardTimeout):
        seen = recorded.link.statistics
        board = recorded.board
    counts = model is not None and model.has_odometry
    return {
        "file": recording.path,
        "started": recording.header.get("started"),
        "port": recording.header.get("port"),
        "robot": model.name if model else None,
        "robot_id": board.robot_id if board else None,
        "virtual": board.virtual if board else None,
        "duration_s": recorded.time_s,
        "bytes_from_board": seen.bytes_in,
        "bytes_to_board": seen.bytes_out,
        "frames": _named(tally.frames),
        "requests": _named(tally.requests),
        "garbage": dict(sorted(tally.garbage.items())),
        "lost": seen.lost,
        "duplicates": seen.duplicates,
        "refused_counts": seen.refused_counts if counts else None,
        "pose": recorded.pose._asdict() if counts else None,
        "sensors": tally.sensors,
        "imu": recorded.imu_state,
        "skipped_lines": recording.skipped_count + sum(gap.lines for gap in recorded.gaps),
        "skipped": {str(number): reason for number, reason in recording.skipped.items()},
    }


def _named(codes: Dict[int, int]) -> Dict[str, int]:
    return {BY_CODE[code].name: count for code, count in sorted(codes.items())}
