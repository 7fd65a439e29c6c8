"""The state of a robot as users see it: in the live view, as a line of text, and as a mapping for programs.  No I/O."""

import math
from typing import TYPE_CHECKING, Any, Dict, Mapping, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import SENSOR_BY_NAME
from mrl_driver.robot.battery import voltage_text
from mrl_driver.robot.imu import ABSENT, IN_USE, LEARNING, REASONS
from mrl_driver.robot.models import RobotModel, drives
from mrl_driver.robot.odometry import AnyTwist
from mrl_driver.session.sensor_polling import text

from .words import stopped_text

if TYPE_CHECKING:
    from mrl_driver.driver import Driver


NO_ODOMETRY = "none: the motors have no encoders"
VIRTUAL = "the robot is virtual: the board calculates it"
SILENT_S = 0.3  # the robot is silent if its newest telemetry is older than this [s]


class Bar(NamedTuple):
    """A bar in front of a value: the filled share, from 0 to 1, and its style."""

    share: float
    style: str


class Row(NamedTuple):
    """A name, a value as text, the style of the value, and a bar if it has one."""

    name: str
    value: str
    style: str = ""
    bar: Optional[Bar] = None


class Shown(NamedTuple):
    """What users see of a robot at one moment, from a driver or from ROS topics; a live view knows the last fields."""

    name: str  # model and id
    model: Optional[RobotModel]
    pose: Pose
    twist: AnyTwist
    command: Optional[AnyTwist]
    stop_reason: StopReason
    ranges: Mapping[str, float]
    sensors: Mapping[str, str]  # readings of the other sensors as text, with unit
    battery_v: float  # NaN if it is unknown
    battery_share: float  # charge from 0 to 1
    battery_state: str
    board: Sequence[Row]  # what else is known of the board
    ready: bool  # telemetry arrives
    age_s: float  # age of the newest telemetry [s]
    errors: Row  # errors of the link
    imu: str = ""  # the state of the IMU, one of `robot.imu.STATES`; empty without one
    now_s: float = math.nan
    elapsed_s: float = math.nan  # time since the view began
    rate_hz: float = math.nan  # telemetry frames per second
    trail: Sequence[Pose] = ()
    distance_m: float = math.nan  # length of the path
    notice: str = ""  # message for the user; empty if there is none
    record: str = ""  # file of the recording; empty without one
    incomplete: bool = False  # the recording is incomplete
    delays_s: Tuple[float, float, float] = (math.nan, math.nan, math.nan)
    """From the operator's input to the board, and its parts: to the written command, and the link; NaN if unknown."""
    input_name: str = "key"  # what the operator drives with, as the name of the first part of the delay

    @property
    def silent(self) -> bool:
        """No telemetry arrives."""
        return self.age_s > SILENT_S or not self.ready

    @property
    def silence(self) -> str:
        """How long the robot has been silent, in words."""
        return f"NO TELEMETRY for {self.age_s:.1f} s" if self.age_s < math.inf else "NO TELEMETRY yet"

    @property
    def stopped(self) -> str:
        """`stopped`, with the reason unless somebody wanted it; empty while a command of any program is in force."""
        if self.command is not None or self.stop_reason is StopReason.DRIVEN_ELSEWHERE:
            return ""
        return stopped_text(self.stop_reason)


def errors_row(lost: int, damaged: int, restarts: int) -> Row:
    """Return the row of frames that were lost or damaged, and of the board's restarts."""
    text = f"{lost} lost, {damaged} bad" + (f", {restarts} resets" if restarts else "")
    return Row("errors", text, "yellow" if lost or damaged or restarts else "")


def state_of(driver: "Driver") -> Shown:
    """Return the state of a driver's robot."""
    model, seen = driver.model, driver.link.statistics
    return Shown(
        f"{'virtual ' if driver.board.virtual else ''}{model.name if model else 'robot'} {driver.board.robot_id}",
        model,
        driver.pose,
        driver.twist,
        driver.command,
        driver.stop_reason,
        driver.ranges,
        sensor_texts(driver),
        driver.board.battery_v,
        model.battery.charge(driver.board.battery_v) if model else 0.0,
        driver.battery_state,
        _board(driver),
        driver.ready,
        driver.link.age_s,
        errors_row(seen.lost, sum(seen.garbage.values()), seen.restarts),
        "" if driver.imu_state == ABSENT else driver.imu_state,
    )


def _imu(driver: "Driver") -> Sequence[Row]:
    """Return the row of the IMU; none if the board has, and had, none."""
    state, imu = driver.imu_state, driver.imu
    if state == ABSENT and imu is None:
        return []
    if state == IN_USE and imu is not None:
        return [Row("imu", f"{state}, bias {math.degrees(imu.bias_rad_s):+.2f} deg/s")]
    if state == LEARNING:
        return [Row("imu", f"{state}: stand still", "yellow")]
    return [Row("imu", f"{state}: wheels alone", "bold red" if state in REASONS else "")]


def _board(driver: "Driver") -> Sequence[Row]:
    status = driver.status
    if status is None:
        return [Row("firmware", "1 (2013), no watchdog" if has_motors(driver.model) else "1 (2013)")]
    faults = ", ".join(status.faults).replace("_", " ")
    warm = "" if math.isnan(driver.board.temperature_c) else f", {driver.board.temperature_c:.0f} degC"
    up = f"up {_span(status.uptime_s)}{warm}"
    return [
        Row("firmware", f"{driver.board.version}, {up}"),
        *([Row("last stop", status.stop_reason.words)] if has_motors(driver.model) else []),
        Row("faults", faults or "none", "bold red" if faults else ""),
        *_imu(driver),
        *_inputs(driver),
    ]


def _inputs(driver: "Driver") -> Sequence[Row]:
    inputs = driver.inputs
    if inputs is None:
        return []
    return [Row("inputs", str(inputs), "bold red" if inputs.active or inputs.latched else "")]


def _span(seconds: int) -> str:
    if seconds < 600:
        return f"{seconds} s"
    return f"{seconds // 60} min" if seconds < 36000 else f"{seconds // 3600} h"


def sensor_texts(driver: "Driver") -> Dict[str, str]:
    """Return the reading of each sensor that answers as text, by name, such as `500 count`."""
    return {name: text(SENSOR_BY_NAME[name], found) for name, found in driver.sensors.items()}


def moves_sideways(model: Optional[RobotModel]) -> bool:
    """Return whether a robot can move sideways."""
    return model is not None and drives.moves_sideways(model.drive)


def has_motors(model: Optional[RobotModel]) -> bool:
    """Return whether the board has motors; True while the model is unknown."""
    return model is None or model.drives


def has_odometry(model: Optional[RobotModel]) -> bool:
    """Return whether the board measures how the robot moves; True while the model is unknown."""
    return model is None or model.has_odometry


def range_text(value_m: float) -> str:
    """Return a range as text."""
    if math.isnan(value_m):
        return "no reading"
    if math.isinf(value_m):
        return "nothing" if value_m > 0 else "too close"
    return f"{value_m:.2f} m"


def _fixed(value: float, width: int, digits: int) -> str:
    """Return a number of fixed width; one that rounds to zero has no sign."""
    return f"{round(value, digits) + 0.0:{width}.{digits}f}"


def line_of(state: Shown) -> str:
    """Return pose, speeds, ranges, battery and other sensors in one line; without motors the sensors alone."""
    ranges = "".join(f"{name} {range_text(value)}  " for name, value in state.ranges.items())
    sensors = "".join(f"  {name} {value}" for name, value in state.sensors.items())
    silent = "" if state.ready else "  NO TELEMETRY"
    if not has_motors(state.model):
        return f"{state.name}{sensors or '  no reading yet'}{silent}"
    return (
        f"{_motion_text(state)}  {ranges}battery {voltage_text(state.battery_v)} ({state.battery_state})"
        + sensors
        + (f"  imu {state.imu}" if state.imu else "")
        + silent
    )


def _motion_text(state: Shown) -> str:
    if not has_odometry(state.model):
        return f"odometry {NO_ODOMETRY}"
    pose, twist, yaw_deg = state.pose, state.twist, math.degrees(state.pose.yaw_rad)
    aside = f"sideways {_fixed(twist.lateral_m_s, 6, 3)} m/s  " if len(twist) == 3 else ""
    return (
        f"x {_fixed(pose.x_m, 7, 3)} m  y {_fixed(pose.y_m, 7, 3)} m  yaw {_fixed(yaw_deg, 7, 2)} deg  "
        f"v {_fixed(twist.linear_m_s, 6, 3)} m/s  {aside}w {_fixed(twist.angular_rad_s, 6, 3)} rad/s"
    )


def line(driver: "Driver") -> str:
    """Return pose, speeds, ranges and battery in one line."""
    return line_of(state_of(driver))


def snapshot(driver: "Driver") -> Dict[str, Any]:
    """Return the robot's state and the state of the link, for JSON; SI units, with the unit at the end of the key.

    Without odometry there is no pose and no twist.
    """
    seen, command, counts = driver.link.statistics, driver.command, has_odometry(driver.model)
    imu: Dict[str, Any] = {"state": driver.imu_state}
    if driver.imu is not None:
        imu["angular_velocity_rad_s"] = driver.imu.angular_velocity_rad_s
        imu["linear_acceleration_m_s2"] = driver.imu.linear_acceleration_m_s2
        imu["bias_rad_s"] = driver.imu.bias_rad_s if driver.imu.bias_known else None
    return {
        "pose": driver.pose._asdict() if counts else None,
        "twist": driver.twist._asdict() if counts else None,
        "command": command._asdict() if command else None,
        "ranges_m": driver.ranges,
        "sensors": {name: list(found.values) for name, found in driver.sensors.items()},
        "imu": imu,
        "active_inputs": driver.inputs.active if driver.inputs else (),
        "battery_v": driver.board.battery_v,
        "battery_state": driver.battery_state,
        "temperature_c": driver.board.temperature_c,
        "ready": driver.ready,
        "age_s": driver.link.age_s,
        "link_delay_s": driver.link.delay_s,
        "stop_reason": driver.stop_reason,
        "frames": seen.frames,
        "lost": seen.lost,
        "garbage": dict(seen.garbage),
        "refused_counts": seen.refused_counts,
        "restarts": seen.restarts,
        "uncommanded_motions": seen.uncommanded_motions,
    }
