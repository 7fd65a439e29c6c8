"""Reads recordings for calibrations: counts of the wheels, ranges of the front sonar, requests to the motors."""

import itertools
import math
import os
from typing import Iterator, List, NamedTuple, Tuple

import numpy as np

from mrl_driver.cli.commands.progress import progress
from mrl_driver.errors import ConfigError
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_CODE, BY_NAME
from mrl_driver.recording.decoded import LINE_BYTES, decode
from mrl_driver.recording.recording import TO_BOARD, Recording
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.odometry import Odometry
from mrl_driver.robot.robot_state import fastest_m_s
from mrl_driver.robot.sonar import range_m

_INFO = BY_NAME["robot_info"].code
_WITH_SONARS = BY_NAME["read_encoders_and_sonars"].code
_MOVING = tuple(
    BY_NAME[name].code for name in ("move_motors_pid", "move_motors", "move_differential", "stop")
)
_COUNTING = {
    code for code, row in BY_CODE.items() if [field.name for field in row.reply[:2]] == ["right", "left"]
}


class Replayed(NamedTuple):
    """`rows` (N, 4) as of `manoeuvres.Track`, with times since the recording's start; `requests` to the board."""

    rows: np.ndarray
    requests: List[Tuple[float, Frame]]


def read(path: str, model: RobotModel) -> Replayed:
    """Read a whole recording of this robot.

    Raises:
        ConfigError: the file cannot be read, belongs to another robot, holds no counts, or its counts jump.
    """
    odometry, version = Odometry(model.base, fastest_m_s(model), exact_time=False), 2
    rows: List[Tuple[float, ...]] = []
    requests: List[Tuple[float, Frame]] = []
    recording = Recording(path)
    with progress(f"reading {os.path.basename(path)}", os.path.getsize(path)) as advance:
        for part in decode(recording):
            advance(len(part.data) + LINE_BYTES)
            for frame in (event for event in part.events if isinstance(event, Frame)):
                if part.direction == TO_BOARD:
                    requests.append((part.time_s, frame))
                elif frame.code == _INFO:
                    version, robot_id = frame.args[3:5]
                    if robot_id not in model.ids:
                        raise ConfigError(
                            f"{path} is a recording of robot id {robot_id}, expected a {model.name}"
                        )
                elif frame.code in _COUNTING:
                    used = odometry.update(frame.args[0], frame.args[1], part.time_s)
                    if used or not rows:
                        front = range_m(frame.args[2], version) if frame.code == _WITH_SONARS else math.nan
                        rows.append((part.time_s, *odometry.travel, front))
    if len(rows) < 2:
        raise ConfigError(
            f"{path} holds {len(rows)} readings of the counters, expected a recording of a drive"
        )
    if odometry.baseline.refused:
        raise ConfigError(
            f"{path}: the counts jump {odometry.baseline.refused} times, expected no jump; record the drive again"
        )
    return Replayed(np.array(rows), requests)


def motor_steps_of(replayed: Replayed, code: int) -> Iterator[Tuple[np.ndarray, Tuple[int, int]]]:
    """Rows and arguments of each step with this request; the next other request to the motors ends a step."""
    orders = [(time_s, frame) for time_s, frame in replayed.requests if frame.code in (code, *_MOVING)]
    runs = [next(same) for _, same in itertools.groupby(orders, lambda order: (order[1].code, order[1].args))]
    ends_s = [time_s for time_s, _ in runs[1:]] + [math.inf]
    times_s = replayed.rows[:, 0]
    for (begin_s, frame), end_s in zip(runs, ends_s):
        if frame.code == code and any(frame.args):
            first = max(0, int(np.searchsorted(times_s, begin_s)) - 1)
            last = int(np.searchsorted(times_s, end_s))
            if first < last:
                yield replayed.rows[first:last], (frame.args[0], frame.args[1])
