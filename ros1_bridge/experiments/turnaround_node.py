"""The node that measures the delay between a board and a topic, in both directions.

An emulated board in its own process logs the bytes at its port with their times.  This node records when it published
each command, and when each Odometry message came.
"""

import json
import re
import statistics
import time
from pathlib import Path
from typing import Dict, List, NamedTuple, Sequence

from mrl_driver.protocol.table import BY_NAME
from sim_arduino.board.uart import IN_BYTE_S
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.turnaround import Topics

from .legs import Parts
from .one_robot_node import ROBOT, OdometryRobot, wait_for

_MOVE = re.compile(rb"@%d,(-?\d+),[^@e]*e" % BY_NAME["move_differential"].code)
_STREAMED = b"@%d," % BY_NAME["read_encoders_and_sonars"].code
RATE_HZ, MESSAGES = 50, 200
FASTEST_MM_S = 300
RAMP_S, TICK_S = 1.5, 0.05
"""The robot reaches its speed within the ramp time; later, slower commands are not limited."""
SETTLE_S = 0.3


def _send(robot: OdometryRobot, messages: int) -> Dict[int, float]:
    """Sends commands, each slower than the last, so that it can be identified: speed [mm/s] to time [s, monotonic]."""
    published = {}
    for speed_mm_s in range(FASTEST_MM_S - 1, FASTEST_MM_S - 1 - messages, -1):
        published[speed_mm_s] = time.monotonic()
        robot.drive(speed_mm_s / 1000, 0.0)
        time.sleep(1.0 / RATE_HZ)
    time.sleep(SETTLE_S)
    return published


def measure(parts: Parts, setting: Setting, messages: int = MESSAGES) -> Topics:
    """Drives a board through topics, in the driver's default mode; the delays [ms].  MrlError if a part fails."""
    log, truth = parts.folder / "wire.json", parts.folder / "truth.json"
    parts.robot(ROBOT, setting.robot, RATE_HZ, "--world", "square", "--log", str(log), "--truth", str(truth))
    arrived: List[float] = []
    robot = wait_for(parts, then=lambda _: arrived.append(time.monotonic()))
    for _ in range(round(RAMP_S / TICK_S)):
        robot.drive(FASTEST_MM_S / 1000, 0.0)
        time.sleep(TICK_S)
    arrived.clear()
    published = _send(robot, messages)
    rows = read(log, truth)
    commands = commanded(rows, min(published.values()))
    return Topics(1000 * odometry_s(sent(rows), arrived), 1000 * command_s(published, commands))


# -- the log of bytes at the board's port; all times are the monotonic clock of the host


class Passed(NamedTuple):
    """Bytes at the port, sent by `host` or `board`."""

    at_s: float
    who: str
    data: bytes


def read(log: Path, truth: Path) -> List[Passed]:
    """The log of `mrl-sim --log`; the file of `--truth` from the same run gives the offset to monotonic time."""
    with truth.open(encoding="utf-8") as file:
        row = json.loads(file.readline())
    start_s = row["host_monotonic"] - row["t"]
    with log.open(encoding="utf-8") as file:
        rows = [json.loads(line) for line in file if line.endswith("\n")]
    return [Passed(start_s + row["t"], row["from"], row["bytes"].encode("latin-1")) for row in rows]


def sent(rows: Sequence[Passed]) -> List[float]:
    """Times at which the frames with counters left the board [s]."""
    return [row.at_s for row in rows if row.who == "board" and _STREAMED in row.data]


def commanded(rows: Sequence[Passed], since_s: float) -> Dict[int, float]:
    """Speed [mm/s] to the time at which the motor board first had it [s], the end of its frame on the wire."""
    found: Dict[int, float] = {}
    for row in rows:
        if row.who == "host" and row.at_s >= since_s:
            for frame in _MOVE.finditer(row.data):
                found.setdefault(int(frame.group(1)), row.at_s + frame.end() * IN_BYTE_S)
    return found


def odometry_s(frames_s: Sequence[float], arrived_s: Sequence[float]) -> float:
    """Median time from a frame to its Odometry message [s]; a message belongs to the last frame before it."""
    delays_s = (at - max(each for each in frames_s if each <= at) for at in arrived_s)
    return statistics.median(delays_s)


def command_s(published_s: Dict[int, float], commanded_s: Dict[int, float]) -> float:
    """Median time from publishing a speed until the motor board has it [s].

    Speeds that the board never received, because a later one replaced them, do not count.
    """
    return statistics.median(
        commanded_s[speed] - at for speed, at in published_s.items() if speed in commanded_s
    )
