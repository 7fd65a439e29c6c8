"""What the robot does, as `status` and as diagnostics: levels, lines, keys and values.  Pure."""

from typing import Any, Dict

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from mrl_driver.events import Status

from .commander import BATTERY, DISABLED, EMERGENCY, LINK, NONE, WHEEL, Commander
from .link_report import ERROR, OK, WARN, Health

MODES = {
    EMERGENCY: "emergency stop",
    DISABLED: "disabled",
    LINK: "no link",
    BATTERY: "battery",
    WHEEL: "wheel mismatch",
}
"""Mode by what keeps the robot from moving; `drive` where nothing does."""


def mode_of(commander: Commander) -> str:
    """`drive`, or what keeps the robot from it."""
    return MODES.get(commander.stopped_by, "drive")


def new_status(node_name: str, hardware_id: str) -> DiagnosticStatus:
    """A status message of a node."""
    return DiagnosticStatus(name=f"{node_name}: status", hardware_id=hardware_id)


def fill_status(message: DiagnosticStatus, commander: Commander) -> bool:
    """Write mode, readiness and stop cause; False where the message says so already."""
    moving = commander.moving
    values = {
        "mode": mode_of(commander),
        "ready": _yes(commander.ready),
        "moving": _yes(moving),
        "stopped by": NONE if moving else commander.stopped_by,
    }
    pairs = [KeyValue(key, value) for key, value in values.items()]
    if pairs == message.values:
        return False
    message.values = pairs
    message.level, message.message = motion_health(commander)
    return True


def battery_health(state: str, volts: float) -> Health:
    """Level and line for a battery state of the driver."""
    level = {"ok": OK, "low": WARN}.get(state, ERROR)
    return Health(level, f"battery is {state} at {volts:.1f} V")


def battery_values(volts: float, state: str, capacity_ah: float) -> Dict[str, str]:
    """Keys and values of the battery."""
    return {"Voltage": f"{volts:.2f} V", "State": state, "Design Capacity": f"{capacity_ah:g} Ah"}


def board_health(status: Any) -> Health:
    """Level and line for a `Status` of the board; None for boards that have none."""
    if status is None:
        return Health(OK, "this firmware reports no status")
    if status.faults:
        return Health(ERROR, f"fault: {', '.join(status.faults)}")
    if status.reset_cause == "watchdog":
        return Health(WARN, "the firmware locked up and was reset by its watchdog")
    return Health(OK, "no fault")


def board_values(status: Any, temperature_c: float) -> Dict[str, str]:
    """Keys and values of the board."""
    values = {"Motor Board Temperature": f"{temperature_c:.1f} degC"}
    if isinstance(status, Status):
        values.update(
            {
                "Uptime": f"{status.uptime_s} s",
                "Reset Cause": status.reset_cause,
                "Last Stop Reason": status.stop_reason,
                "Faults": ", ".join(status.faults) or "none",
                "Clamped Commands": str(status.clamped),
            }
        )
    return values


def motion_health(commander: Commander) -> Health:
    """Level and line of the motion."""
    cause = commander.stopped_by
    if commander.moving or cause == NONE:
        return Health(OK, "moving" if commander.moving else "ready")
    level = ERROR if cause in (LINK, BATTERY, WHEEL) else WARN if cause in MODES else OK
    return Health(level, f"stopped by {cause}")


def motion_values(commander: Commander) -> Dict[str, str]:
    """Keys and values of the motion."""
    limits = commander.limits
    return {
        "Mode": mode_of(commander),
        "Moving": _yes(commander.moving),
        "Stop Reason": commander.stopped_by,
        "Linear Speed Limit": f"{limits.linear_m_s:g} m/s",
        "Angular Speed Limit": f"{limits.angular_rad_s:g} rad/s",
        "Linear Acceleration Limit": f"{limits.linear_acceleration_m_s2:g} m/s2",
        "Angular Acceleration Limit": f"{limits.angular_acceleration_rad_s2:g} rad/s2",
    }


def _yes(flag: bool) -> str:
    return "true" if flag else "false"
