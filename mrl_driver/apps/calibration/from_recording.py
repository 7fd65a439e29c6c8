"""Reads recordings for calibrations: counts of the wheels, ranges of the front sonar, requests to the motors."""

import itertools
import math
import os
from typing import Iterator, List, NamedTuple, Tuple

import numpy as np

from mrl_driver.cli.commands.progress import progress
from mrl_driver.driver.recorded import RecordedDriver, Sent
from mrl_driver.driver.robot_core import SLOWEST_MS
from mrl_driver.errors import ConfigError
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.recording.recording import Recording
from mrl_driver.robot.models import RobotModel

from .manoeuvres import Track

_MOVING = tuple(
    BY_NAME[name].code for name in ("move_motors_pid", "move_motors", "move_differential", "stop")
)


class Replayed(NamedTuple):
    """`rows` (N, 4) as of `manoeuvres.Track`; `requests` to the board, with their times on the same clock."""

    rows: np.ndarray
    requests: List[Tuple[float, Frame]]


def read(path: str, model: RobotModel) -> Replayed:
    """Read a whole recording of this robot.

    Raises:
        ConfigError: the file cannot be read, belongs to another robot, holds no counts, or its counts jump.
    """
    recording = Recording(path)
    options = recording.header.get("options")
    if isinstance(options, dict):
        options["period_ms"] = SLOWEST_MS  # each frame counts, also those that no listener of that driver got
    recorded = RecordedDriver(recording, model)
    track = Track(recorded)
    requests: List[Tuple[float, Frame]] = []

    def on_sent(sent: Sent) -> None:
        if isinstance(sent.event, Frame):
            requests.append((recorded.now_s, sent.event))

    recorded.on_sent(on_sent)
    with progress(f"reading {os.path.basename(path)}", 1.0) as advance:
        recorded.play(advance)
    try:
        rows = track.rows()
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    if len(rows) < 2:
        raise ConfigError(
            f"{path} holds {len(rows)} readings of the counters, expected a recording of a drive"
        )
    if recorded.board.robot_id not in model.ids:
        raise ConfigError(
            f"{path} is a recording of robot id {recorded.board.robot_id}, expected a {model.name}"
        )
    return Replayed(rows, requests)


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
