"""The state of the robot as `status` and as diagnostics: levels, messages, keys and values.  Pure."""

import math
from typing import Callable, Dict, NamedTuple, Optional, Tuple, Union

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from mrl_driver.lock_order import new_lock
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.hold import Hold
from mrl_driver.robot.imu import IN_USE, LEARNING, OFF, REASONS, Imu
from mrl_driver.robot.inputs import SAFETY, Inputs
from mrl_driver.robot.radio import format_address
from mrl_driver.safety.speed_limiter import AUTOMATIC, MANUAL
from mrl_driver.session.events import MAY_MOVE, Status
from mrl_driver.view.shown_state import NO_ODOMETRY
from ros1_bridge.control.commander import BLOCKING, Commander
from ros1_bridge.topics.publishers import FIELD_TOPICS

from .link_report import ERROR, OK, WARN, Report

HARMLESS = (
    StopReason.NONE, StopReason.USER, StopReason.MOTORS_DISABLED, StopReason.CLOSED, StopReason.MANUAL_MODE,
    StopReason.COMMAND_TIMEOUT, StopReason.COMMANDS_UNPAUSED,
)  # fmt: skip
"""Reasons for a stop that violate no safety function: the user's, and the ordinary end of commands."""
FAULTY = (
    StopReason.NO_TELEMETRY, StopReason.BATTERY, StopReason.WHEEL_MISMATCH, StopReason.WHEEL_BLOCKED,
    StopReason.ENCODER, StopReason.UNDERVOLTAGE,
)  # fmt: skip
"""Stops that somebody must look into."""
FIELDS = ("warning", "outer warning", "protective")  # The zones, in the order of `FIELD_TOPICS`
Value = Union[bool, str, None]


class State(NamedTuple):
    """What a robot does, and why it does not; None for what is not known."""

    driving: bool  # A command other than standstill is in force
    moving: Optional[bool]  # The wheels turn, by their counts
    cause: StopReason  # `Commander.stopped_by`
    seeking: bool
    manual: bool
    clear: Tuple[Optional[bool], ...]  # Whether each of `FIELDS` is clear; all None without zones
    wheel_fault: bool  # `Commander.wheel_fault`

    @property
    def mode(self) -> str:
        """`drive`, `pose` while the robot drives to one, or the `StopReason` for which it may not move."""
        if self.cause in BLOCKING:
            return str(self.cause)
        free = "pose" if self.seeking else "drive"
        return str(StopReason.WHEEL_MISMATCH) if self.wheel_fault else free

    @property
    def safety_stop(self) -> bool:
        """A safety function has stopped the robot, or holds it."""
        return not self.driving and self.cause not in HARMLESS

    def topics(self) -> Dict[str, Value]:
        """Return the values that have a topic of their own."""
        fields = dict(zip(FIELD_TOPICS, self.clear))
        return {"mode": self.mode, "moving": self.moving, "safety_stop": self.safety_stop, **fields}

    def fields(self) -> Dict[str, Union[bool, str]]:
        """Return the fields of mrl_msgs/RobotStatus, numbers by the names of their constants."""
        free = {"drive": "MODE_DRIVE", "pose": "MODE_POSE"}.get(self.mode)
        zones = {None: "ZONE_NOT_WATCHED", False: "ZONE_OCCUPIED", True: "ZONE_CLEAR"}
        return {
            "mode": free or "MODE_BLOCKED",
            "blocked_by": _reason("none" if free else self.mode),
            "stopped_by": _reason(StopReason.NONE if self.driving else self.cause),
            "operation_mode": f"OPERATION_{(MANUAL if self.manual else AUTOMATIC).upper()}",
            "moving": {None: "MOVING_UNKNOWN", False: "STANDS", True: "MOVES"}[self.moving],
            "driving": self.driving,
            "safety_stop": self.safety_stop,
            **{f"{name.replace(' ', '_')}_zone": zones[clear] for name, clear in zip(FIELDS, self.clear)},
        }

    def keys(self) -> Dict[str, str]:
        """Return keys and values for `status`."""
        zones = {f"{name} zone clear": _text(clear, "not watched") for name, clear in zip(FIELDS, self.clear)}
        return {
            "mode": self.mode,
            "operation mode": MANUAL if self.manual else AUTOMATIC,
            "ready": _text(self.cause not in BLOCKING and not self.wheel_fault),
            "moving": _text(self.moving),
            **zones,
            "safety stop": _text(self.safety_stop),
            "stopped by": str(StopReason.NONE if self.driving else self.cause),
        }


def state_of(commander: Commander) -> State:
    """Return the state of a robot now."""
    zones = commander.zones
    clear: Tuple[Optional[bool], ...] = (None,) * len(FIELDS)
    if zones is not None:
        watched = commander.linked
        fields = zones.warning_clear, zones.outer_clear, zones.protective_clear
        clear = tuple(watched and each for each in fields)
    cause, seeking = commander.stopped_by, commander.seeking
    moving, fault = commander.wheels_turn, commander.wheel_fault
    return State(commander.driving, moving, cause, seeking, commander.manual, clear, fault)


class StatusTeller:
    """Publishes the robot's state if it has changed; any thread may call `tell`."""

    def __init__(
        self,
        commander: Commander,
        publish: Callable[[DiagnosticStatus, Dict[str, Value], Dict[str, Union[bool, str]]], None],
        node_name: str,
        hardware_id: str,
        virtual: bool = False,
    ) -> None:
        """`publish` gets the status, those values of topics that have changed, and `State.fields`."""
        self._commander, self._publish = commander, publish
        self._name, self._hardware_id = f"{node_name}: status", hardware_id
        self._robot = KeyValue("virtual", _text(virtual))
        self._lock = new_lock("status")
        self._published: Optional[State] = None
        self._values: Dict[str, Value] = {}

    def tell(self) -> None:
        """Publish the state, unless it is the same as last time."""
        with self._lock:
            state = state_of(self._commander)
            if state != self._published:
                self._published = state
                self._publish(self._message(state), self._changed(state), state.fields())

    def _changed(self, state: State) -> Dict[str, Value]:
        """Return the new values.  A value that is no longer known is true: the robot may be moving."""
        changed: Dict[str, Value] = {}
        for topic, value in state.topics().items():
            if value is None and topic not in self._values:
                continue
            value = True if value is None else value
            if self._values.get(topic) != value:
                changed[topic] = self._values[topic] = value
        return changed

    def _message(self, state: State) -> DiagnosticStatus:
        level, line, _ = motion_health(state.driving, state.cause)
        pairs = [KeyValue(key, value) for key, value in state.keys().items()]
        return DiagnosticStatus(level, self._name, line, self._hardware_id, [*pairs, self._robot])


def battery_report(state: str, volts: float, capacity_ah: float) -> Report:
    """The battery; `state` is that of the driver."""
    if math.isnan(volts):
        level, message, voltage = OK, "the battery is not measured", "not measured"
    else:
        level, message = {"ok": OK, "low": WARN}.get(state, ERROR), f"battery is {state} at {volts:.1f} V"
        voltage = f"{volts:.2f} V"
    return Report(
        level, message, {"Voltage": voltage, "State": state, "Design Capacity": f"{capacity_ah:g} Ah"}
    )


def radio_report(hold: Optional[Hold]) -> Report:
    """The holds by radio."""
    if hold is None:
        return Report(WARN, "the board has not answered yet")
    values = {
        "state": hold.state,
        "holders": str(hold.holders),
        "holder": format_address(hold.holder) if hold.holders else "none",
        "hold texts ignored": str(hold.ignored),
        "texts not delivered": str(hold.undelivered),
    }
    return Report(ERROR if hold.state == "silent" else WARN if hold.held else OK, str(hold), values)


def inputs_report(inputs: Optional[Inputs]) -> Report:
    """The inputs that stop the robot."""
    if inputs is None:
        return Report(WARN, "the board has not answered yet")
    values = {name.replace("_", " "): _text(name in inputs.active) for name in inputs.connected}
    values.update({"emergency stop latched": _text(inputs.latched), "note": SAFETY})
    level = ERROR if inputs.latched else WARN if inputs.active else OK
    return Report(level, str(inputs), values)


def board_report(status: Optional[Status], temperature_c: float) -> Report:
    """The board; `status` is None for boards that report none."""
    warm = "not measured" if math.isnan(temperature_c) else f"{temperature_c:.1f} degC"
    values = {"Motor Board Temperature": warm}
    if status is None:
        return Report(OK, "this firmware reports no status", values)
    values.update(
        {
            "Uptime": f"{status.uptime_s} s",
            "Reset Cause": status.reset_cause,
            "Last Stop Reason": str(status.stop_reason),
            "Faults": ", ".join(status.faults) or "none",
            "Clamped Commands": str(status.clamped),
        }
    )
    if status.impossible is not None:
        values["Impossible Encoder Transitions"] = str(status.impossible)
    if status.faults:
        return Report(ERROR, f"fault: {values['Faults']}", values)
    if status.reset_cause == "watchdog":
        return Report(WARN, "the firmware locked up and was reset by its watchdog", values)
    return Report(OK, "no fault", values)


def imu_report(state: str, imu: Optional[Imu]) -> Report:
    """The IMU; `state` is `Driver.imu_state`, and `imu` the last reading."""
    values = {"State": state}
    if imu is not None:
        known = f"{imu.bias_rad_s:.5f} rad/s, standard deviation {imu.bias_sd_rad_s:.5f} rad/s"
        values["Gyro Bias"] = known if imu.bias_known else "not known yet"
        values["Yaw Rate"] = f"{imu.angular_velocity_rad_s[2] - imu.bias_rad_s:.4f} rad/s"
        values["Yaw Standard Deviation"] = f"{math.sqrt(imu.yaw_variance_rad2):.4f} rad"
    if state in REASONS:
        return Report(WARN, REASONS[state], values)
    if state == IN_USE:
        return Report(OK, "the heading comes from gyro and wheels", values)
    why = "the gyro's bias is learned when the robot stands" if state == LEARNING else f"the IMU is {state}"
    level = WARN if state == OFF else OK
    return Report(level, f"the heading comes from the wheels alone: {why}", values)


def motion_health(driving: bool, cause: StopReason) -> Report:
    """Level and message for the motion; `driving`: a command other than standstill is in force."""
    if cause is StopReason.MAY_BE_MOVING:
        return Report(ERROR, f"no telemetry; {MAY_MOVE}")
    if driving or cause is StopReason.NONE:
        return Report(OK, "driving" if driving else "ready")
    level = ERROR if cause in FAULTY else WARN if cause in BLOCKING else OK
    return Report(level, f"stopped by {cause.words}")


def motion_report(commander: Commander, odometry: bool = True) -> Report:
    """The motion, and the limits in force; without `odometry` it is not measured."""
    limits, state = commander.in_force, state_of(commander)
    values = {
        "Mode": state.mode,
        "Operation Mode": state.keys()["operation mode"],
        "Moving": _text(state.moving),
        **({} if odometry else {"Odometry": NO_ODOMETRY}),
        "Stop Reason": str(state.cause),
        "Late Commands": str(commander.late_commands),
        "Linear Speed Limit": f"{limits.linear_m_s:g} m/s",
        "Angular Speed Limit": f"{limits.angular_rad_s:g} rad/s",
        "Linear Acceleration Limit": f"{limits.linear_acceleration_m_s2:g} m/s2",
        "Angular Acceleration Limit": f"{limits.angular_acceleration_rad_s2:g} rad/s2",
    }
    return motion_health(commander.driving, commander.stopped_by)._replace(values=values)


def _reason(reason: str) -> str:
    return f"REASON_{StopReason(reason).name}"


def _text(flag: Optional[bool], unknown: str = "unknown") -> str:
    return unknown if flag is None else "true" if flag else "false"
