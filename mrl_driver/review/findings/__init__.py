"""Finds what went wrong in a drive.  Each module knows one part of the robot; `find` puts their findings in order."""

from typing import Callable, List, Tuple

from mrl_driver.review.drive_data import DriveData

from .finding import Finding

__all__ = ["Finding", "find"]

Check = Callable[[DriveData], List[Finding]]
_CHECKS: Tuple[Check, ...] = ()


def find(drive: DriveData) -> List[Finding]:
    """Return what went wrong in a drive, the most important first; empty if nothing did."""
    return sorted((each for check in _CHECKS for each in check(drive)), key=lambda each: -each.weight)
