"""Summary of a recording: frames, damage, losses and the robot's path.  Memory does not grow with the file."""

import math
from collections import Counter
from typing import Any, Dict, List, Optional, Tuple

import numpy as np

from mrl_driver.geometry import ORIGIN
from mrl_driver.protocol import REPLIES, REQUESTS, Frame
from mrl_driver.protocol.table import BY_CODE, SENSOR_BY_NAME
from mrl_driver.robot.models import RobotModel

from .decoded import HELD_BYTES, LINE_BYTES, RecordedRobot, sensors_in, split
from .frame_arrays import FrameArray, FrameArrayDecoder
from .lines import Block, block_of
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


def summarise(recording: Recording, model: Optional[RobotModel] = None) -> Dict[str, Any]:
    """Figures of a whole recording, ready for JSON; with the unit at the end of each key.

    Without `model`, the packaged model that lists the board's id is used; if there is none, or its board has no motors,
    pose and `refused_counts` are None.  Garbage is counted by the name of its reason, `lost` and `duplicates` by
    sequence number.  Each sensor has its smallest and its largest value, in `unit`.  `imu` is the state of the IMU at
    the end, one of `robot.imu.STATES`.
    """
    reader = _Reader(model, recording.start_us / 1e6)
    for block in recording.blocks():
        reader.read(block)
    reader.end()
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


def _remarks(block: Block) -> List[Tuple[int, bytes]]:
    """Return index and text of each remark in the block."""
    found = np.flatnonzero(block.directions == ord(REMARK))
    ends, sizes = block.ends[found].tolist(), block.sizes[found].tolist()
    data = block.data.tobytes() if ends else b""
    return [(i, data[end - size : end]) for i, end, size in zip(found.tolist(), ends, sizes)]


class _Reader:
    """Adds up the blocks of a recording."""

    def __init__(self, model: Optional[RobotModel], start_s: float) -> None:
        self.robot = RecordedRobot(model, start_s)
        self.duration_s = 0.0
        self.sizes = Counter({FROM_BOARD: 0, TO_BOARD: 0})
        self.frames: Counter[int] = Counter()
        self.requests: Counter[int] = Counter()
        self.sensors: Dict[str, Dict[str, Any]] = {}
        self.garbage: Counter[str] = Counter()
        self._held = block_of([])
        self._open()

    def read(self, block: Block) -> None:
        """Add a block."""
        self.duration_s, first = float(block.times_s[-1]), 0
        used = block.directions != ord(REMARK)
        for i, remark in _remarks(block):
            if remark in (CHECKED, PLAIN) or remark.startswith(OPENED):
                self._hold(block.part(first, i).only(used[first:i]))
                self._on_remark(remark)
                first = i + 1
            used[i] = remark.startswith((MODEL, POSE, SESSION))
        self._hold(block.part(first, len(used)).only(used[first:]))

    def end(self) -> None:
        """The recording ends here."""
        self._decode(self._held)
        self._close()

    def _open(self) -> None:
        self._to_board, self._from_board = FrameArrayDecoder(REQUESTS), FrameArrayDecoder(REPLIES)

    def _close(self) -> None:
        for decoder in (self._to_board, self._from_board):
            decoder.flush()
        self.garbage += self._from_board.garbage

    def _hold(self, block: Block) -> None:
        """Decode all but the last bytes: a remark that follows may apply to those."""
        held = self._held.followed_by(block)
        sizes = np.where(held.directions == ord(REMARK), 0, held.sizes + LINE_BYTES)
        behind = int(sizes.sum()) - np.cumsum(sizes)
        done = int(np.count_nonzero(behind >= HELD_BYTES))
        self._decode(held.part(0, done))
        self._held = held.part(done, len(held.ends))

    def _on_remark(self, remark: bytes) -> None:
        before = list(self._held.entries())
        behind: List[Entry] = []
        checked = remark == CHECKED
        opened = remark.startswith(OPENED)
        if not opened and checked != self._from_board.checked:
            before, behind = split(before, checked)
        self._held = block_of([])
        self._decode(block_of(before))
        self.robot.begin_again()
        if opened:
            self._close()
            self._open()
            return
        self._from_board.checked = checked
        self._decode(block_of(behind))
        self._to_board.checked = checked

    def _decode(self, block: Block) -> None:
        first = 0
        for i, remark in _remarks(block):
            self._decode_bytes(block.part(first, i))
            self.robot.take_remark(remark)
            first = i + 1
        self._decode_bytes(block.part(first, len(block.ends)))

    def _decode_bytes(self, block: Block) -> None:
        if not len(block.ends):
            return
        asked = block.only(block.directions == ord(TO_BOARD))
        heard = block.only(block.directions == ord(FROM_BOARD))
        self.sizes[TO_BOARD] += len(asked.data)
        self.sizes[FROM_BOARD] += len(heard.data)
        for frames in self._to_board.feed(asked.data):
            self.requests[frames.code] += len(frames.at)
        found = []
        for frames in self._from_board.feed(heard.data):
            self.frames[frames.code] += len(frames.at)
            self._sense(frames)
            found.append((frames, heard.times_s[np.searchsorted(heard.ends, frames.at, side="right")]))
        self.robot.take_arrays(found)

    def _sense(self, frames: FrameArray) -> None:
        for name, found in sensors_in(Frame(frames.code, tuple(frames.args.T)), 0.0).items():
            unit = SENSOR_BY_NAME[name].fields[0].base_unit
            known = self.sensors.setdefault(name, {"least": math.inf, "most": -math.inf, "unit": unit})
            values = np.array(found.values)
            known["least"] = float(min(known["least"], values.min()))
            known["most"] = float(max(known["most"], values.max()))
