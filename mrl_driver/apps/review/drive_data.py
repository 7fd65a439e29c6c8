"""A recorded drive as arrays: everything that the page and the findings use.

The recording plays through the driver itself (`RecordedDriver`), so that poses, ranges and events are those that the
program had that drove the robot.
"""

import contextlib
import math
from array import array
from bisect import bisect_left
from collections import defaultdict
from itertools import chain
from typing import TYPE_CHECKING, Any, Callable, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from mrl_driver.errors import BoardTimeout, ConfigError
from mrl_driver.protocol import Frame
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.recording.recorded_facts import Gap
from mrl_driver.recording.recording import FROM_BOARD, OPENED, PHONE, POSE, STOP, TO_BOARD
from mrl_driver.robot.imu import Imu
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.robot.wheel_odometry import MOVE_OMNI, MOVE_TWIST, PlanarCommands, commands_of
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.session.events import Ready, SensorRead, Stale, Status
from mrl_driver.session.handshake import Board
from mrl_driver.session.link_counters import Counters
from mrl_driver.session.motion_command import MOVE
from mrl_driver.session.motion_command import STOP as STOP_CODE
from mrl_driver.session.sequence import Stream
from mrl_driver.session.session import STALE_S
from mrl_driver.view.words import stopped_text

if TYPE_CHECKING:
    from mrl_driver.driver.recorded import Heard, RecordedDriver, Remark, Sent

_STATUS, _INFO = BY_NAME["read_status"].code, BY_NAME["robot_info"].code
MOST_KEPT = 200_000
"""Most damaged pieces and events of a recording together, about 40 MB; eight in a second, for seven hours."""
_TOGETHER_S = 0.5  # a stop and its reason are written within this time of each other [s]
_NOT_STOPS = (StopReason.NONE, StopReason.HOST, StopReason.BOOT)
"""Reasons of the board that are not stops of their own: the host's stop is recorded as it is sent."""


_WIDTHS = {"poses": 3, "speeds": 3, "commands": 3, "battery": 2, "imu": 5, "delays": 0, "round_trips": 0}


class Column(NamedTuple):
    """Values over time."""

    time_s: Any  # array `(N,)`: seconds since the recording began
    values: Any  # array `(N,)` or `(N, k)`; NaN where a value is unknown


class Stop(NamedTuple):
    """A stop of the robot, or of its command."""

    time_s: float
    reason: StopReason  # `user` if the recording does not say it
    text: str  # the reason in words
    direction: str  # direction of the frame `data`, `>` or `<`; empty without one
    data: bytes  # the frame that proves the stop; empty if there is none

    @property
    def frame(self) -> Tuple[float, str, bytes]:
        """Moment, direction and bytes of the proof, for a `Finding`."""
        return self.time_s, self.direction, self.data


class Frames:
    """All frames of one direction, in order of time."""

    def __init__(self) -> None:
        self.times_s = array("d")
        self.codes = array("h")
        self._bytes = bytearray()
        self._ends = array("L")

    def add(self, time_s: float, code: int, data: bytes) -> None:
        """Add a frame."""
        self.times_s.append(time_s)
        self.codes.append(code)
        self._bytes += data
        self._ends.append(len(self._bytes))

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._ends)

    def data(self, index: int) -> bytes:
        """Return the bytes of a frame."""
        return bytes(self._bytes[self._ends[index - 1] if index else 0 : self._ends[index]])

    def times_of(self, *codes: int) -> Any:
        """Return the times of the frames with these codes, as an array."""
        return np.frombuffer(self.times_s)[np.isin(np.frombuffer(self.codes, dtype=np.int16), codes)]

    def at(self, time_s: float, *codes: int) -> bytes:
        """Return the first frame with one of these codes (any, if none is given) at or after a time; else the last one
        before it; empty if there is none.
        """
        start = bisect_left(self.times_s, time_s)
        for each in chain(range(start, len(self)), range(start - 1, -1, -1)):
            if not codes or self.codes[each] in codes:
                return self.data(each)
        return b""


class DriveData(NamedTuple):
    """One drive; see the module.  Times are seconds since the recording began."""

    path: str
    started: str  # start time as ISO 8601; empty if the file does not hold it
    port: str
    model: RobotModel
    robot_id: int
    board: Optional[Board]  # the board's identity; None if it did not answer
    duration_s: float
    poses: Column  # x y yaw [m m rad]
    speeds: Column  # driven: linear, angular, lateral [m/s rad/s m/s]
    commands: Column  # asked, when it was sent: linear, angular, lateral; a stop is zeros
    counts: Column
    """Counts of each wheel since the start, without wrap, in the order of its telemetry."""
    stamps_s: Any
    """Array `(N,)`: board time of each telemetry on the host's clock [s since the recording began]."""
    ranges: Dict[str, Column]  # each new reading of each sonar [m], as in REP 117
    battery: Column  # voltage and temperature [V degC]; NaN if not measured
    imu: Column
    """Yaw rate without bias, accelerations x y z, bias [rad/s m/s2 m/s2 m/s2 rad/s], in the axes of base_link; the
    times are those of the readings.  The bias is NaN until it is known."""
    sensors: Dict[str, Column]  # values of each sensor of `table.SENSORS`
    statuses: List[Tuple[float, Status]]
    stops: List[Stop]
    garbage: List[Tuple[float, str, str, bytes]]  # time, direction, reason, data
    lost: Column  # number of lost frames so far, after each loss
    delays: Column
    """Delay of each telemetry beyond the least one [s]; of boards without board time there is none."""
    round_trips: Column  # time from a request for `robot_info` to its answer [s]
    opened: List[Tuple[float, str]]
    remarks: List[Tuple[float, str]]  # without the readings of a phone's sensors, of which there are many
    events: List[Tuple[float, object]]
    """The driver's events: `Ready`, `Stale`, `Mismatch`, `ImuChanged`, `PathUnknown` and others, and its errors."""
    heard: Frames  # frames from the board
    sent: Frames  # frames to the board
    skipped_lines: int  # lines of the recording that could not be read, or not be written
    gaps: List[Gap]  # lines that could not be written
    breaks_off: bool  # the end of the recording is missing, and nobody writes it any more

    @property
    def robot_name(self) -> str:
        """Name and id of the robot, and whether it is virtual."""
        kind = "virtual " if self.board is not None and self.board.virtual else ""
        return f"{kind}{self.model.name} {self.robot_id}" if self.robot_id else self.model.name

    @property
    def path_length_m(self) -> float:
        """Length of the robot's path [m]."""
        return float(np.hypot(*self.steps().T[:2]).sum())

    def steps(self, every: int = 1) -> Any:
        """Return the motion from one pose to the one `every` places on, in the robot's frame, `(N, 3)` [m m rad].

        Where a pose was set, it is 0.
        """
        x_m, y_m, yaw = self.poses.values[::every].T
        yaw = np.unwrap(yaw)
        dx, dy, middle = np.diff(x_m), np.diff(y_m), 0.5 * (yaw[1:] + yaw[:-1])
        cos, sin = np.cos(middle), np.sin(middle)
        steps = np.stack((dx * cos + dy * sin, dy * cos - dx * sin, np.diff(yaw)), axis=1)
        set_s = [time_s for time_s, text in self.remarks if text.startswith(POSE.decode())]
        jumps = (np.searchsorted(self.poses.time_s, set_s, "right") - 1) // every
        steps[jumps[(jumps >= 0) & (jumps < len(steps))]] = 0.0
        return steps


def read(recorded: "RecordedDriver", advance: Callable[[float], None] = lambda part: None) -> DriveData:
    """Play a whole recording, as `RecordedDriver.play`; return its data, or raise ConfigError if no robot answered."""
    return _Reader(recorded).read(advance)


class _Rows:
    """Rows of numbers that grow: a time and `width` values; with a width of 0 one value, and a flat column."""

    def __init__(self, width: int = 0) -> None:
        self._width, self._numbers = width, array("d")
        self.append = self._numbers.extend

    def column(self) -> Column:
        table = np.frombuffer(self._numbers, dtype=float).reshape(-1, 1 + (self._width or 1))
        return Column(table[:, 0], table[:, 1:] if self._width else table[:, 1])


class _Reader:
    """Collects the columns while the recording plays."""

    def __init__(self, recorded: "RecordedDriver") -> None:
        self._recorded = recorded
        self._rows = {name: _Rows(width) for name, width in _WIDTHS.items()}
        self._stamps_s = array("d")
        self._ranges: Dict[str, _Rows] = defaultdict(_Rows)
        self._sensors: Dict[str, _Rows] = {}
        self._statuses: List[Tuple[float, Status]] = []
        self._stops: List[Stop] = []
        self._garbage: List[Tuple[float, str, str, bytes]] = []
        self._kept = 0
        self._opened: List[Tuple[float, str]] = []
        self._remarks: List[Tuple[float, str]] = []
        self._events: List[Tuple[float, object]] = []
        self._heard, self._sent = Frames(), Frames()
        self._losses: List[Tuple[float, int]] = []  # time, and number of lost frames so far
        self._lost_before = 0  # lost frames until the last telemetry
        self._counters = Counters()
        self._stream = Stream(self._counters)
        self._stamped_s = -math.inf
        self._asked_s = math.nan
        self._moves = False  # the last command that was sent moves the robot
        self._planar: Optional[PlanarCommands] = None
        self._mismatch = ""  # the last wheel that did not follow its command

    def read(self, advance: Callable[[float], None]) -> DriveData:
        recorded = self._recorded
        recorded.on_telemetry(self._on_telemetry)
        recorded.on(Imu, self._on_imu)
        recorded.on(Status, self._on_status)
        recorded.on(Board, self._on_battery)
        recorded.on(SensorRead, self._on_sensor)
        recorded.on_event(self._on_event)
        recorded.on_sent(self._on_sent)
        recorded.on_heard(self._on_heard)
        recorded.on_remark(self._on_remark)
        recorded.play(advance)
        if recorded.model is None:
            raise ConfigError(
                f"{recorded.recording.path} holds no answer of a robot, expected its frames: check port and baud "
                "rate of the recorded program"
            )
        return self._data(recorded.model)

    def _data(self, model: RobotModel) -> DriveData:
        recorded, recording, board = self._recorded, self._recorded.recording, None
        with contextlib.suppress(BoardTimeout):
            board = recorded.board
        return DriveData(
            path=recording.path,
            started=str(recording.header.get("started") or ""),
            port=str(recording.header.get("port") or ""),
            model=model,
            robot_id=board.robot_id if board else 0,
            board=board,
            duration_s=recorded.time_s,
            stamps_s=np.frombuffer(self._stamps_s, dtype=float),
            ranges={name: rows.column() for name, rows in self._ranges.items()},
            sensors={name: rows.column() for name, rows in self._sensors.items()},
            statuses=self._statuses,
            stops=self._stops,
            garbage=self._garbage,
            lost=Column(*np.array(self._losses, dtype=float).reshape(-1, 2).T),
            opened=self._opened,
            remarks=self._remarks,
            events=self._events,
            heard=self._heard,
            sent=self._sent,
            skipped_lines=recording.skipped_count + sum(gap.lines for gap in recorded.gaps),
            gaps=recorded.gaps,
            breaks_off=recorded.breaks_off,
            **{name: rows.column() for name, rows in {"counts": _Rows(2), **self._rows}.items()},
        )

    def _keep(self, kept: List[Any], item: Any) -> None:
        """Add what a good drive has little of: damage, events; raise ConfigError if memory should not hold more."""
        self._kept += 1
        if self._kept > MOST_KEPT:
            raise ConfigError(
                f"{self._recorded.recording.path} has more than {MOST_KEPT} damaged pieces and events until "
                f"{self._recorded.time_s:.0f} s, expected frames of a robot: check port and baud rate of the recorded "
                "program"
            )
        kept.append(item)

    # -- what the driver had

    def _on_telemetry(self, telemetry: Telemetry) -> None:
        now_s, twist, counts = self._recorded.time_s, telemetry.twist, telemetry.counts
        self._lost_before = self._counters.lost
        self._rows["poses"].append((now_s, *telemetry.pose))
        self._rows["speeds"].append((now_s, twist.linear_m_s, twist.angular_rad_s, twist.lateral_m_s))
        if "counts" not in self._rows:
            self._rows["counts"] = _Rows(len(counts))
        self._rows["counts"].append((now_s, *counts))
        delay_s = telemetry.arrival_s - telemetry.stamp_s
        self._stamps_s.append(now_s - delay_s)
        if telemetry.sequence is not None:
            self._rows["delays"].append((now_s, delay_s))
        for name in telemetry.fresh:
            self._ranges[name].append((now_s, telemetry.ranges[name]))

    def _on_imu(self, imu: Imu) -> None:
        bias = imu.bias_rad_s if imu.bias_known else math.nan
        rate = imu.angular_velocity_rad_s[2] - imu.bias_rad_s
        made_s = self._recorded.time_s - (imu.reading.arrival_s - imu.stamp_s)
        self._rows["imu"].append((made_s, rate, *imu.linear_acceleration_m_s2, bias))

    def _on_battery(self, board: Board) -> None:
        self._rows["battery"].append((self._recorded.time_s, board.battery_v, board.temperature_c))

    def _on_sensor(self, event: SensorRead) -> None:
        rows = self._sensors.setdefault(event.name, _Rows(len(event.reading.values)))
        rows.append((self._recorded.time_s, *event.reading.values))

    def _on_status(self, status: Status) -> None:
        now_s = self._recorded.time_s
        before = self._statuses[-1][1].stop_reason if self._statuses else status.stop_reason
        self._statuses.append((now_s, status))
        if status.stop_reason != before and status.stop_reason not in _NOT_STOPS:
            frame = self._heard.at(now_s, _STATUS)
            if self._told(status.stop_reason):
                self._stops[-1] = self._stops[-1]._replace(direction=FROM_BOARD, data=frame)
            else:
                self._note_stop(now_s, status.stop_reason, "", FROM_BOARD, frame)

    def _on_event(self, event: object) -> None:
        self._keep(self._events, (self._recorded.time_s, event))
        if isinstance(event, Ready) and event.restarted:
            self._stream.begin_anew()
            self._counters.lost = self._lost_before  # after a restart the numbers start again: none were lost
            self._losses = [each for each in self._losses if each[1] <= self._lost_before]
        elif isinstance(event, Mismatch):
            self._mismatch = str(event)
        elif isinstance(event, Stale) and self._moves and not self._is_in_gap(event.age_s):
            self._moves = False
            self._note_stop(self._recorded.time_s, StopReason.NO_TELEMETRY, "", "", b"")

    def _is_in_gap(self, age_s: float) -> bool:
        """Return whether a part of this time until now was not recorded [s]."""
        gaps = self._recorded.gaps
        return bool(gaps) and gaps[-1].end_s > self._recorded.time_s - age_s

    # -- what was on the wire

    def _on_remark(self, remark: "Remark") -> None:
        text = remark.text
        if text.startswith(PHONE.decode()):
            return
        self._remarks.append((remark.time_s, text))
        if text.startswith(OPENED.decode()):
            self._opened.append((remark.time_s, text[len(OPENED) :]))
            self._stream.begin_anew()
        elif text.startswith(STOP.decode()):
            reason = StopReason(text[len(STOP) :].partition(" ")[0])
            detail = self._mismatch if reason is StopReason.WHEEL_MISMATCH else ""
            self._note_stop(remark.time_s, reason, detail, "", b"")

    def _told(self, reason: Optional[StopReason] = None) -> bool:
        """Return whether a stop was just noted, with this reason if one is given."""
        last = self._stops[-1] if self._stops else None
        return last is not None and (
            self._recorded.time_s - last.time_s <= _TOGETHER_S and reason in (None, last.reason)
        )

    def _note_stop(self, time_s: float, reason: StopReason, detail: str, direction: str, data: bytes) -> None:
        text = stopped_text(reason) + (f" ({detail})" if detail else "")
        last = self._stops[-1] if self._stops else None
        if not data and last is not None and last.reason is StopReason.USER and self._told():
            self._stops[-1] = last._replace(reason=reason, text=text)  # its remark comes after the frame
        elif data or not self._told(reason):
            self._stops.append(Stop(time_s, reason, text, direction, data))

    def _on_sent(self, sent: "Sent") -> None:
        time_s, event, data = sent
        if not isinstance(event, Frame):
            self._keep(self._garbage, (time_s, TO_BOARD, event.reason, data))
            return
        self._sent.add(time_s, event.code, data)
        code = event.code
        if code == STOP_CODE:
            self._on_stop(time_s, data)
        elif code == MOVE:
            linear, angular = event.args[:2]
            self._command(time_s, linear / 1000, angular / 1000)
        elif code in (MOVE_OMNI, MOVE_TWIST):
            model = self._recorded.model
            if self._planar is None and model is not None:
                self._planar = commands_of(model.drive)
            if self._planar is not None and self._planar.code == code:
                self._command(time_s, *self._planar.read(event.args))
        elif code == _INFO:
            self._asked_s = time_s

    def _command(self, time_s: float, linear: float, angular: float, lateral: float = 0.0) -> None:
        self._rows["commands"].append((time_s, linear, angular, lateral))
        self._moves = bool(linear or angular or lateral)

    def _on_stop(self, time_s: float, data: bytes) -> None:
        last = self._stops[-1] if self._stops else None
        if last is not None and not last.data and time_s - last.time_s <= _TOGETHER_S:
            self._stops[-1] = last._replace(direction=TO_BOARD, data=data)
        elif self._moves and not self._told():
            self._note_stop(time_s, StopReason.USER, "", TO_BOARD, data)
        self._command(time_s, 0.0, 0.0)

    def _on_heard(self, heard: "Heard") -> None:
        time_s, event, data = heard
        if not isinstance(event, Frame):
            self._keep(self._garbage, (time_s, FROM_BOARD, event.reason, data))
            return
        code = event.code
        self._heard.add(time_s, code, data)
        if code == _INFO and self._asked_s == self._asked_s:
            self._rows["round_trips"].append((time_s, time_s - self._asked_s))
            self._asked_s = math.nan
        if event.stamp is not None:
            lost = self._counters.lost
            self._stream.missing(event.stamp.sequence, time_s - self._stamped_s >= STALE_S)
            self._stamped_s = time_s
            if self._counters.lost != lost:
                self._losses.append((time_s, self._counters.lost))
