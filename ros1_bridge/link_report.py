"""The link's state as diagnostics: a level, a line, keys and values.  Pure."""

import math
from typing import Dict, NamedTuple, Optional

from mrl_driver.handshake import Board
from mrl_driver.line_rate import SLOW
from mrl_driver.state import Telemetry
from mrl_driver.statistics import Statistics

OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostic_msgs/DiagnosticStatus."""


class Health(NamedTuple):
    """A level and the line that explains it."""

    level: int
    message: str


def error_count(statistics: Statistics) -> int:
    """Everything that went wrong on the link."""
    return (
        sum(statistics.garbage.values()) + statistics.lost + statistics.duplicates + statistics.refused_counts
        + statistics.unanswered + statistics.blocked_writes
    )  # fmt: skip


def health(ready: bool, age_s: float, slowed: bool = False) -> Health:
    """The link's health; `slowed` is one that was to be faster."""
    if not ready:
        return Health(ERROR, f"the board is silent for {age_s:.1f} s: check its cable and power")
    if slowed:
        return Health(WARN, f"streaming, but not at the higher speed, since {SLOW}")
    return Health(OK, "streaming")


def values(
    port: str, baud: int, board: Board, statistics: Statistics, age_s: float, telemetry: Optional[Telemetry]
) -> Dict[str, str]:
    """Keys and values, named as REP-138 does where it has a name.

    The latency is the last frame's way from the reading of its counters to the host, beyond the least there
    is; boards without a clock have none.
    """
    latency_ms = 1000 * (telemetry.arrival_s - telemetry.stamp_s) if telemetry else math.nan
    return {
        "Serial Port": port,
        "Serial Baud": str(baud),
        "Firmware Version": str(board.version),
        "Motor Board Version": f"{board.motor_board_version:.2f}",
        "Protocol Version": str(board.protocol),
        "Device ID": str(board.robot_id),
        "Computed Latency": f"{latency_ms:.2f} ms",
        "Capabilities": ", ".join(sorted(board.capabilities)) or "none",
        "Telemetry Age": f"{age_s * 1000:.0f} ms",
        "Errors": str(error_count(statistics)),
        "Frames": str(statistics.frames),
        "Lost Frames": str(statistics.lost),
        "Garbage": ", ".join(f"{name} {count}" for name, count in sorted(statistics.garbage.items()))
        or "none",
        "Refused Counts": str(statistics.refused_counts),
        "Unanswered Requests": str(statistics.unanswered),
        "Blocked Writes": str(statistics.blocked_writes),
        "Restarts": str(statistics.restarts),
        "Reconnects": str(statistics.reconnects),
        "Bytes Received": str(statistics.bytes_in),
        "Bytes Sent": str(statistics.bytes_out),
    }
