"""Findings about the wheels by their counters: dead, blocked, reversed, slower or faster than asked."""

from typing import Any, Iterator, Optional, Tuple

import numpy as np

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.robot.models import Drive
from mrl_driver.safety.wheel_monitor import FAST, POWERLESS, REVERSED, Mismatch

from .evidence import TELEMETRY, Finding, command_at, finding, heard, interruptions, outside, runs

SETTLED_S = 0.5  # a wheel has its speed this long after the end of the ramp [s]
LEAST_M_S, LEAST_M = 0.05, 0.3
"""Speed and distance of a wheel from which its speed is compared with the one asked for [m/s m]."""
WRONG_SHARE, SLOW_SHARE = 0.05, 0.1
"""Both wheels differ from what was asked by more than this: geometry in the board or in the model is wrong, because the
board's speed control has no error that stays; each geometry is known to 1 %.  One wheel is weak if it lacks twice that.
"""
TURN_SHARE = 0.3
"""The gyro's rate agrees with a blocked wheel to this share of the rate that the other wheel alone gives."""


def check(drive: DriveData) -> Iterator[Finding]:
    """Return what is wrong with the wheels."""
    if len(drive.poses.time_s) < 2 or not len(drive.commands.time_s):
        return
    for time_s, event in drive.events:
        if isinstance(event, Mismatch) and event.wheel:  # otherwise `board` has found the board's stop
            kind, title, why = _cause(drive, time_s, event)
            text = f"The {event}. {why}".strip()
            yield finding(kind, 85, text, heard(drive, time_s, *TELEMETRY), title=title)
            return
    yield from _speeds(drive)


def _cause(drive: DriveData, time_s: float, mismatch: Mismatch) -> Tuple[str, str, str]:
    """Kind, title and reason of a mismatch; the gyro tells a dead encoder from a blocked wheel."""
    wheel = mismatch.wheel
    name = f"The {wheel} wheel" if wheel not in ("both", "several") else "The wheels"
    if mismatch.cause == POWERLESS:
        return "wheels_powerless", "No wheel turned", ""
    if mismatch.cause == REVERSED:
        return "wheel_reversed", f"{name} counted against its command", ""
    if mismatch.cause == FAST:
        return "speed_scale", f"{name} ran faster than asked", ""
    blocked = _is_blocked(drive, time_s, wheel)
    if blocked is None:
        return "wheel_dead", f"{name} did not count", ""
    if blocked:
        why = "The gyro shows that the robot turned about this wheel: it stood still."
        return "wheel_blocked", f"{name} was blocked or without power", why
    why = "The gyro shows that the robot did not turn about this wheel: it moved without being counted."
    return "encoder_dead", f"The {wheel} encoder was dead", why


def _is_blocked(drive: DriveData, time_s: float, wheel: str) -> Optional[bool]:
    """Whether the body turns about this wheel; None if the gyro does not tell."""
    if wheel not in ("right", "left") or not isinstance(drive.model.drive, Drive):
        return None
    window = (drive.imu.time_s > time_s - 0.25) & (drive.imu.time_s <= time_s)
    moved = (drive.poses.time_s > time_s - 0.25) & (drive.poses.time_s <= time_s)
    known = window & ~np.isnan(drive.imu.values[:, 4])
    if known.sum() < 3 or moved.sum() < 3:
        return None
    other = 1 if wheel == "right" else 0
    counts, times_s = drive.counts.values[moved, other], drive.counts.time_s[moved]
    speed_m_s = (counts[-1] - counts[0]) / (times_s[-1] - times_s[0]) * drive.model.drive.metres_per_count
    sign = 1.0 if other == 0 else -1.0
    turning = sign * speed_m_s / drive.model.drive.turning_separation_m
    if abs(turning) < 0.1:
        return None
    measured = float(np.mean(drive.imu.values[known, 0]))
    return abs(measured - turning) < TURN_SHARE * abs(turning)


def _speeds(drive: DriveData) -> Iterator[Finding]:
    """Compare the speeds of each wheel with those asked for, while they are constant."""
    base = drive.model.drive
    if not isinstance(base, Drive):
        return
    times_s, stamps_s = drive.poses.time_s, drive.stamps_s
    metres = np.array([base.right_m_per_count, base.left_m_per_count])
    asked = command_at(drive, times_s)
    steady = outside(times_s, interruptions(drive)) & np.any(asked != 0.0, axis=1)
    ramp_s = drive.model.board["ramp_time"] / 1000
    half_m = 0.5 * base.wheel_separation_m
    wheels = np.stack([asked[:, 0] + half_m * asked[:, 1], asked[:, 0] - half_m * asked[:, 1]], axis=1)
    driven_m, asked_m, at_s = np.zeros(2), np.zeros(2), np.full(2, np.nan)
    changes = np.append(True, np.any(np.diff(asked, axis=0) != 0.0, axis=1))
    last = np.maximum.accumulate(np.where(changes, np.arange(len(times_s)), 0))
    full_m_s = drive.model.board["linear_ceiling"] / 1000
    before = np.abs(wheels - np.where(last[:, None] > 0, wheels[last - 1], 0.0)).max(axis=1)
    steady &= times_s - times_s[last] > before / full_m_s * ramp_s + SETTLED_S
    for first, end in runs(steady):
        if end - first < 3:
            continue
        moved = (drive.counts.values[end - 1] - drive.counts.values[first])[:2] * metres
        wanted = wheels[first] * (stamps_s[end - 1] - stamps_s[first])
        quick = np.abs(wheels[first]) >= LEAST_M_S
        if np.any(wheels[first:end] != wheels[first]):
            continue
        sign = np.sign(wheels[first])
        driven_m += np.where(quick, moved * sign, 0.0)
        asked_m += np.where(quick, wanted * sign, 0.0)
        at_s = np.where(np.isnan(at_s) & quick, times_s[end - 1], at_s)
    if np.all(asked_m >= LEAST_M):
        yield from _wrong_speeds(driven_m / asked_m, heard(drive, float(np.nanmin(at_s)), *TELEMETRY))


def _wrong_speeds(ratios: Any, frame: Tuple[float, str, bytes]) -> Iterator[Finding]:
    right, left = (float(each) for each in ratios)
    if abs(right - left) < WRONG_SHARE and abs(0.5 * (right + left) - 1.0) > WRONG_SHARE:
        text = (
            f"By its wheels it drove {0.5 * (right + left):.0%} of the speed asked for: wheel size, gearbox or "
            "encoder counts in the board differ from those of the robot model."
        )
        yield finding("speed_scale", 62, text, frame)
    elif min(right, left) < 1.0 - SLOW_SHARE:
        slow = "right" if right <= left else "left"
        text = f"It reached {min(right, left):.0%} of its speed, the other wheel {max(right, left):.0%}."
        yield finding("wheel_slow", 58, text, frame, slow)
