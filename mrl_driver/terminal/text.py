"""A robot's state as one line of text for users, and as a mapping for programs."""

import math
from typing import TYPE_CHECKING, Any, Dict

from mrl_driver.protocol.table import SENSOR_BY_NAME
from mrl_driver.session.sensor_polling import text

if TYPE_CHECKING:
    from mrl_driver.driver.readout import Readout


def range_text(value_m: float) -> str:
    """Return a range as text."""
    if math.isnan(value_m):
        return "no reading"
    if math.isinf(value_m):
        return "nothing" if value_m > 0 else "too close"
    return f"{value_m:.2f} m"


def line(driver: "Readout") -> str:
    """Return pose, speeds, ranges and battery in one line."""
    pose, twist = driver.pose, driver.twist
    aside = f"sideways {twist.lateral_m_s:6.3f} m/s  " if len(twist) == 3 else ""
    ranges = "  ".join(f"{name} {range_text(value)}" for name, value in driver.ranges.items())
    return (
        f"x {pose.x_m:7.3f} m  y {pose.y_m:7.3f} m  yaw {math.degrees(pose.yaw_rad):7.2f} deg  "
        f"v {twist.linear_m_s:6.3f} m/s  {aside}w {twist.angular_rad_s:6.3f} rad/s  {ranges}  "
        f"battery {driver.battery_v:.1f} V ({driver.battery_state})"
        + "".join(f"  {name} {value}" for name, value in sensor_texts(driver).items())
        + ("" if driver.ready else "  NO TELEMETRY")
    )


def sensor_texts(driver: "Readout") -> Dict[str, str]:
    """Return the reading of each sensor that answers as text, by name, such as `500 count`."""
    return {name: text(SENSOR_BY_NAME[name], found) for name, found in driver.sensors.items()}


def snapshot(driver: "Readout") -> Dict[str, Any]:
    """Return the robot's state and the state of the link, for JSON; SI units, with the unit at the end of the key."""
    seen, command = driver.statistics, driver.command
    return {
        "pose": driver.pose._asdict(),
        "twist": driver.twist._asdict(),
        "command": command._asdict() if command else None,
        "ranges_m": driver.ranges,
        "sensors": {name: list(found.values) for name, found in driver.sensors.items()},
        "battery_v": driver.battery_v,
        "battery_state": driver.battery_state,
        "temperature_c": driver.temperature_c,
        "ready": driver.ready,
        "age_s": driver.age_s,
        "stop_reason": driver.stop_reason,
        "frames": seen.frames,
        "lost": seen.lost,
        "garbage": dict(seen.garbage),
        "refused_counts": seen.refused_counts,
        "restarts": seen.restarts,
    }
