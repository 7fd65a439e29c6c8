"""What a live view says of a robot, as rows of words in sections.  No I/O.

Styles are the terminal's own names of colours, such as `yellow` and `bold red`; a page makes marks of them.
"""

import math
from typing import List, NamedTuple, Sequence

from mrl_driver.safety.operator_delay import delay_text

from .shown_state import Bar, Row, Shown, has_motors, has_odometry, range_text

NEAR_M = 0.3  # a shorter range is shown as a danger, one below twice this as a warning [m]
_FARTHEST_BAR_M = 3.0
_BATTERY_STYLES = {"ok": "green", "low": "yellow"}
_FIRST = ("left", "front", "right")  # sonars that come first, as seen from above


class Section(NamedTuple):
    """Rows under a title; `style` is that of its frame."""

    title: str
    rows: Sequence[Row]
    style: str = "blue"


def sections(now: Shown) -> List[Section]:
    """Return motion, sonars, sensors, board and link; those without rows are left out."""
    found = (
        Section("motion", _motion(now), "blue" if now.stopped else "green"),
        Section("sonars", _ranges(now)),
        Section("sensors", [Row(*each) for each in now.sensors.items()]),
        Section("board", _supply(now)),
        Section("link", _link(now), "red" if now.silent else "blue"),
    )
    return [section for section in found if section.rows]


def _motion(now: Shown) -> List[Row]:
    if not has_motors(now.model):
        return []
    asked = Row("asked", now.stopped, "yellow") if now.stopped else Row("asked", "by another program")
    if now.command is not None:
        asked = Row("asked", _speeds(now.command), "green")
    if not has_odometry(now.model):
        return [Row("odometry", "none: no encoders", "yellow"), asked]
    pose = now.pose
    return [
        Row("pose", f"x {pose.x_m:+.3f}  y {pose.y_m:+.3f} m"),
        Row("heading", f"{math.degrees(pose.yaw_rad):+.1f} deg"),
        Row("speed", "unknown" if now.silent else _speeds(now.twist)),
        asked,
        Row("path", f"{now.distance_m:.2f} m"),
    ]


def _speeds(twist: Sequence[float]) -> str:
    linear_m_s, angular_rad_s, *lateral_m_s = twist
    aside = f"  {lateral_m_s[0]:+.3f} m/s to the left" if lateral_m_s else ""
    return f"{linear_m_s:+.3f} m/s  {math.degrees(angular_rad_s):+.0f} deg/s{aside}"


def sonar_order(names: Sequence[str]) -> List[str]:
    """Return the names of sonars, those in front as seen from above."""
    return [*(name for name in _FIRST if name in names), *(name for name in names if name not in _FIRST)]


def _ranges(now: Shown) -> List[Row]:
    ranges = now.ranges
    bars = {name: Bar(_share(each / _FARTHEST_BAR_M), range_style(each)) for name, each in ranges.items()}
    return [Row(name, range_text(ranges[name]), bar=bars[name]) for name in sonar_order(tuple(ranges))]


def range_style(value_m: float) -> str:
    """Return the style of a range: danger, warning or none."""
    return "red" if value_m < NEAR_M else "yellow" if value_m < 2 * NEAR_M else "cyan"


def _share(value: float) -> float:
    """Return a value between 0 and 1; 0 for NaN."""
    return min(1.0, max(0.0, value))


def _supply(now: Shown) -> List[Row]:
    if math.isnan(now.battery_v):
        return list(now.board)
    words = "" if now.battery_state == "ok" else f" {now.battery_state}"
    style = _BATTERY_STYLES.get(now.battery_state, "red")
    bar = Bar(_share(now.battery_share), style)
    return [Row("battery", f"{now.battery_v:.1f} V{words}", style, bar), *now.board]


def _link(now: Shown) -> List[Row]:
    delay_s, *parts_s = now.delays_s
    first, link = ("?" if math.isnan(part_s) else f"{part_s * 1000:.0f}" for part_s in parts_s)
    arrives = f"{now.rate_hz:.0f} Hz, newest {now.age_s * 1000:.0f} ms ago"
    return [
        Row("state", arrives) if now.ready else Row("state", now.silence.lower(), "bold red"),
        now.errors,
        Row("delay", f"{delay_text(delay_s)}: {now.input_name} {first}, link {link}"),
    ]
