"""The robot's state as the demonstration sees it, and one-line texts of it.  Pure."""

import math
from typing import Dict, List, Mapping, NamedTuple, Optional, Tuple

from mrl_driver.geometry import ORIGIN, Pose

TRAIL_STEP_M = 0.005
TRAIL_POINTS = 3000
_WORDS = {math.inf: "clear", -math.inf: "near"}


class Snapshot(NamedTuple):
    """State at one moment; SI units."""

    elapsed_s: float
    """Time since the first odometry."""
    mode: str
    pose: Pose
    twist: Tuple[float, float]
    distance_m: float
    frames: int
    rate_hz: float
    age_s: float
    """Age of the newest odometry; infinite before the first."""
    ranges: Mapping[str, float]
    battery_v: float
    battery_share: float
    link: Mapping[str, str]
    """Keys and values of the node's link diagnostics; empty before the first message."""
    trail: List[Tuple[float, float]]

    @property
    def errors(self) -> int:
        """Number of link errors so far."""
        return int(self.link.get("Errors", "0"))


class Recorder:
    """Builds snapshots from the received messages."""

    def __init__(self) -> None:
        self._pose, self._twist = ORIGIN, (0.0, 0.0)
        self._first_s: Optional[float] = None
        self._last_s = -math.inf
        self._distance_m = 0.0
        self._frames = 0
        self._window: List[float] = []
        self._trail: List[Tuple[float, float]] = []
        self.ranges: Dict[str, float] = {}
        self.battery: Tuple[float, float] = (math.nan, math.nan)
        """Voltage [V] and charge 0 to 1."""
        self.link: Mapping[str, str] = {}

    @property
    def pose(self) -> Pose:
        """Newest pose x, y, yaw [m m rad]."""
        return self._pose

    def add_odometry(self, pose: Pose, twist: Tuple[float, float], now_s: float) -> None:
        """Add a pose [m m rad] and a twist [m/s rad/s] received at `now_s`."""
        if self._first_s is None:
            self._first_s = now_s
        else:
            self._distance_m += math.hypot(pose[0] - self._pose[0], pose[1] - self._pose[1])
        self._pose, self._twist, self._last_s = pose, twist, now_s
        self._frames += 1
        self._window = [t for t in self._window if t > now_s - 1.0] + [now_s]
        if (
            not self._trail
            or math.hypot(pose[0] - self._trail[-1][0], pose[1] - self._trail[-1][1]) > TRAIL_STEP_M
        ):
            self._trail = [*self._trail[-TRAIL_POINTS:], pose[:2]]

    def snapshot(self, mode: str, now_s: float) -> Snapshot:
        """The state at `now_s`."""
        elapsed_s = now_s - self._first_s if self._first_s is not None else 0.0
        rate_hz = float(sum(t > now_s - 1.0 for t in self._window))
        return Snapshot(
            elapsed_s,
            mode,
            self._pose,
            self._twist,
            self._distance_m,
            self._frames,
            rate_hz,
            now_s - self._last_s,
            dict(self.ranges),
            self.battery[0],
            self.battery[1],
            self.link,
            self._trail,
        )


def range_text(range_m: float) -> str:
    """A range as text: metres, `clear` if nothing is in range, `near` if too near, `--` without a reading."""
    if math.isfinite(range_m):
        return f"{range_m:.2f} m"
    return _WORDS.get(range_m, "--")


def line(now: Snapshot) -> str:
    """The state as one line, for output without a terminal."""
    if not now.frames:
        return "waiting for odometry"
    x, y, yaw = now.pose
    ranges = "  ".join(f"{name} {range_text(value)}" for name, value in sorted(now.ranges.items()))
    return (
        f"{now.elapsed_s:5.0f} s  x {x:+.3f} y {y:+.3f} m  yaw {math.degrees(yaw):+7.2f} deg  "
        f"v {now.twist[0]:+.2f} m/s  w {now.twist[1]:+.2f} rad/s  {ranges}  "
        f"{now.battery_v:.1f} V  {now.rate_hz:.0f} Hz  errors {now.errors}"
    )


def summary(now: Snapshot) -> str:
    """The last line of a run."""
    x, y, yaw = now.pose
    return (
        f"ran {now.elapsed_s:.1f} s: pose x {x:+.3f} m, y {y:+.3f} m, yaw {math.degrees(yaw):+.1f} deg; "
        f"distance {now.distance_m:.3f} m; {now.frames} odometry frames; {now.errors} link errors"
    )
