"""What an emulated board noted of the bytes at its port, and how long they took from and to topics.

Pure but for reading files; times are the host's monotonic ones.
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
    """Bytes that passed the port: from the `host`, or from the `board`."""

    at_s: float
    who: str
    data: bytes


def read(log: Path, truth: Path) -> List[Passed]:
    """The log of `mrl-sim --log`, its times made monotonic by the file of `--truth` that was written beside it."""
    with truth.open(encoding="utf-8") as file:
        row = json.loads(file.readline())
    start_s = row["host_monotonic"] - row["t"]
    with log.open(encoding="utf-8") as file:
        rows = [json.loads(line) for line in file if line.endswith("\n")]
    return [Passed(start_s + row["t"], row["from"], row["bytes"].encode("latin-1")) for row in rows]


def sent(rows: Sequence[Passed]) -> List[float]:
    """When each frame with counters left the board [s]."""
    return [row.at_s for row in rows if row.who == "board" and _STREAMED in row.data]


def commanded(rows: Sequence[Passed], since_s: float) -> Dict[int, float]:
    """When the motor board had each speed first [s]: speed [mm/s] to the end of its frame on the wire."""
    found: Dict[int, float] = {}
    for row in rows:
        if row.who == "host" and row.at_s >= since_s:
            for frame in _MOVE.finditer(row.data):
                found.setdefault(int(frame.group(1)), row.at_s + frame.end() * IN_BYTE_S)
    return found


def odometry_s(frames_s: Sequence[float], arrived_s: Sequence[float]) -> float:
    """Median time from a frame to the Odometry that it brought [s]; a message belongs to the frame just before it."""
    ways = (at - max(each for each in frames_s if each <= at) for at in arrived_s)
    return statistics.median(ways)


def command_s(published_s: Dict[int, float], commanded_s: Dict[int, float]) -> float:
    """Median time from publishing a speed to the motor board that has it [s]; those overtaken by later ones do not
    count."""
    return statistics.median(
        commanded_s[speed] - at for speed, at in published_s.items() if speed in commanded_s
    )
