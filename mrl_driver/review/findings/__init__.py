"""Finds what went wrong in a drive.  Each module knows one part of the robot; `find` puts their findings in order.

Causes weigh more than what follows from them: a board that restarts also loses its link.
"""

from typing import Callable, Dict, List, Tuple

from mrl_driver.review.drive_data import DriveData

from . import board, gyro, link, sonars, supply, wheels
from .finding import Finding

__all__ = ["Finding", "find"]

Check = Callable[[DriveData], List[Finding]]
_CHECKS: Tuple[Check, ...] = (
    board.check,
    supply.check,
    link.check,
    wheels.check,
    sonars.check,
    gyro.check,
)


_WHEELS = {"wheel_dead", "wheel_blocked", "encoder_dead", "wheel_reversed", "wheels_powerless"}
_BY_WHEELS = {"slip", "track_width", "wheel_ratio", "speed_scale", "wheel_slow"}
"""Findings that need wheels that turn and count."""
_SUPPLY = {"battery_low", "battery_empty", "battery_off", "undervoltage"}
_BY_SUPPLY = {"speed_scale", "wheel_slow"}
"""Findings that need motors with their voltage."""


def find(drive: DriveData) -> List[Finding]:
    """Return what went wrong in a drive, the most important first, each kind once; empty if nothing did."""
    found: Dict[str, Finding] = {}
    for finding in sorted(
        (each for check in _CHECKS for each in check(drive)), key=lambda each: -each.weight
    ):
        found.setdefault(finding.kind, finding)
    followed = set()
    for causes, others in ((_WHEELS, _BY_WHEELS), (_SUPPLY, _BY_SUPPLY)):
        followed |= others if causes & set(found) else set()
    return [each for each in found.values() if each.kind not in followed]
