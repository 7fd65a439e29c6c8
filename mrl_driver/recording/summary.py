"""What a recording says: frames, damage, losses and the robot's way, read as a stream with NumPy."""

from collections import Counter
from typing import Any, Dict, List, Optional, Tuple

import numpy as np

from mrl_driver.protocol.codec import REPLIES, REQUESTS, Frame, FrameDecoder
from mrl_driver.protocol.table import BY_CODE, BY_NAME, SENSORS, TICK_S
from mrl_driver.robot import models
from mrl_driver.robot.models import OmniDrive, RobotModel
from mrl_driver.robot.odometry import ORIGIN, Pose, advance
from mrl_driver.robot.omni_odometry import STREAM, OmniOdometry
from mrl_driver.robot.robot_state import fastest_m_s

from .frame_arrays import LogEvents, decode_log
from .odometry_arrays import integrate
from .recorded_link import CHECKED, PLAIN
from .recording import FROM_BOARD, REMARK, TO_BOARD, Recording

BATCH_BYTES = 1 << 19
"""So many bytes of the board are decoded together: memory stays the same however long the recording is."""
TAIL_BYTES = 4096
"""So many of the last bytes wait: the remark that a check value begins or ends comes behind the first such frames."""
_MOST_DOUBTED = 1000
_INFO = BY_NAME["robot_info"].code
_ENCODERS = [
    code
    for code, row in BY_CODE.items()
    if row.stamped and [f.name for f in row.reply[:2]] == ["right", "left"] and row.name != STREAM
]
_OMNI = [BY_NAME[STREAM].code]


def summarise(recording: Recording, model: Optional[RobotModel] = None) -> Dict[str, Any]:
    """Figures of a whole recording, ready for JSON; units stand in the ends of the keys.

    Without `model` the packaged one of the id that the board reports; where there is none, pose and `refused_counts`
    are None.  Garbage is counted by the name of its reason, `lost` and `duplicates` by sequence number.  Sensors have
    the least and the largest of their values, in `unit`.
    """
    reader = _Reader(model)
    for time_s, way, data in recording:
        reader.read(time_s, way, data)
    reader.decode()
    pose = reader.way.pose._asdict() if reader.model else None
    return {
        "file": recording.path,
        "started": recording.header.get("started"),
        "port": recording.header.get("port"),
        "robot": reader.model.name if reader.model else None,
        "robot_id": reader.robot_id,
        "duration_s": reader.duration_s,
        "bytes_from_board": reader.sizes[FROM_BOARD],
        "bytes_to_board": reader.sizes[TO_BOARD],
        "frames": _named(reader.frames),
        "requests": _named(reader.requests),
        "garbage": dict(sorted(reader.garbage.items())),
        "lost": reader.lost,
        "duplicates": reader.duplicates,
        "refused_counts": reader.way.refused if reader.model else None,
        "pose": pose,
        "sensors": reader.sensors,
        "skipped_lines": recording.skipped_count,
        "skipped": {str(number): reason for number, reason in recording.skipped.items()},
    }


def _named(codes: Dict[int, int]) -> Dict[str, int]:
    return {BY_CODE[code].name: count for code, count in sorted(codes.items())}


def _switch(data: bytes, checked: bool) -> int:
    """Offset of the first frame near the end of `data` from which on only the rules of `checked` make frames."""
    found = end = len(data)
    while end > max(0, len(data) - TAIL_BYTES):
        start = data.rfind(b"e", 0, end - 1) + 1
        frame = b"\r\n" + data[start:end]
        if _is_frame(frame, not checked):
            break
        found = start if _is_frame(frame, checked) else found
        end = start
    return found


def _is_frame(data: bytes, checked: bool) -> bool:
    return any(isinstance(event, Frame) for event in FrameDecoder(REPLIES, checked).feed(data))


class _Way:
    """Odometry over batches: each begins with the last reading that the one before has used."""

    def __init__(self) -> None:
        self.pose = ORIGIN
        self.refused = 0
        self._three: Optional[OmniOdometry] = None
        self.forget()

    def forget(self) -> None:
        """The next reading primes."""
        self._counts = np.zeros((0, 2), np.int16)
        self._times_s = np.zeros(0)
        if self._three is not None:
            self._three.reset()

    def go(self, counts: np.ndarray, times_s: np.ndarray, model: RobotModel, exact_time: bool) -> None:
        """Moves the pose by readings (N, 2) int16, columns right left [count], at (N,) times [s]; three wheels have a
        third column, rear.
        """
        if isinstance(model.drive, OmniDrive):
            self._slide(model.drive, counts, times_s, fastest_m_s(model), exact_time)
            return
        old = len(self._times_s)
        counts, times_s = np.concatenate((self._counts, counts)), np.concatenate((self._times_s, times_s))
        if not len(counts):
            return
        track = integrate(counts, times_s, model.drive, fastest_m_s(model), exact_time)
        self.refused += int(np.count_nonzero(~track.used[max(1, old) :]))
        self.pose = _behind(self.pose, track.poses[-1])
        last = int(np.flatnonzero(track.used)[-1]) if track.used.any() else 0
        self._counts, self._times_s = counts[last:][-_MOST_DOUBTED:], times_s[last:][-_MOST_DOUBTED:]

    def _slide(
        self, drive: OmniDrive, counts: np.ndarray, times_s: np.ndarray, fastest: float, exact_time: bool
    ) -> None:
        self._three = self._three or OmniOdometry(drive, fastest, exact_time)
        for (right, left, rear), time_s in zip(counts.tolist(), times_s.tolist()):
            self._three.update(right, left, time_s, rear)
        self.pose, self.refused = self._three.pose, self._three.baseline.refused


def _behind(pose: Pose, step: np.ndarray) -> Pose:
    """`pose`, moved by a pose relative to it."""
    x_m, y_m, yaw_rad = step.tolist()
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    turned = advance(pose, 0.0, yaw_rad)
    return Pose(
        float(pose.x_m + cos * x_m - sin * y_m), float(pose.y_m + sin * x_m + cos * y_m), turned.yaw_rad
    )


class _Reader:
    """Takes entries in, decodes the board's bytes by the batch."""

    def __init__(self, model: Optional[RobotModel]) -> None:
        self.model = model
        self.robot_id: Optional[int] = None
        self.duration_s = 0.0
        self.sizes = Counter({FROM_BOARD: 0, TO_BOARD: 0})
        self.frames: Counter[int] = Counter()
        self.requests: Counter[int] = Counter()
        self.garbage: Counter[str] = Counter()
        self.lost = self.duplicates = 0
        self.way = _Way()
        self.sensors: Dict[str, Dict[str, Any]] = {}
        self._checked = False
        self._asked = FrameDecoder(REQUESTS)
        self._chunks: List[bytes] = []
        self._arrivals_s: List[float] = []
        self._waiting = 0
        self._forget()

    def read(self, time_s: float, way: str, data: bytes) -> None:
        """One entry."""
        self.duration_s = time_s
        if way == REMARK:
            self._remark(data)
            return
        self.sizes[way] += len(data)
        if way == TO_BOARD:
            found = self._asked.feed(data)
            self.requests.update(event.code for event in found if isinstance(event, Frame))
            return
        self._chunks.append(data)
        self._arrivals_s.append(time_s)
        self._waiting += len(data)
        if self._waiting >= BATCH_BYTES:
            self._decode_frames()

    def _remark(self, text: bytes) -> None:
        """A change of rules, or another port: a new baseline."""
        if text not in (CHECKED, PLAIN) and not text.startswith(b"opened"):
            return
        checked = text == CHECKED
        data = b"".join(self._chunks)
        cut = _switch(data, checked) if checked != self._checked and text in (CHECKED, PLAIN) else len(data)
        self._take(data[:cut])
        self._drop(cut)
        self._forget()
        self._checked = self._asked.checked = checked

    def _drop(self, size: int) -> None:
        """The first `size` bytes are decoded; the others keep their times."""
        self._waiting -= size
        whole = 0
        while whole < len(self._chunks) and size >= len(self._chunks[whole]):
            size -= len(self._chunks[whole])
            whole += 1
        del self._chunks[:whole], self._arrivals_s[:whole]
        if size:
            self._chunks[0] = self._chunks[0][size:]

    def _forget(self) -> None:
        self.way.forget()
        self._sequence: Optional[int] = None
        self._board: Optional[Tuple[int, float, float]] = None

    def decode(self) -> None:
        """Decodes all that waits."""
        self._take(b"".join(self._chunks))
        self._drop(self._waiting)

    def _decode_frames(self) -> None:
        """Decodes up to the end of a frame near the last byte, if there is one; what follows waits."""
        data = b"".join(self._chunks)
        tail = min(TAIL_BYTES, len(data) // 2)
        cut = (data.rfind(b"e", 0, len(data) - tail) + 1) or len(data)
        self._take(data[:cut])
        self._drop(cut)

    def _take(self, data: bytes) -> None:
        if not data:
            return
        events = decode_log(data, self._checked)
        self.garbage.update(event.reason for event in events.garbage)
        self.frames.update({code: len(frames.end) for code, frames in events.frames.items()})
        self._look_for_model(events)
        self._count_losses(events)
        self._sense(events)
        self._move(events)

    def _sense(self, events: LogEvents) -> None:
        for row in SENSORS:
            if row.code not in events.frames:
                continue
            values = events.frames[row.code].args * [field.scale for field in row.fields]
            known = self.sensors.setdefault(
                row.name, {"least": np.inf, "most": -np.inf, "unit": row.fields[0].base_unit}
            )
            known["least"] = float(min(known["least"], values.min()))
            known["most"] = float(max(known["most"], values.max()))

    def _look_for_model(self, events: LogEvents) -> None:
        if _INFO not in events.frames or self.robot_id is not None:
            return
        self.robot_id = int(events.frames[_INFO].args[0, -1])
        name = models.by_id(self.robot_id)
        self.model = self.model or (models.load(name) if name else None)

    def _count_losses(self, events: LogEvents) -> None:
        """Gaps in the sequence of all stamped frames, in the order of the wire."""
        stamped = [frames for frames in events.frames.values() if frames.stamps is not None]
        if not stamped:
            return
        order = np.argsort(np.concatenate([frames.end for frames in stamped]))
        sequence = np.concatenate([frames.stamps[:, 0] for frames in stamped if frames.stamps is not None])[
            order
        ]
        before = [] if self._sequence is None else [self._sequence]
        numbers = np.concatenate((before, sequence)).astype(np.int64)
        missing = numbers[1:] - numbers[:-1] - 1 & 0xFFFF
        again = missing == 0xFFFF
        self.duplicates += int(np.count_nonzero(again))
        self.lost += int(missing[~again].sum())
        self._sequence = int(sequence[-1])

    def _move(self, events: LogEvents) -> None:
        if self.model is None:
            return
        three = isinstance(self.model.drive, OmniDrive)
        found = [events.frames[code] for code in (_OMNI if three else _ENCODERS) if code in events.frames]
        if not found:
            return
        order = np.argsort(np.concatenate([frames.end for frames in found]))
        arrivals_s = self._arrival_s(np.concatenate([frames.end for frames in found])[order])
        counts = np.concatenate([frames.args[:, : 3 if three else 2] for frames in found])[order]
        if self._checked:
            stamps = [frames.stamps[:, 1] for frames in found if frames.stamps is not None]
            arrivals_s = self._board_s(np.concatenate(stamps)[order], arrivals_s)
        self.way.go(counts, arrivals_s, self.model, self._checked)

    def _arrival_s(self, ends: np.ndarray) -> np.ndarray:
        """(N,) times at which the bytes before offsets `ends` arrived [s]."""
        limits = np.cumsum([len(chunk) for chunk in self._chunks])
        return np.array(self._arrivals_s)[np.searchsorted(limits, ends)]

    def _board_s(self, ticks: np.ndarray, arrivals_s: np.ndarray) -> np.ndarray:
        """(N,) board times [s] from stamps that wrap; the arrivals tell how often in a long gap."""
        base = self._board or (int(ticks[0]), float(arrivals_s[0]), 0.0)
        numbers = np.concatenate(([base[0]], ticks)).astype(np.int64)
        steps = numbers[1:] - numbers[:-1] & 0xFFFF
        expected = np.rint(np.diff(arrivals_s, prepend=base[1]) / TICK_S).astype(np.int64)
        steps += np.maximum(0, expected - steps + 0x8000 >> 16 << 16)
        times_s = base[2] + np.cumsum(steps) * TICK_S
        self._board = (int(ticks[-1]), float(arrivals_s[-1]), float(times_s[-1]))
        return times_s
