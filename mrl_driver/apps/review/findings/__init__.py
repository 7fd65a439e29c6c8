"""Finds what went wrong in a drive.  Each module knows one part of the robot; `find` puts their findings in order.

Causes weigh more than what follows from them: a board that restarts also loses its link.
"""

from typing import Dict, List

from mrl_driver.apps.review.drive_data import DriveData

from . import board, distances, gyro, link, sonars, supply, wheels
from .evidence import Finding

__all__ = ["Finding", "find"]

_PARTS = (board, supply, link, gyro)
_BY_WHEELS = (wheels, sonars, distances)
"""Those that need odometry."""
_FOLLOWS = (
    (
        "wheel_dead wheel_blocked encoder_dead wheel_reversed wheels_powerless",
        "slip track_width wheel_ratio speed_scale wheel_slow wheel_size",
    ),
    ("battery_low battery_empty battery_off undervoltage", "speed_scale wheel_slow"),
    (
        "slip pushing link_lost board_silent sonar_stuck board_restart brown_out firmware_hung",
        "wheel_size",
    ),
    ("pushing", "sonar_stuck"),
    ("motor_board bus_hung", "board_silent"),
    ("line_stalled late_host", "speed_scale"),
    ("speed_scale", "wheel_size track_width"),
    ("wheel_size", "track_width"),
    ("bad_cable noise_bursts", "requests_lost requests_late frames_lost"),
)
"""If one of the first findings is there, the second ones follow from it, or cannot be judged: wheels must turn and
count, motors need their voltage, telemetry needs the motor board, speeds need commands in time, distances need a
whole path, the wheel size changes the turns too, and a cable that damages frames also loses them."""


def find(drive: DriveData) -> List[Finding]:
    """Return what went wrong in a drive, the most important first, each kind once; empty if nothing did."""
    found: Dict[str, Finding] = {}
    parts = (*_PARTS, *(_BY_WHEELS if drive.model.has_odometry else ()))
    seen = (each for part in parts for each in part.check(drive))
    for finding in sorted(seen, key=lambda each: -each.weight):
        found.setdefault(finding.kind, finding)
    for causes, others in _FOLLOWS:
        if set(causes.split()) & set(found):
            found = {kind: each for kind, each in found.items() if kind not in others.split()}
    return list(found.values())
