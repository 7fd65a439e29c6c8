"""Findings that the board reports itself: faults, restarts, stops, its identity."""

from typing import Dict, List, NamedTuple, Tuple

from mrl_driver.protocol.table import FAULTS
from mrl_driver.review.drive_data import DriveData

from .evidence import INFO, STATUS, heard, restarts, times
from .finding import Finding

REOPENED_S = 10.0
"""A board that restarts within this time after its port was opened was reset by that, as an Arduino Uno is [s]."""
SKIPPED = 5
"""An encoder is noisy if this many of its transitions skip a state.  A clean one skips none."""


class _Words(NamedTuple):
    kind: str
    title: str
    text: str
    remedy: str
    weight: float


_REMEDIES: Dict[str, Tuple[str, float]] = {
    "motor_board": ("Check the power of the motor board, and its I2C wires on A4 (SDA) and A5 (SCL).", 95),
    "bus_hung": (
        "A device holds the I2C bus: check the wires on A4 (SDA) and A5 (SCL), then switch power off and on.",
        95,
    ),
    "wiring": ("Run: mrl calibrate wiring", 94),
    "eeprom": ("Set the robot's own parameters again: mrl config set NAME VALUE", 65),
    "id_unset": ("Run: mrl set-id ID", 60),
    "sensor": ("Check the I2C wires and the power of the sensors.", 55),
    "imu": ("Check the IMU's wires on A4 (SDA) and A5 (SCL), and its power.", 64),
}
_RESTARTS = {
    "brown_out": _Words(
        "brown_out",
        "The board restarted because its supply dropped",
        "The board reports the cause brown_out: its 5 V supply fell too low.",
        "Check USB cable and hub, and every other load on the board's 5 V.",
        91,
    ),
    "watchdog": _Words(
        "firmware_hung",
        "The board's firmware hung and restarted",
        "The board reports the cause watchdog.",
        "Report it with: mrl doctor --report",
        91,
    ),
}
_RESTART = _Words(
    "board_restart",
    "The board restarted while it was in use",
    "The board reports the cause {cause}. Somebody pressed reset, another program opened the port, or its power "
    "failed.",
    "Check power and USB plug, and let no second program open the port.",
    90,
)
_STOPS = {
    "link_watchdog": _Words(
        "watchdog_stop",
        "The board stopped the robot because it received nothing",
        "The board's watchdog stopped the robot {times}: no frame of the computer arrived in time.",
        "Check the link to the board, and close programs that keep the computer busy.",
        52,
    ),
    "stall": _Words(
        "board_stalled",
        "The board was busy for too long",
        "The board stopped the robot {times} after a stall of its own.",
        "Check the I2C wires and devices.",
        80,
    ),
    "undervoltage": _Words(
        "undervoltage",
        "The battery fell below the parameter undervoltage",
        "The board stopped the robot {times} to protect the battery.",
        "Charge the battery, or correct the parameter.",
        87,
    ),
    "wheel_blocked": _Words(
        "wheel_blocked",
        "A wheel did not turn at full drive",
        "The board stopped the robot {times}.",
        "Check that the wheels turn freely, and the motor's wires.",
        85,
    ),
    "encoder": _Words(
        "encoder_dead",
        "An encoder was silent or counted the other direction",
        "The board stopped the robot {times}.",
        "Check the encoder's wires, then run: mrl calibrate wiring",
        85,
    ),
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
            "Name the right model with --robot, or set the id with: mrl set-id ID",
            *heard(drive, 0.0, INFO),
            93,
        )
    ]


def _faults(drive: DriveData) -> List[Finding]:
    words, findings = dict(FAULTS), []
    for name, (remedy, weight) in _REMEDIES.items():
        seen = [time_s for time_s, status in drive.statuses if name in status.faults]
        if seen:
            kind = "imu_dead" if name == "imu" else name
            text = f"The board reported it from {seen[0]:.1f} s to {seen[-1]:.1f} s."
            findings.append(
                Finding(kind, words[name].rstrip("."), text, remedy, *heard(drive, seen[0], STATUS), weight)
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
        Finding(
            words.kind, words.title, words.text, words.remedy, *heard(drive, time_s, *proof), words.weight
        )
        for words, time_s in found.values()
    ]


def _stops(drive: DriveData) -> List[Finding]:
    findings = []
    for reason, words in _STOPS.items():
        seen = [stop for stop in drive.stops if stop.reason == reason]
        if seen:
            text, first = words.text.format(times=times(len(seen))), seen[0]
            findings.append(
                Finding(
                    *words[:2], text, words.remedy, first.time_s, first.direction, first.data, words.weight
                )
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
                "Lead the encoder's wires away from the motor's, twist or shield them, and check their plugs.",
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
                "Command lower speeds, or raise linear_ceiling with: mrl config set",
                *heard(drive, at, STATUS),
                20,
            )
        )
    return findings
