"""A robot's state as one line of text for users, and as a mapping for programs."""

from typing import TYPE_CHECKING, Any, Dict

from .state import line_of, state_of

if TYPE_CHECKING:
    from mrl_driver.driver import Driver


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
