"""Findings that the board reports itself: faults, restarts, stops, its identity."""

from typing import Dict, Iterator, Tuple

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import FAULTS

from .evidence import INFO, STATUS, Finding, finding, heard, restarts, times

REOPENED_S = 10.0
"""A board that restarts within this time after its port was opened was reset by that, as an Arduino Uno is [s]."""
SKIPPED = 5  # an encoder is noisy if this many of its transitions skip a state.  A clean one skips none.
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
_Words = Tuple[str, float, str]  # kind, weight and text of a finding
_RESTARTS: Dict[str, _Words] = {
    "brown_out": ("brown_out", 91, "The board reports the cause brown_out: its 5 V supply fell too low."),
    "watchdog": ("firmware_hung", 91, "The board reports the cause watchdog."),
}
_RESTART: _Words = (
    "board_restart",
    90,
    "The board reports the cause {cause}. Somebody pressed reset, another program opened the port, or its power "
    "failed.",
)
_WATCHDOG = "The board's watchdog stopped the robot {times}: no frame of the computer arrived in time."
_STOPS: Dict[StopReason, _Words] = {
    StopReason.LINK_WATCHDOG: ("watchdog_stop", 52, _WATCHDOG),
    StopReason.STALL: ("board_stalled", 80, "The board stopped the robot {times} after a stall of its own."),
    StopReason.UNDERVOLTAGE: (
        "undervoltage",
        87,
        "The board stopped the robot {times} to protect the battery.",
    ),
    StopReason.BUMPER: ("bumper_hit", 60, "The board stopped the robot {times}."),
    StopReason.CLIFF: ("cliff", 60, "The board stopped the robot {times}."),
    StopReason.EMERGENCY_STOP: ("emergency_stop", 60, "The board stopped the robot {times}."),
    StopReason.WHEEL_BLOCKED: ("wheel_blocked", 85, "The board stopped the robot {times}."),
    StopReason.ENCODER: ("encoder_dead", 85, "The board stopped the robot {times}."),
}


def check(drive: DriveData) -> Iterator[Finding]:
    """Return what the board reports."""
    for part in (_identity, _faults, _restarts, _stops, _counters):
        yield from part(drive)


def _identity(drive: DriveData) -> Iterator[Finding]:
    board, model = drive.board, drive.model
    if board is not None and board.robot_id not in model.ids:
        ids = ", ".join(map(str, model.ids))
        text = f"The board has robot id {board.robot_id}; {model.name} has {ids}. Distances and speeds are wrong."
        title = "The robot model is not that of the robot"
        yield finding("wrong_robot", 93, text, heard(drive, 0.0, INFO), title=title)


def _faults(drive: DriveData) -> Iterator[Finding]:
    words = dict(FAULTS)
    for name, weight in _FAULT_WEIGHTS.items():
        seen = [time_s for time_s, status in drive.statuses if name in status.faults]
        if seen:
            text = f"The board reported it from {seen[0]:.1f} s to {seen[-1]:.1f} s."
            proof, title = heard(drive, seen[0], STATUS), words[name].rstrip(".")
            yield finding(_FAULT_KINDS.get(name, name), weight, text, proof, title=title)


def _restarts(drive: DriveData) -> Iterator[Finding]:
    kinds = set()
    proof = (STATUS,) if drive.statuses else ()  # has the uptime and the cause; boards of 2013 have no status
    for time_s in restarts(drive):
        if any(0 <= time_s - opened_s <= REOPENED_S for opened_s, _ in drive.opened[1:]):
            continue
        cause = next((status.reset_cause for at, status in drive.statuses if at >= time_s), "unknown")
        kind, weight, text = _RESTARTS.get(cause, _RESTART)
        if kind not in kinds:
            kinds.add(kind)
            yield finding(kind, weight, text.format(cause=cause), heard(drive, time_s, *proof))


def _stops(drive: DriveData) -> Iterator[Finding]:
    for reason, (kind, weight, text) in _STOPS.items():
        seen = [stop for stop in drive.stops if stop.reason == reason]
        if seen:
            yield finding(kind, weight, text.format(times=times(len(seen))), seen[0].frame)


def _counters(drive: DriveData) -> Iterator[Finding]:
    """Counters of the status that have grown since the first one."""
    if not drive.statuses:
        return
    first = drive.statuses[0][1]
    skipped = [(at, (each.impossible or 0) - (first.impossible or 0)) for at, each in drive.statuses]
    if skipped[-1][1] >= SKIPPED:
        text = f"{skipped[-1][1]} transitions skipped a state, which no wheel does: counts are lost or added."
        at_s = next(at for at, count in skipped if count >= SKIPPED)
        yield finding("encoder_noise", 70, text, heard(drive, at_s, STATUS))
    clamped = [(at, each.clamped - first.clamped) for at, each in drive.statuses]
    if clamped[-1][1] > 0:
        at_s = next(at for at, count in clamped if count > 0)
        text = f"{clamped[-1][1]} commands were faster than the board allows."
        yield finding("clamped", 20, text, heard(drive, at_s, STATUS))
