"""The state of the link as diagnostics: a level, a message, keys and values.  Pure."""

import math
from typing import Any, Dict, Mapping, NamedTuple, Optional

from mrl_driver.robot.hold import Hold
from mrl_driver.robot.inputs import Inputs
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.session import events
from mrl_driver.session.handshake import Board
from mrl_driver.session.link_counters import Counters
from mrl_driver.transport.baud_rates import SLOW

OK, WARN, ERROR = 0, 1, 2  # Levels of diagnostic_msgs/DiagnosticStatus


class Report(NamedTuple):
    """A level, the message that explains it, and keys with their values."""

    level: int
    message: str
    values: Mapping[str, str] = {}


class News:
    """Selects the driver's events that go to the log."""

    def __init__(self) -> None:
        self._lost = False
        self._hold = ""

    def of(self, event: Any) -> Optional[Report]:
        """Level and message; None for an event that is not logged."""
        if isinstance(event, events.Lost):
            self._lost = True
            return Report(ERROR, str(event))
        if isinstance(event, events.Reconnected):
            self._lost = False
            return Report(OK, str(event))
        if isinstance(event, events.Stale):
            then = events.MAY_MOVE if event.may_move else events.WAITS
            return Report(ERROR, f"the board is silent: check its cable and power; {then}")
        if isinstance(event, events.Ready) and not self._lost:
            if event.restarted and event.checked:  # unchecked: a restart is only assumed
                return Report(WARN, f"the board has restarted; {events.WAITS}")
            return Report(OK, "the board answers again")
        if isinstance(event, events.ImuChanged):
            return Report(OK if event.in_use else WARN, str(event))
        if isinstance(event, Hold):
            return self._of_hold(event)
        if isinstance(event, Inputs):
            return Report(ERROR if event.latched else WARN if event.active else OK, str(event))
        if isinstance(event, Mismatch):
            return Report(ERROR, f"{event}; the robot was stopped")
        return Report(WARN, str(event)) if isinstance(event, (events.Slowed, events.PathUnknown)) else None

    def _of_hold(self, hold: Hold) -> Optional[Report]:
        """A changed state; not changed counters."""
        if hold.state == self._hold:
            return None
        known, self._hold = bool(self._hold), hold.state
        level = ERROR if hold.state == "silent" else WARN if hold.held else OK
        return Report(level, str(hold)) if known or hold.held else None


def health(ready: bool, age_s: float, slowed: bool = False) -> Report:
    """Level and message of the link; `slowed`: the link runs below the requested baud rate."""
    if not ready:
        return Report(ERROR, f"the board is silent for {age_s:.1f} s: check its cable and power")
    if slowed:
        return Report(WARN, f"streaming, but not at the higher speed, since {SLOW}")
    return Report(OK, "streaming")


def values(
    port: str, baud: int, board: Board, statistics: Counters, age_s: float, telemetry: Optional[Telemetry]
) -> Dict[str, str]:
    """Keys and values; many names are those that ROS's laser drivers use too.

    The latency is the time from the reading of the last frame's counters to its arrival at the host, minus the
    shortest such time.  Boards without a clock have no latency.
    """
    version = board.motor_board_version
    garbage = ", ".join(f"{name} {count}" for name, count in sorted(statistics.garbage.items()))
    errors = (
        sum(statistics.garbage.values()) + statistics.lost + statistics.duplicates + statistics.refused_counts
        + statistics.unanswered + statistics.blocked_writes
    )  # fmt: skip
    latency = "not measured"
    if telemetry is not None and telemetry.sequence is not None:
        latency = f"{1000 * (telemetry.arrival_s - telemetry.stamp_s):.2f} ms"
    return {
        "Serial Port": port,
        "Serial Baud": str(baud),
        "Firmware Version": str(board.version),
        "Motor Board Version": "none" if math.isnan(version) else f"{version:.2f}",
        "Protocol Version": str(board.protocol),
        "Device ID": str(board.robot_id),
        "Computed Latency": latency,
        "Capabilities": ", ".join(sorted(board.capabilities)) or "none",
        "Telemetry Age": f"{age_s * 1000:.0f} ms",
        "Errors": str(errors),
        "Frames": str(statistics.frames),
        "Lost Frames": str(statistics.lost),
        "Garbage": garbage or "none",
        "Refused Counts": str(statistics.refused_counts),
        "Unanswered Requests": str(statistics.unanswered),
        "Blocked Writes": str(statistics.blocked_writes),
        "Dropped Texts": str(statistics.texts_dropped),
        "Restarts": str(statistics.restarts),
        "Uncommanded Motions": str(statistics.uncommanded_motions),
        "Reconnects": str(statistics.reconnects),
        "Bytes Received": str(statistics.bytes_in),
        "Bytes Sent": str(statistics.bytes_out),
    }
