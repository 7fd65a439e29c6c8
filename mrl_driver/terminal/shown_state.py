"""The state of a robot as users see it: in the live view, as a line of text, and as a mapping for programs.  No I/O."""

import math
from typing import TYPE_CHECKING, Any, Dict, Mapping, NamedTuple, Optional, Sequence

from mrl_driver.geometry import Pose
from mrl_driver.protocol.table import SENSOR_BY_NAME
from mrl_driver.robot.battery import voltage_text
from mrl_driver.robot.models import OmniDrive, RobotModel
from mrl_driver.robot.odometry import AnyTwist
from mrl_driver.session.sensor_polling import text

if TYPE_CHECKING:
    from mrl_driver.driver import Driver


class Row(NamedTuple):
    """A name, a value as text, and the style of the value."""

    name: str
    value: str
    style: str = ""


class ShownState(NamedTuple):
    """State at one moment, from a driver or from ROS topics."""

    name: str
    """Model and id."""
    model: Optional[RobotModel]
    pose: Pose
    twist: AnyTwist
    command: Optional[AnyTwist]
    stop_reason: str
    ranges: Mapping[str, float]
    sensors: Mapping[str, str]
    """Readings of the other sensors as text, with unit."""
    battery_v: float
    """NaN if it is unknown."""
    battery_share: float
    """Charge from 0 to 1."""
    battery_state: str
    board: Sequence[Row]
    """What else is known of the board."""
    ready: bool
    """Telemetry arrives."""
    age_s: float
    """Age of the newest telemetry [s]."""
    errors: Row
    """Errors of the link."""


def state_of(driver: "Driver") -> ShownState:
    """Return the state of a driver's robot."""
    model, seen = driver.model, driver.statistics
    damage = sum(seen.garbage.values())
    bad = f"{seen.lost} lost, {damage} bad" + (f", {seen.restarts} resets" if seen.restarts else "")
    return ShownState(
        f"{model.name if model else 'robot'} {driver.board.robot_id}",
        model,
        driver.pose,
        driver.twist,
        driver.command,
        driver.stop_reason,
        driver.ranges,
        sensor_texts(driver),
        driver.battery_v,
        model.battery.charge(driver.battery_v) if model else 0.0,
        driver.battery_state,
        _board(driver),
        driver.ready,
        driver.age_s,
        Row("errors", bad, "yellow" if seen.lost or damage or seen.restarts else ""),
    )


def _board(driver: "Driver") -> Sequence[Row]:
    status = driver.status
    if status is None:
        return [Row("firmware", "1 (2013), no watchdog")]
    faults = ", ".join(status.faults).replace("_", " ")
    warm = "" if math.isnan(driver.temperature_c) else f", {driver.temperature_c:.0f} degC"
    up = f"up {_span(status.uptime_s)}{warm}"
    return [
        Row("firmware", f"{driver.board.version}, {up}"),
        Row("last stop", f"by {status.stop_reason.replace('_', ' ')}"),
        Row("faults", faults or "none", "bold red" if faults else ""),
    ]


def _span(seconds: int) -> str:
    if seconds < 600:
        return f"{seconds} s"
    return f"{seconds // 60} min" if seconds < 36000 else f"{seconds // 3600} h"


def sensor_texts(driver: "Driver") -> Dict[str, str]:
    """Return the reading of each sensor that answers as text, by name, such as `500 count`."""
    return {name: text(SENSOR_BY_NAME[name], found) for name, found in driver.sensors.items()}


def moves_sideways(model: Optional[RobotModel]) -> bool:
    """Return whether a robot can move sideways."""
    return model is not None and isinstance(model.drive, OmniDrive)


def range_text(value_m: float) -> str:
    """Return a range as text."""
    if math.isnan(value_m):
        return "no reading"
    if math.isinf(value_m):
        return "nothing" if value_m > 0 else "too close"
    return f"{value_m:.2f} m"


def line_of(state: ShownState) -> str:
    """Return pose, speeds, ranges and battery in one line."""
    pose, twist = state.pose, state.twist
    aside = f"sideways {twist.lateral_m_s:6.3f} m/s  " if len(twist) == 3 else ""
    ranges = "  ".join(f"{name} {range_text(value)}" for name, value in state.ranges.items())
    return (
        f"x {pose.x_m:7.3f} m  y {pose.y_m:7.3f} m  yaw {math.degrees(pose.yaw_rad):7.2f} deg  "
        f"v {twist.linear_m_s:6.3f} m/s  {aside}w {twist.angular_rad_s:6.3f} rad/s  {ranges}  "
        f"battery {voltage_text(state.battery_v)} ({state.battery_state})"
        + "".join(f"  {name} {value}" for name, value in state.sensors.items())
        + ("" if state.ready else "  NO TELEMETRY")
    )


def line(driver: "Driver") -> str:
    """Return pose, speeds, ranges and battery in one line."""
    return line_of(state_of(driver))


def snapshot(driver: "Driver") -> Dict[str, Any]:
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
