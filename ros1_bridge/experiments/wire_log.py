"""Reads the log of bytes at an emulated board's port, and computes their delays from and to topics.

Pure, apart from reading files.  All times are the host's monotonic clock.
"""

import json
import re
import statistics
from pathlib import Path
from typing import Dict, List, NamedTuple, Sequence

from mrl_driver.protocol.table import BY_NAME
from sim_arduino.board.uart import IN_BYTE_S

_MOVE = re.compile(rb"@%d,(-?\d+),[^@e]*e" % BY_NAME["move_differential"].code)
_STREAMED = b"@%d," % BY_NAME["read_encoders_and_sonars"].code


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
