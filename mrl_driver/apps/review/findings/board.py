"""Findings that the board reports itself: faults, restarts, stops, its identity."""

from typing import Dict, List, NamedTuple, Tuple

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.problems import PROBLEMS
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import FAULTS

from .evidence import INFO, STATUS, heard, restarts, times
from .finding import Finding

REOPENED_S = 10.0
"""A board that restarts within this time after its port was opened was reset by that, as an Arduino Uno is [s]."""
SKIPPED = 5  # an encoder is noisy if this many of its transitions skip a state.  A clean one skips none.


class _Words(NamedTuple):
    kind: str
    title: str
    text: str
    weight: float


_FAULT_KINDS = {"imu": "imu_dead"}  # kinds of faults that differ from their names
_FAULT_WEIGHTS = {
    "motor_board": 95,
    "bus_hung": 95,
    "wiring": 94,
    "eeprom": 65,
    "id_unset": 60,
    "sensor": 55,
    "imu": 64,
}


def _words(kind: str, text: str, weight: float) -> _Words:
    return _Words(kind, PROBLEMS[kind].message, text, weight)


_RESTARTS = {
    "brown_out": _words(
        "brown_out", "The board reports the cause brown_out: its 5 V supply fell too low.", 91
    ),
    "watchdog": _words("firmware_hung", "The board reports the cause watchdog.", 91),
}
_RESTART = _words(
    "board_restart",
    "The board reports the cause {cause}. Somebody pressed reset, another program opened the port, or its power "
    "failed.",
    90,
)
_STOPS = {
    StopReason.LINK_WATCHDOG: _words(
        "watchdog_stop",
        "The board's watchdog stopped the robot {times}: no frame of the computer arrived in time.",
        52,
    ),
    StopReason.STALL: _words(
        "board_stalled", "The board stopped the robot {times} after a stall of its own.", 80
    ),
    StopReason.UNDERVOLTAGE: _words(
        "undervoltage", "The board stopped the robot {times} to protect the battery.", 87
    ),
    StopReason.WHEEL_BLOCKED: _words("wheel_blocked", "The board stopped the robot {times}.", 85),
    StopReason.ENCODER: _words("encoder_dead", "The board stopped the robot {times}.", 85),
}


def check(drive: DriveData) -> List[Finding]:
    """Return what the board reports."""
    return [*_identity(drive), *_faults(drive), *_restarts(drive), *_stops(drive), *_counters(drive)]


def _identity(drive: DriveData) -> List[Finding]:
    board, model = drive.board, drive.model
    if board is None or board.robot_id in model.ids:
        return []
    ids = ", ".join(map(str, model.ids))
    return [
        Finding(
            "wrong_robot",
            "The robot model is not that of the robot",
            f"The board has robot id {board.robot_id}; {model.name} has {ids}. Distances and speeds are wrong.",
            *heard(drive, 0.0, INFO),
            93,
        )
    ]


def _faults(drive: DriveData) -> List[Finding]:
    words, findings = dict(FAULTS), []
    for name, weight in _FAULT_WEIGHTS.items():
        seen = [time_s for time_s, status in drive.statuses if name in status.faults]
        if seen:
            kind = _FAULT_KINDS.get(name, name)
            text = f"The board reported it from {seen[0]:.1f} s to {seen[-1]:.1f} s."
            findings.append(
                Finding(kind, words[name].rstrip("."), text, *heard(drive, seen[0], STATUS), weight)
            )
    return findings


def _restarts(drive: DriveData) -> List[Finding]:
    found: Dict[str, Tuple[_Words, float]] = {}
    proof = (STATUS,) if drive.statuses else ()  # has the uptime and the cause; boards of 2013 have no status
    for time_s in restarts(drive):
        if any(0 <= time_s - opened_s <= REOPENED_S for opened_s, _ in drive.opened[1:]):
            continue
        cause = next((status.reset_cause for at, status in drive.statuses if at >= time_s), "unknown")
        words = _RESTARTS.get(cause, _RESTART)
        found.setdefault(words.kind, (words._replace(text=words.text.format(cause=cause)), time_s))
    return [
        Finding(words.kind, words.title, words.text, *heard(drive, time_s, *proof), words.weight)
        for words, time_s in found.values()
    ]


def _stops(drive: DriveData) -> List[Finding]:
    findings = []
    for reason, words in _STOPS.items():
        seen = [stop for stop in drive.stops if stop.reason == reason]
        if seen:
            text, first = words.text.format(times=times(len(seen))), seen[0]
            findings.append(
                Finding(*words[:2], text, first.time_s, first.direction, first.data, words.weight)
            )
    return findings


def _counters(drive: DriveData) -> List[Finding]:
    findings = []
    if len(drive.statuses) < 2:
        return []
    first, last = drive.statuses[0][1], drive.statuses[-1][1]
    skipped = (last.impossible or 0) - (first.impossible or 0)
    if skipped >= SKIPPED:
        at = next(
            t for t, each in drive.statuses if (each.impossible or 0) - (first.impossible or 0) >= SKIPPED
        )
        findings.append(
            Finding(
                "encoder_noise",
                "An encoder's signals are disturbed",
                f"{skipped} transitions skipped a state, which no wheel does: counts are lost or added.",
                *heard(drive, at, STATUS),
                70,
            )
        )
    clamped = last.clamped - first.clamped
    if clamped > 0:
        at = next(t for t, each in drive.statuses if each.clamped > first.clamped)
        findings.append(
            Finding(
                "clamped",
                "The board reduced commands to its speed ceiling",
                f"{clamped} commands were faster than the board allows.",
                *heard(drive, at, STATUS),
                20,
            )
        )
    return findings
