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
from mrl_driver.session.sensor_polling import SENSOR_STREAM, Reading, reading, streamed

from .recorded import Heard, RecordedDriver, Sent

_SENSING = BY_NAME[SENSOR_STREAM].code


def summarise(
    recorded: RecordedDriver, advance: Callable[[float], None] = lambda share: None
) -> Dict[str, Any]:
    """Play a recording, and return its figures, ready for JSON; with the unit at the end of each key.

    What the driver knew at the end (losses, refused counts, pose, IMU) is as it had it; `refused_counts` and `pose` are
    None without a robot with motors.  Garbage is counted by the name of its reason.  Each sensor has its smallest and
    its largest value, in `unit`.  `advance` and the errors are those of `RecordedDriver.play`.
    """
    frames: Counter[int] = Counter()
    requests: Counter[int] = Counter()
    garbage: Counter[str] = Counter()
    sensors: Dict[str, Dict[str, Any]] = {}

    def on_heard(heard: Heard) -> None:
        event = heard.event
        if isinstance(event, Frame):
            frames[event.code] += 1
            for name, found in _readings(event).items():
                unit = SENSOR_BY_NAME[name].fields[0].base_unit
                known = sensors.setdefault(name, {"least": math.inf, "most": -math.inf, "unit": unit})
                known["least"] = min(known["least"], *found.values)
                known["most"] = max(known["most"], *found.values)
        else:
            garbage[event.reason] += 1

    def on_sent(sent: Sent) -> None:
        if isinstance(sent.event, Frame):
            requests[sent.event.code] += 1

    recorded.on_heard(on_heard)
    recorded.on_sent(on_sent)
    recorded.play(advance)
    recording, model, board, seen = recorded.recording, recorded.model, None, Counters()
    with contextlib.suppress(BoardTimeout):
        seen = recorded.link.statistics
        board = recorded.board
    moves = model is not None and model.drives
    return {
        "file": recording.path,
        "started": recording.header.get("started"),
        "port": recording.header.get("port"),
        "robot": model.name if model else None,
        "robot_id": board.robot_id if board else None,
        "duration_s": recorded.time_s,
        "bytes_from_board": seen.bytes_in,
        "bytes_to_board": seen.bytes_out,
        "frames": _named(frames),
        "requests": _named(requests),
        "garbage": dict(sorted(garbage.items())),
        "lost": seen.lost,
        "duplicates": seen.duplicates,
        "refused_counts": seen.refused_counts if moves else None,
        "pose": recorded.pose._asdict() if moves else None,
        "sensors": sensors,
        "imu": recorded.imu_state,
        "skipped_lines": recording.skipped_count,
        "skipped": {str(number): reason for number, reason in recording.skipped.items()},
    }


def _readings(frame: Frame) -> Dict[str, Reading]:
    """The readings of sensors in a reply, by name; of all, not only those that the driver reports."""
    row = SENSOR_BY_CODE.get(frame.code)
    if row is not None:
        return {row.name: reading(row, frame.args, 0.0)}
    return streamed(frame.args, 0.0) if frame.code == _SENSING else {}


def _named(codes: Dict[int, int]) -> Dict[str, int]:
    return {BY_CODE[code].name: count for code, count in sorted(codes.items())}
