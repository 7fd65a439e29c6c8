"""A robot behind ROS topics, as live views show it.  Imports no ROS: messages go in, speeds go out."""

import math
import re
import time
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Range, Temperature

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot import models
from mrl_driver.robot.models import Limits, RobotModel
from mrl_driver.robot.odometry import AnyTwist, OmniTwist, Twist
from mrl_driver.robot.sonar import NAMES
from mrl_driver.safety.protective_zones import stale_s
from mrl_driver.view.shown_state import SILENT_S, Row, Shown, errors_row, moves_sideways
from ros1_bridge.node.plane_poses import planar

from .messages import range_of

LOW_SHARE = 0.1  # With a lower charge the battery is shown as low
STILL_M_S, STILL_RAD_S = 0.005, 0.02  # A slower robot stands
LINK, MOTION = "Link", "Motion"  # Diagnostics of the serial link, and of the motion
DRIVING = "driving"  # What `status` says while a command other than standstill is in force
NO_STOP = (StopReason.NONE, StopReason.USER)
"""Stop reasons of a robot that was not stopped, or that a user has stopped."""


class LinkDelays(NamedTuple):
    """Delays of the topics, as `Driver.link` has those of the serial link."""

    age_s: float  # Age of the newest odometry [s]; infinite before the first
    delay_s: float  # Time from sending speeds to the echo of the robot's node [s]; NaN if unknown


class TopicRobot:
    """Keeps the newest messages of a robot; has what a live view uses of a Driver."""

    mismatch = recorder = None
    warning = ""

    def __init__(
        self,
        publish: Callable[..., None],
        ended: Callable[[], bool],
        robot: str,
        delay: Callable[[], float] = lambda: math.nan,
        node: str = "",
    ) -> None:
        """`publish` sends speeds [m/s, rad/s], and for a robot that can move sideways the one to the left [m/s].

        `robot` is a model's name or file, or auto: by the board's id.
        `delay` returns the time from sending to the echo of the robot's node [s], NaN if unknown.  `node` is the full
        name of that node, whose diagnostics count; empty for those of any node.
        """
        self._publish, self._ended, self._delay, self._node = publish, ended, delay, node.strip("/")
        self.model: Optional[RobotModel] = None if robot == "auto" else models.load(robot)
        self.pose: Pose = ORIGIN
        self.stamp_s = math.nan  # Of the newest odometry [s]; NaN if it has none
        self.twist: AnyTwist = Twist(0.0, 0.0)
        self.command: Optional[AnyTwist] = None
        self.battery_v = self._charge = self.temperature_c = math.nan
        self.notice = ""  # Why the robot does not drive, as its node says; empty while it may
        self.status: Mapping[str, str] = {}  # Keys and values of the newest status; empty before the first
        self.driving = False  # The robot's node follows a command other than standstill
        self._ranges: Dict[str, Tuple[float, float]] = {}
        self._link: Mapping[str, str] = {}
        self._motion: Mapping[str, str] = {}
        self._heard_s = self._moved_s = -math.inf
        self._subscribe_range: Callable[[str], None] = lambda name: None
        self._listeners: List[Callable[[Any], None]] = []
        self._told: List[Callable[[], None]] = []

    def on_telemetry(self, listener: Callable[[Any], None]) -> None:
        """Call `listener` after each odometry message, with an object that has the `pose` and `stamp_s`."""
        self._listeners.append(listener)

    def after_status(self, listener: Callable[[], None]) -> None:
        """Call `listener` after each status message."""
        self._told.append(listener)

    def subscribe(self, subscriber: Callable[..., Any]) -> None:
        """Subscribe to the robot's topics; `subscriber` is rospy.Subscriber."""
        subscriber("odom", Odometry, self.on_odometry, queue_size=50, tcp_nodelay=True)
        subscriber("battery_state", BatteryState, self.on_battery, queue_size=1)
        subscriber("board_temperature", Temperature, self.on_temperature, queue_size=1)
        subscriber("status", DiagnosticStatus, self.on_status, queue_size=10, tcp_nodelay=True)
        subscriber("/diagnostics", DiagnosticArray, self.on_diagnostics, queue_size=10)
        self._subscribe_range = lambda name: subscriber(
            f"sonar/{name}", Range, self.on_range, callback_args=name, queue_size=1
        )
        for name in self.model.sonars if self.model is not None else NAMES:
            self._subscribe_range(name)

    def on_event(self, listener: Callable[[Any], None]) -> None:
        """Do nothing: there are no events."""

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> None:
        """Publish speeds; the last one if the robot can move sideways."""
        twist = Twist(linear_m_s, angular_rad_s)
        self.command = OmniTwist(*twist, lateral_m_s) if moves_sideways(self.model) else twist
        self._publish(*self.command)

    def stop(self) -> None:
        """Publish a stop."""
        self.command = None
        self._publish(0.0, 0.0)

    def wait(self, seconds: float) -> bool:
        """Return whether the node ends."""
        return self._ended()

    @property
    def now_s(self) -> float:
        """The clock of this robot's times [s]."""
        return time.monotonic()

    @property
    def ranges(self) -> Dict[str, float]:
        """The last range of each sonar (REP 117) [m]; NaN if it is older than `stale_s`."""
        oldest_s = time.monotonic() - stale_s(self.model.sonars if self.model is not None else {})
        return {name: m if at_s >= oldest_s else math.nan for name, (m, at_s) in self._ranges.items()}

    @property
    def stands_s(self) -> float:
        """How long odometry says that the robot stands [s]; 0 if it moves, or if odometry is older than `SILENT_S`."""
        return (
            self._heard_s - self._moved_s if self.age_s < SILENT_S and self._moved_s < self._heard_s else 0.0
        )

    @property
    def stop_reason(self) -> StopReason:
        """Why the robot stopped, as its node says (`stopped by`); `none` if it did not stop or is not known."""
        return StopReason(self.status.get("stopped by", "none"))

    @property
    def limits(self) -> Optional[Limits]:
        """The speed limits that the robot's node applies; the model's before it has said them; None without a model."""
        own = self.model.limits if self.model is not None else None
        try:
            linear, angular = (
                float(self._motion[f"{name} Speed Limit"].split()[0]) for name in ("Linear", "Angular")
            )
        except (KeyError, IndexError, ValueError):
            return own
        return own._replace(linear_m_s=linear, angular_rad_s=angular) if own is not None else None

    @property
    def battery_state(self) -> str:
        """`ok` or `low`."""
        return "low" if self._charge < LOW_SHARE else "ok"

    @property
    def age_s(self) -> float:
        """Age of the newest odometry [s]; infinite before the first."""
        return time.monotonic() - self._heard_s

    @property
    def link(self) -> LinkDelays:
        """Delays of the topics now."""
        return LinkDelays(self.age_s, self._delay())

    @property
    def errors(self) -> int:
        """Number of errors on the serial link."""
        return int(self._link.get("Errors", "0"))

    def on_odometry(self, message: Any) -> None:
        """Take a nav_msgs/Odometry; one that is not finite, as of a filter that diverges, counts as none."""
        linear, angular = message.twist.twist.linear, message.twist.twist.angular.z
        try:
            pose = planar(message.pose.pose)
        except ValueError:
            return
        if not math.isfinite(linear.x + linear.y + angular):
            return
        self.pose, self.stamp_s = pose, message.header.stamp.to_sec() or math.nan
        self.twist = (
            OmniTwist(linear.x, angular, linear.y) if moves_sideways(self.model) else Twist(linear.x, angular)
        )
        now_s = time.monotonic()
        if self.age_s >= SILENT_S or math.hypot(linear.x, linear.y) > STILL_M_S or abs(angular) > STILL_RAD_S:
            self._moved_s = now_s
        self._heard_s = now_s
        for listener in self._listeners:
            listener(self)

    def on_range(self, message: Any, name: str) -> None:
        """Take a sensor_msgs/Range of a sonar."""
        self._ranges = {**self._ranges, name: (range_of(message), time.monotonic())}

    def on_battery(self, message: Any) -> None:
        """Take a sensor_msgs/BatteryState."""
        self.battery_v, self._charge = message.voltage, message.percentage

    def on_temperature(self, message: Any) -> None:
        """Take the sensor_msgs/Temperature of the motor board."""
        self.temperature_c = message.temperature

    def on_status(self, message: Any) -> None:
        """Take the diagnostic_msgs/DiagnosticStatus of the robot's state."""
        self.notice = message.message if message.level else ""
        self.status = {pair.key: pair.value for pair in message.values}
        self.driving = message.message == DRIVING
        for listener in self._told:
            listener()

    def on_diagnostics(self, message: Any) -> None:
        """Take a diagnostic_msgs/DiagnosticArray."""
        for status in message.status:
            node, _, part = status.name.rpartition(": ")
            if self._node and node != self._node:
                continue
            if part == LINK:
                self._link = {pair.key: pair.value for pair in status.values}
                if self.model is None:
                    self.model = _model_of(self._link.get("Device ID", ""))
                    for name in set(self.model.sonars if self.model else ()).difference(NAMES):
                        self._subscribe_range(name)
            elif part == MOTION:
                self._motion = {pair.key: pair.value for pair in status.values}

    def state(self) -> Shown:
        """Return the state now."""
        link, age_s = self._link, self.age_s
        virtual = "virtual " if "virtual" in link.get("Capabilities", "").split(", ") else ""
        board = [Row("firmware", link["Firmware Version"]), Row("port", link["Serial Port"])] if link else []
        return Shown(
            f"{virtual}{self.model.name if self.model else 'robot'} {link.get('Device ID', '')}".rstrip(),
            self.model,
            self.pose,
            self.twist,
            self.command,
            StopReason.DRIVEN_ELSEWHERE if self.driving and self.command is None else self.stop_reason,
            self.ranges,
            {},
            self.battery_v,
            self._charge,
            self.battery_state,
            board,
            age_s < SILENT_S,
            age_s,
            errors_row(
                int(link.get("Lost Frames", "0")),
                sum(map(int, re.findall(r"\d+", link.get("Garbage", "")))),
                int(link.get("Restarts", "0")),
            ),
        )


def _model_of(robot_id: str) -> Optional[RobotModel]:
    """Return the model that lists an id; None if none does."""
    try:
        name = models.by_id(int(robot_id))
        return models.load(name) if name else None
    except (ValueError, ConfigError):
        return None
