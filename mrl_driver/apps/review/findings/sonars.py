"""Findings about the sonars: no reading, always the same one, nothing in range where others see walls, pushing."""

import math
from typing import Any, Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.robot.models import CHAIN_S, RangeKind

from .evidence import TELEMETRY, Finding, finding, heard, interruptions, outside, ready_s, runs

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
PUSHED_M = 0.1
"""A robot that drives this much further than its sonar's dead zone pushes what is in it, or its wheels slip [m]."""


class _Sonar(NamedTuple):
    """The readings of one sonar while the link was up."""

    name: str
    kind: RangeKind
    times_s: Any
    values: Any
    turned: Any  # heading of the robot at each reading, without wrap [rad]

    def between(self, begin_s: float, end_s: float) -> Any:
        """Return the ranges in this time [m], without readings that failed."""
        values = self.values[(self.times_s >= begin_s) & (self.times_s <= end_s)]
        return values[~np.isnan(values)]


def check(drive: DriveData) -> Iterator[Finding]:
    """Return what is wrong with the sonars."""
    if not len(drive.poses.time_s):
        return
    down = [*interruptions(drive), (-math.inf, ready_s(drive) + 1.0)]
    yaws, sonars = np.unwrap(drive.poses.values[:, 2]), []
    for name, (times_s, values) in drive.ranges.items():
        kept = outside(times_s, down)
        turned = np.interp(times_s[kept], drive.poses.time_s, yaws)
        kind = drive.model.sonars[name].kind
        sonars.append(_Sonar(name, kind, times_s[kept], values[kept], turned))
    found = []
    for sonar in sonars:
        others = [each for each in sonars if each is not sonar]
        found.append(_dead(drive, sonar) or _stuck(drive, sonar, others) or _deaf(drive, sonar, others))
    yield from _together([each for each in found if each is not None])
    yield from (each for sonar in sonars if sonar.name == "front" for each in _pushing(drive, sonar))


def _dead(drive: DriveData, sonar: _Sonar) -> Optional[Finding]:
    times_s = sonar.times_s
    for first, end in runs(np.isnan(sonar.values)):
        lasts_s = times_s[end - 1] - times_s[first] + CHAIN_S
        if lasts_s >= DEAD_S:
            text = f"It was silent for {lasts_s:.0f} s: nothing is connected, or its input is saturated."
            return finding("sonar_dead", 67, text, heard(drive, times_s[first], *TELEMETRY), sonar.name)
    return None


def _stuck(drive: DriveData, sonar: _Sonar, others: List[_Sonar]) -> Optional[Finding]:
    first, low, high = 0, math.inf, -math.inf
    for i, value in enumerate(sonar.values):
        if not value < math.inf:  # nothing in range, or no reading
            first, low, high = i + 1, math.inf, -math.inf
            continue
        near = max(float(value), 0.0)
        low, high = min(low, near), max(high, near)
        if high - low >= SAME_M:
            first, low, high = i, near, near
            continue
        turned_rad = np.ptp(sonar.turned[first : i + 1])
        if i - first + 1 < SAME or turned_rad < (SAME_RAD if low > CLOSE_M else CLOSE_RAD):
            continue
        turned, frame = f"{math.degrees(turned_rad):.0f} deg", heard(drive, sonar.times_s[i], *TELEMETRY)
        if not _changed(others, sonar.times_s[first], sonar.times_s[i]):
            return _standing(turned, frame)
        reading = f"{low:.2f} m" if value > 0 else "too close"
        text = (
            f"It showed {reading} in {i - first + 1} readings, while the robot turned over {turned}: it does not "
            "measure, or something on the robot is in front of it."
        )
        return finding("sonar_stuck", 66, text, frame, sonar.name)
    return None


def _changed(others: List[_Sonar], begin_s: float, end_s: float) -> bool:
    """Return whether another sonar saw something else in this time; True if there is no other one."""
    seen = [np.clip(each.between(begin_s, end_s), 0.0, each.kind.farthest_m) for each in others]
    return not seen or any(len(each) and np.ptp(each) >= CHANGED_M for each in seen)


def _standing(turned: str, frame: Tuple[float, str, bytes]) -> Finding:
    """All sonars show the same while the wheels turn."""
    text = (
        f"By its wheels it turned over {turned}, while all sonars showed the same: it stood against an obstacle, or "
        "its wheels were off the ground. The pose is off by as much."
    )
    title = "The robot did not move although its wheels turned"
    return finding("pushing", 68, text, frame, title=title)


def _deaf(drive: DriveData, sonar: _Sonar, others: List[_Sonar]) -> Optional[Finding]:
    for first, end in runs(sonar.values == math.inf):
        if end - first < SAME or np.ptp(sonar.turned[first:end]) < DEAF_RAD:
            continue
        begin_s, end_s = sonar.times_s[first], sonar.times_s[end - 1]
        seen = np.concatenate([each.between(begin_s, end_s) for each in others] or [np.zeros(0)])
        farthest_m = drive.model.sonars[sonar.name].kind.farthest_m
        if len(seen) >= SAME and np.mean(seen <= farthest_m) >= DEAF_SHARE:
            text = (
                f"It showed nothing in range from {begin_s:.0f} s to {end_s:.0f} s, while the others saw obstacles "
                "in the same directions."
            )
            return finding("sonar_deaf", 66, text, heard(drive, begin_s, *TELEMETRY), sonar.name)
    return None


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


def _pushing(drive: DriveData, front: _Sonar) -> Iterator[Finding]:
    """The wheels drive on although the front sonar is in contact."""
    moments, speeds = drive.speeds.time_s, drive.speeds.values[:, 0]
    driven = np.cumsum(np.append(0.0, np.diff(moments)) * np.maximum(speeds, 0.0))
    nearest_m = front.kind.nearest_m
    pushed_m = nearest_m + PUSHED_M
    for first, end in runs(front.values <= nearest_m):  # a sonar in contact shows this, or -inf
        far = np.interp(front.times_s[first:end], moments, driven)
        if far[-1] - far[0] >= pushed_m:
            at_s = front.times_s[first + int(np.searchsorted(far, far[0] + pushed_m))]
            text = (
                f"The wheels drove {far[-1] - far[0]:.2f} m forward, while the front sonar saw an obstacle at most "
                f"{nearest_m:g} m away: they slipped, or the obstacle moved. The pose is off by as much."
            )
            yield finding("pushing", 59, text, heard(drive, at_s, *TELEMETRY))
            return
