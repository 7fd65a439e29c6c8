"""What all findings use: the finding itself, the frame at a moment, times of a working link, the command in force."""

import math
from typing import Any, List, NamedTuple, Tuple

import numpy as np

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.problems import PROBLEMS
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.recording.recording import FROM_BOARD
from mrl_driver.session.events import Ready, Stale
from mrl_driver.session.session import SAME_BOOT_S, STALE_S

STATUS, INFO, IMU = (BY_NAME[name].code for name in ("read_status", "robot_info", "read_imu"))
TELEMETRY = tuple(row.code for row in BY_NAME.values() if row.stamped and row.code != IMU)
FED_S = 0.25
"""Without a frame for longer than this, the board's watchdog has stopped the robot, by default [s]."""
SETTLING_S = 0.5  # after a silence and after each greeting, the data may still be odd for this time [s]


class Finding(NamedTuple):
    """One thing that went wrong, in words for newcomers, and the frame that proves it."""

    kind: str  # code of the row in `problems`, such as `sonar_dead`; the same in all versions
    title: str  # what went wrong, in a few words
    text: str  # what was seen, with figures, and what it means
    time_s: float  # the moment [s since the recording began]
    direction: str  # direction of the frame: `>` to the board, `<` from it; empty without a frame
    data: bytes  # the frame, or the piece of data that is not one; empty if there is none
    weight: float  # how much it matters: findings are sorted by it, the heaviest first

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return PROBLEMS[self.kind].advice


def finding(
    kind: str, weight: float, text: str, frame: Tuple[float, str, bytes], part: str = "", title: str = ""
) -> Finding:
    """Return a finding; its title is the message of its row in `problems`, about this wheel or sonar, if none is given.

    `frame` is moment, direction and data of the frame that proves it.
    """
    title = title or PROBLEMS[kind].message.replace("SIDE", part).replace("NAME", part)
    return Finding(kind, title, text, *frame, weight)


def heard(drive: DriveData, time_s: float, *codes: int) -> Tuple[float, str, bytes]:
    """Return moment, direction and bytes of the frame from the board at a time, for a `Finding`."""
    return float(time_s), FROM_BOARD, drive.heard.at(float(time_s), *codes)


def ready_s(drive: DriveData) -> float:
    """Return the time of the first greeting's end; the first telemetry's if the recording begins later."""
    times = [time_s for time_s, event in drive.events if isinstance(event, Ready)]
    times += [float(each) for each in drive.poses.time_s[:1]]
    return min(times, default=math.inf)


def interruptions(drive: DriveData) -> List[Tuple[float, float]]:
    """Return begin and end of each time in which the link was down, opened, greeted or not recorded, with `SETTLING_S`
    around it.
    """
    found = [(-math.inf, ready_s(drive)), *((gap.begin_s, gap.end_s) for gap in drive.gaps)]
    greeted = sorted(time_s for time_s, event in drive.events if isinstance(event, Ready))
    begun = [time_s for time_s, _ in drive.opened]
    begun += [time_s - STALE_S for time_s, event in drive.events if isinstance(event, Stale)]
    for time_s in begun:
        found.append((time_s, next((end_s for end_s in greeted if end_s >= time_s), math.inf)))
    found += [(time_s - STALE_S, time_s) for time_s in greeted]
    return [(begin_s - SETTLING_S, end_s + SETTLING_S) for begin_s, end_s in found]


def restarts(drive: DriveData, ran_on: bool = False) -> List[float]:
    """Return when the board was ready again after a restart, or, with `ran_on`, after one that its uptime denies: the
    driver takes a board that was up for less than 3 s for restarted.
    """
    ready = [time_s for time_s, event in drive.events if isinstance(event, Ready) and event.restarted]
    begun = [(time_s, time_s - status.uptime_s) for time_s, status in drive.statuses]
    found = []
    for time_s in ready:
        before = [boot_s for at_s, boot_s in begun if at_s < time_s - STALE_S]
        after = [boot_s for at_s, boot_s in begun if at_s > time_s + SETTLING_S]
        same = bool(before and after) and abs(before[-1] - after[0]) < SAME_BOOT_S
        if same == ran_on and (before or time_s > ready[0]):
            found.append(time_s)
    return found


def outside(times_s: Any, intervals: List[Tuple[float, float]]) -> Any:
    """Return which times are in none of the intervals, as an array of bool."""
    times_s = np.asarray(times_s, dtype=float)
    free = np.ones(len(times_s), dtype=bool)
    for begin_s, end_s in intervals:
        free &= (times_s < begin_s) | (times_s > end_s)
    return free


def command_at(drive: DriveData, times_s: Any) -> Any:
    """Return the command in force just before some times, array `(N, 3)`; zeros before the first one, and after `FED_S`
    without a frame to the board.
    """
    commands, fed = drive.commands, np.frombuffer(drive.sent.times_s, dtype=float)
    asked = np.vstack([np.zeros((1, 3)), commands.values])
    found = asked[np.searchsorted(commands.time_s, times_s)]
    last = np.concatenate([[-math.inf], fed])[np.searchsorted(fed, times_s)]
    found[np.asarray(times_s) - last > FED_S] = 0.0
    return found


def runs(mask: Any) -> List[Tuple[int, int]]:
    """Return first index and end of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(first), int(end)) for first, end in zip(edges[::2], edges[1::2])]


def times(count: int) -> str:
    """Return `once`, or `n times`."""
    return "once" if count == 1 else f"{count} times"
