"""Findings about the sonars: no reading, always the same one, nothing in range where others see walls, pushing."""

import math
from typing import Any, List

import numpy as np

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.robot.sonar import CYCLE_S, FARTHEST_M, NEAREST_M

from .evidence import TELEMETRY, heard, interruptions, outside, ready_s, runs
from .finding import Finding

DEAD_S = 3.0  # a sonar is dead if it has no reading for this time [s], ten times its period
SAME_M, SAME, SAME_RAD = 0.015, 10, math.radians(90.0)
"""A sonar is stuck if at least `SAME` readings differ by less than `SAME_M` [m], a step of the ADC, while the robot
turns over a range of `SAME_RAD`: its cone has 36 deg, so that it cannot see the same wall all the time [rad]. """
CHANGED_M = 0.1
"""The other sonars must have seen a change of this size meanwhile [m]; if they have not, the robot stood."""
CLOSE_M, CLOSE_RAD = 0.3, math.radians(270.0)
"""The same for short readings, as those of a robot that turns in a narrow place may be: between two walls the range
varies by an eighth only [m rad]. """
DEAF_RAD, DEAF_SHARE = math.radians(180.0), 0.9
"""A sonar is deaf if nothing is in its range while the robot turns over this range [rad], and the other sonars, which
pass the same directions, see something in this share of their readings. """
PUSHED_M = NEAREST_M + 0.1
"""What is in the dead zone is at most 0.15 m away: a robot that drives further forward pushes it, or its wheels slip
[m]. """


def check(drive: DriveData) -> List[Finding]:
    """Return what is wrong with the sonars."""
    if not len(drive.poses.time_s):
        return []
    down = [*interruptions(drive), (-math.inf, ready_s(drive) + 1.0)]
    readings = {}
    for name, (times_s, values) in drive.ranges.items():
        kept = outside(times_s, down)
        readings[name] = times_s[kept], values[kept]
    yaws = np.unwrap(drive.poses.values[:, 2])
    findings = []
    for name, (times_s, values) in readings.items():
        turned = np.interp(times_s, drive.poses.time_s, yaws)
        others = [each for other, each in readings.items() if other != name]
        found = (
            _dead(drive, name, times_s, values)
            or _stuck(drive, name, times_s, values, turned, others)
            or _deaf(drive, name, times_s, values, turned, others)
        )
        findings += found
    return [*_together(findings), *_pushing(drive, readings)]


def _dead(drive: DriveData, name: str, times_s: Any, values: Any) -> List[Finding]:
    for first, end in runs(np.isnan(values)):
        lasts_s = times_s[end - 1] - times_s[first] + CYCLE_S
        if lasts_s >= DEAD_S:
            return [
                Finding(
                    "sonar_dead",
                    f"The {name} sonar gave no reading",
                    f"It was silent for {lasts_s:.0f} s: nothing is connected, or its input is saturated.",
                    *heard(drive, times_s[first], *TELEMETRY),
                    67,
                )
            ]
    return []


def _stuck(drive: DriveData, name: str, times_s: Any, values: Any, turned: Any, others: Any) -> List[Finding]:
    first, low, high = 0, math.inf, -math.inf
    for i, value in enumerate(values):
        if not value < math.inf:  # nothing in range, or no reading
            first, low, high = i + 1, math.inf, -math.inf
            continue
        near = max(float(value), 0.0)
        low, high = min(low, near), max(high, near)
        if high - low >= SAME_M:
            first, low, high = i, near, near
            continue
        turned_rad = np.ptp(turned[first : i + 1])
        if i - first + 1 < SAME or turned_rad < (SAME_RAD if low > CLOSE_M else CLOSE_RAD):
            continue
        if not _changed(others, times_s[first], times_s[i]):
            return [_standing(drive, times_s[i], turned_rad)]
        reading = f"{low:.2f} m" if value > 0 else "too close"
        return [
            Finding(
                "sonar_stuck",
                f"The {name} sonar always showed the same range",
                f"It showed {reading} in {i - first + 1} readings, while the robot turned over "
                f"{math.degrees(turned_rad):.0f} deg: it does not measure, or something on the robot is in front of "
                "it.",
                *heard(drive, times_s[i], *TELEMETRY),
                66,
            )
        ]
    return []


def _changed(others: Any, begin_s: float, end_s: float) -> bool:
    """Return whether another sonar saw something else in this time; True if there is no other one."""
    seen = [values[(times_s >= begin_s) & (times_s <= end_s)] for times_s, values in others]
    seen = [np.clip(each[~np.isnan(each)], 0.0, FARTHEST_M) for each in seen]
    return not seen or any(len(each) and np.ptp(each) >= CHANGED_M for each in seen)


def _standing(drive: DriveData, time_s: float, turned_rad: float) -> Finding:
    """All sonars show the same while the wheels turn."""
    return Finding(
        "pushing",
        "The robot did not move although its wheels turned",
        f"By its wheels it turned over {math.degrees(turned_rad):.0f} deg, while all sonars showed the same: it stood "
        "against an obstacle, or its wheels were off the ground. The pose is off by as much.",
        *heard(drive, time_s, *TELEMETRY),
        68,
    )


def _deaf(drive: DriveData, name: str, times_s: Any, values: Any, turned: Any, others: Any) -> List[Finding]:
    for first, end in runs(values == math.inf):
        if end - first < SAME or np.ptp(turned[first:end]) < DEAF_RAD:
            continue
        begin_s, end_s = times_s[first], times_s[end - 1]
        seen = np.concatenate([v[(t >= begin_s) & (t <= end_s)] for t, v in others] or [np.zeros(0)])
        seen = seen[~np.isnan(seen)]
        if len(seen) < SAME or np.mean(seen < math.inf) < DEAF_SHARE:
            continue
        return [
            Finding(
                "sonar_deaf",
                f"The {name} sonar saw nothing",
                f"It showed nothing in range from {begin_s:.0f} s to {end_s:.0f} s, while the others saw obstacles "
                "in the same directions.",
                *heard(drive, times_s[first], *TELEMETRY),
                66,
            )
        ]
    return []


def _together(findings: List[Finding]) -> List[Finding]:
    """Sonars that fail together share a cause."""
    dead = [each for each in findings if each.kind == "sonar_dead"]
    if len(dead) < 2:
        return findings
    one = min(dead, key=lambda each: each.time_s)._replace(
        title="The sonars gave no readings",
        text=f"{len(dead)} sonars were silent: they share their power and their trigger.",
    )
    return [one, *(each for each in findings if each.kind != "sonar_dead")]


def _pushing(drive: DriveData, readings: Any) -> List[Finding]:
    """The wheels drive on although the front sonar is in contact."""
    if "front" not in readings:
        return []
    times_s, values = readings["front"]
    moments, speeds = drive.speeds.time_s, drive.speeds.values[:, 0]
    steps = np.append(0.0, np.diff(moments)) * np.maximum(speeds, 0.0)
    driven = np.cumsum(steps)
    for first, end in runs(values == -math.inf):
        far = np.interp(times_s[first:end], moments, driven)
        if far[-1] - far[0] < PUSHED_M:
            continue
        at_s = times_s[first + int(np.searchsorted(far, far[0] + PUSHED_M))]
        return [
            Finding(
                "pushing",
                "The robot pushed against an obstacle",
                f"The wheels drove {far[-1] - far[0]:.2f} m forward, while the front sonar saw an obstacle closer "
                f"than {NEAREST_M:g} m: they slipped, or the obstacle moved. The pose is off by as much.",
                *heard(drive, at_s, *TELEMETRY),
                59,
            )
        ]
    return []
