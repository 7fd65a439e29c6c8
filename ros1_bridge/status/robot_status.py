"""The state of the robot as `status` and as diagnostics: levels, messages, keys and values.  Pure."""

import math
from typing import Any, Callable, Dict, Optional, Tuple

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from mrl_driver.lock_order import new_lock
from mrl_driver.session.events import MAY_MOVE, Status
from ros1_bridge.control.commander import (
    ADRIFT,
    BATTERY,
    DISABLED,
    EMERGENCY,
    LINK,
    NONE,
    WHEEL,
    Commander,
)

from .link_report import ERROR, OK, WARN, LinkHealth

MODES = {
    EMERGENCY: "emergency stop",
    DISABLED: "disabled",
    LINK: "no link",
    ADRIFT: "no link",
    BATTERY: "battery",
    WHEEL: "wheel mismatch",
}
"""Mode by the reason why the robot may not move; without a reason the mode is `drive` or `pose`."""
HARMLESS = (NONE, "user", DISABLED, "closed")
"""Reasons for a stop that do not make it a safety stop."""
FAULTY = ("wheel blocked", "encoder", "undervoltage")
"""Stops by an H-bridge board that somebody must look into."""
State = Tuple[bool, str, bool, Tuple[str, str]]


class StatusTeller:
    """Publishes the robot's state if it has changed; any thread may call `tell`."""

    def __init__(
        self,
        commander: Commander,
        publish: Callable[[DiagnosticStatus], None],
        node_name: str,
        hardware_id: str,
    ) -> None:
        self._commander, self._publish = commander, publish
        self._name, self._hardware_id = f"{node_name}: status", hardware_id
        self._lock = new_lock("status")
        self._published: Optional[State] = None

    def tell(self) -> None:
        """Publish the state, unless it is the same as last time."""
        with self._lock:
            commander = self._commander
            state = commander.moving, commander.stopped_by, commander.seeking, zones_clear(commander)
            if state != self._published:
                self._published = state
                self._publish(self._message(*state))

    def _message(self, moving: bool, cause: str, seeking: bool, clear: Tuple[str, str]) -> DiagnosticStatus:
        level, line = motion_health(moving, cause)
        values = {
            "mode": mode_of(cause, seeking),
            "ready": _yes(cause not in MODES),
            "moving": "unknown" if cause == ADRIFT else _yes(moving),
            "warning zone clear": clear[0],
            "protective zone clear": clear[1],
            "safety stop": _yes(not moving and cause not in HARMLESS),
            "stopped by": NONE if moving else cause,
        }
        pairs = [KeyValue(key, value) for key, value in values.items()]
        return DiagnosticStatus(level, self._name, line, self._hardware_id, pairs)


def mode_of(cause: str, seeking: bool = False) -> str:
    """`drive`, `pose` while the robot drives to one, or why it may not move; `cause` is `Commander.stopped_by`."""
    return MODES.get(cause, "pose" if seeking else "drive")


def zones_clear(commander: Commander) -> Tuple[str, str]:
    """Whether the warning and the protective zone are clear; `not watched` without zones."""
    zones = commander.zones
    if zones is None:
        return "not watched", "not watched"
    return _yes(zones.warning_clear), _yes(zones.protective_clear)


def battery_health(state: str, volts: float) -> LinkHealth:
    """Level and message for a battery state of the driver."""
    if math.isnan(volts):
        return LinkHealth(OK, "this board does not measure its battery")
    level = {"ok": OK, "low": WARN}.get(state, ERROR)
    return LinkHealth(level, f"battery is {state} at {volts:.1f} V")


def battery_values(volts: float, state: str, capacity_ah: float) -> Dict[str, str]:
    """Keys and values for the battery."""
    voltage = "not measured" if math.isnan(volts) else f"{volts:.2f} V"
    return {"Voltage": voltage, "State": state, "Design Capacity": f"{capacity_ah:g} Ah"}


def board_health(status: Any) -> LinkHealth:
    """Level and message for a `Status` of the board; `status` is None for boards that report none."""
    if status is None:
        return LinkHealth(OK, "this firmware reports no status")
    if status.faults:
        return LinkHealth(ERROR, f"fault: {', '.join(status.faults)}")
    if status.reset_cause == "watchdog":
        return LinkHealth(WARN, "the firmware locked up and was reset by its watchdog")
    return LinkHealth(OK, "no fault")


def board_values(status: Any, temperature_c: float) -> Dict[str, str]:
    """Keys and values for the board."""
    warm = "not measured" if math.isnan(temperature_c) else f"{temperature_c:.1f} degC"
    values = {"Motor Board Temperature": warm}
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
        if status.impossible is not None:
            values["Impossible Encoder Transitions"] = str(status.impossible)
    return values


def motion_health(moving: bool, cause: str) -> LinkHealth:
    """Level and message for the motion; `cause` is `Commander.stopped_by`."""
    if cause == ADRIFT:
        return LinkHealth(ERROR, f"no telemetry; {MAY_MOVE}")
    if moving or cause == NONE:
        return LinkHealth(OK, "moving" if moving else "ready")
    level = ERROR if cause in (LINK, BATTERY, WHEEL, *FAULTY) else WARN if cause in MODES else OK
    return LinkHealth(level, f"stopped by {cause}")


def motion_values(commander: Commander) -> Dict[str, str]:
    """Keys and values for the motion."""
    limits = commander.limits
    return {
        "Mode": mode_of(commander.stopped_by, commander.seeking),
        "Moving": "unknown" if commander.stopped_by == ADRIFT else _yes(commander.moving),
        "Stop Reason": commander.stopped_by,
        "Linear Speed Limit": f"{limits.linear_m_s:g} m/s",
        "Angular Speed Limit": f"{limits.angular_rad_s:g} rad/s",
        "Linear Acceleration Limit": f"{limits.linear_acceleration_m_s2:g} m/s2",
        "Angular Acceleration Limit": f"{limits.angular_acceleration_rad_s2:g} rad/s2",
    }


def _yes(flag: bool) -> str:
    return "true" if flag else "false"
