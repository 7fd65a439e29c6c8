"""Reads recordings for calibrations: counts of the wheels, ranges of the front sonar, requests to the motors."""

import itertools
import math
import os
from typing import Iterator, List, Tuple

import numpy as np

from mrl_driver.cli.commands.progress import progress
from mrl_driver.driver.recorded import RecordedDriver, Sent
from mrl_driver.driver.robot_core import SLOWEST_MS
from mrl_driver.errors import ConfigError
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.recording.recording import Recording
from mrl_driver.robot.models import RobotModel

from .manoeuvres import MOVE, Track

_MOVING = {BY_NAME[name].code for name in ("move_motors_pid", "move_motors", "move_differential", "stop")}
Requests = List[Tuple[float, Frame]]  # to the board, and when they were sent [s]


def read(path: str, model: RobotModel) -> Tuple[np.ndarray, Requests]:
    """Read a whole recording of this robot: rows as of `Track`, and the requests, with times of the same clock.

    Raises:
        ConfigError: the file cannot be read, belongs to another robot, holds no counts, or its counts jump.
    """
    recording = Recording(path)
    options = recording.header.get("options")
    if isinstance(options, dict):
        options["period_ms"] = SLOWEST_MS  # each frame counts, also those that no listener of that driver got
    recorded = RecordedDriver(recording, model)
    track = Track(recorded)
    requests: Requests = []

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
    if recorded.board.virtual != model.virtual:
        kinds = ("a virtual robot", "true") if recorded.board.virtual else ("a real robot", "false")
        raise ConfigError(
            f"{path} is a recording of {kinds[0]}, expected a --robot whose file has virtual: {kinds[1]}"
        )
    return rows, requests


def motor_steps(path: str, model: RobotModel) -> Iterator[Tuple[np.ndarray, Tuple[int, int]]]:
    """Rows, and percents left and right, of each step of the duty; the next other request to the motors ends a step."""
    rows, requests = read(path, model)
    orders = [(time_s, frame) for time_s, frame in requests if frame.code in _MOVING]
    runs = [next(same) for _, same in itertools.groupby(orders, lambda order: (order[1].code, order[1].args))]
    ends_s = [time_s for time_s, _ in runs[1:]] + [math.inf]
    for (begin_s, frame), end_s in zip(runs, ends_s):
        if frame.code == MOVE and any(frame.args):
            first = max(0, int(np.searchsorted(rows[:, 0], begin_s)) - 1)
            last = int(np.searchsorted(rows[:, 0], end_s))
            if first < last:
                yield rows[first:last], (frame.args[0], frame.args[1])
