"""Recorded key presses: reads them from a file, and drives a robot with them."""

import csv
import io
from typing import Callable, List, NamedTuple, Sequence

from mrl_driver.errors import ConfigError
from mrl_driver.files import read_plain
from mrl_driver.terminal.teleop_keys import HOLD_S, Teleop
from mrl_driver.yaml_file import short

from .experiment_robot import TICK_S, ExperimentRobot

COLUMNS = ["time_s", "key"]
_LONGEST = 1 << 22  # longest file read [byte]: more than a day of presses


class KeyPress(NamedTuple):
    """One press of a key, at a time since the start of the recording [s]."""

    time_s: float
    key: str


def read(path: str) -> List[KeyPress]:
    """The presses in a CSV file with the columns `time_s` and `key`, in the order of their times.

    Raises:
        ConfigError: the file cannot be opened, a line is wrong, or a time is before the one above.
    """
    try:
        text = read_plain(path, _LONGEST).decode("utf-8-sig")
        rows = list(csv.reader(io.StringIO(text, newline="")))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(
            f"{path}: {getattr(error, 'strerror', error)}, expected recorded key presses"
        ) from None
    if not rows or rows[0] != COLUMNS:
        raise ConfigError(f"{path}: begins with {short(rows[:1])}, expected the columns {','.join(COLUMNS)}")
    presses: List[KeyPress] = []
    for number, row in enumerate(rows[1:], 2):
        presses.append(_press(f"{path}, line {number}", row, presses[-1].time_s if presses else 0.0))
    return presses


def _press(where: str, row: Sequence[str], since_s: float) -> KeyPress:
    try:
        time_text, key = row
        press = KeyPress(float(time_text), key)
    except ValueError:
        raise ConfigError(f"{where}: {short(','.join(row))}, expected a time [s] and a key") from None
    if not since_s <= press.time_s < float("inf"):
        raise ConfigError(f"{where}: time {press.time_s:g}, expected {since_s:g} s or later")
    if key != "space" and not Teleop.moves(key):
        raise ConfigError(f"{where}: key {short(key)}, expected up, down, left, right, w, a, s, d or space")
    return press


def replay(robot: ExperimentRobot, presses: Sequence[KeyPress], each_tick: Callable[[], None]) -> None:
    """Drive as the keys say, until the last press has ended; calls `each_tick` at each tick.

    Raises:
        BoardTimeout: the robot does not accept a command.
    """
    teleop, waiting, start_s = Teleop(), list(reversed(presses)), robot.driver.now_s
    end_s = (presses[-1].time_s if presses else 0.0) + HOLD_S
    now_s = 0.0
    while now_s <= end_s:
        while waiting and waiting[-1].time_s < now_s + TICK_S / 2:  # the nearest tick, whatever is rounded
            teleop.press(waiting.pop().key, now_s)
        robot.drive(*teleop.command(now_s))
        robot.wait(TICK_S)
        each_tick()
        now_s = robot.driver.now_s - start_s
    robot.drive(0.0, 0.0)
