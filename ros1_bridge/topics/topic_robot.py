"""A robot behind ROS topics, for the live view.  Imports no ROS: messages go in, speeds go out."""

import math
import time
from typing import Any, Callable, Dict, List, Mapping, Optional

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN, Pose, yaw_of
from mrl_driver.robot import models
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.odometry import Twist
from mrl_driver.view.shown_state import Row, ShownState

STALE_S = 0.3
LOW_SHARE = 0.1
"""With a lower charge the battery is shown as low."""
LINK = ": Link"
"""End of the name of the diagnostics of the serial link."""


class TopicRobot:
    """Keeps the newest messages of a robot; has what the live view uses of a Driver."""

    mismatch = recorder = None
    warning = ""

    def __init__(
        self,
        publish: Callable[[float, float], None],
        ended: Callable[[], bool],
        robot: str,
        delay: Callable[[], float] = lambda: math.nan,
    ) -> None:
        """`publish` sends speeds [m/s, rad/s]; `robot` is a model's name or file, or auto: by the board's id.

        `delay` returns the time from sending to the echo of the robot's node [s], NaN if unknown.
        """
        self._publish, self._ended, self._delay = publish, ended, delay
        self.model: Optional[RobotModel] = None if robot == "auto" else models.load(robot)
        self.pose, self.twist = ORIGIN, Twist(0.0, 0.0)
        self.command: Optional[Twist] = None
        self.ranges: Dict[str, float] = {}
        self.battery_v = self._charge = math.nan
        self.notice = ""
        """Why the robot does not drive, as its node says; empty while it may."""
        self._link: Mapping[str, str] = {}
        self._heard_s = -math.inf
        self._listeners: List[Callable[[Any], None]] = []

    def on_telemetry(self, listener: Callable[[Any], None]) -> None:
        """Call `listener` after each odometry message, with an object that has the `pose`."""
        self._listeners.append(listener)

    def on_event(self, listener: Callable[[Any], None]) -> None:
        """Do nothing: there are no events."""

    def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Publish speeds."""
        self.command = Twist(linear_m_s, angular_rad_s)
        self._publish(linear_m_s, angular_rad_s)

    def stop(self) -> None:
        """Publish a stop."""
        self.command = None
        self._publish(0.0, 0.0)

    def wait(self, seconds: float) -> bool:
        """Return whether the node ends."""
        return self._ended()

    @property
    def battery_state(self) -> str:
        """`ok` or `low`."""
        return "low" if self._charge < LOW_SHARE else "ok"

    @property
    def age_s(self) -> float:
        """Age of the newest odometry [s]; infinite before the first."""
        return time.monotonic() - self._heard_s

    @property
    def link_delay_s(self) -> float:
        """Time from sending speeds to the echo of the robot's node [s]; NaN if unknown."""
        return self._delay()

    @property
    def errors(self) -> int:
        """Number of errors on the serial link."""
        return int(self._link.get("Errors", "0"))

    def on_odometry(self, message: Any) -> None:
        """Take a nav_msgs/Odometry."""
        at, turn, twist = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
        self.pose = Pose(at.x, at.y, yaw_of(turn.x, turn.y, turn.z, turn.w))
        self.twist = Twist(twist.linear.x, twist.angular.z)
        self._heard_s = time.monotonic()
        for listener in self._listeners:
            listener(self)

    def on_range(self, message: Any, name: str) -> None:
        """Take a sensor_msgs/Range of a sonar."""
        self.ranges = {**self.ranges, name: message.range}

    def on_battery(self, message: Any) -> None:
        """Take a sensor_msgs/BatteryState."""
        self.battery_v, self._charge = message.voltage, message.percentage

    def on_status(self, message: Any) -> None:
        """Take the diagnostic_msgs/DiagnosticStatus of the robot's state."""
        self.notice = message.message if message.level else ""

    def on_diagnostics(self, message: Any) -> None:
        """Take a diagnostic_msgs/DiagnosticArray."""
        for status in message.status:
            if status.name.endswith(LINK):
                self._link = {pair.key: pair.value for pair in status.values}
                self.model = self.model or _model_of(self._link.get("Device ID", ""))

    def state(self) -> ShownState:
        """Return the state now."""
        link, age_s = self._link, self.age_s
        board = [Row("firmware", link["Firmware Version"]), Row("port", link["Serial Port"])] if link else []
        return ShownState(
            f"{self.model.name if self.model else 'robot'} {link.get('Device ID', '')}".rstrip(),
            self.model,
            self.pose,
            self.twist,
            self.command,
            "none",
            self.ranges,
            {},
            self.battery_v,
            self._charge,
            self.battery_state,
            board,
            age_s < STALE_S,
            age_s,
            Row(
                "errors",
                f"{self.errors}, {link.get('Lost Frames', '0')} lost",
                "yellow" if self.errors else "",
            ),
        )


def _model_of(robot_id: str) -> Optional[RobotModel]:
    """Return the model that lists an id; None if none does."""
    try:
        name = models.by_id(int(robot_id))
        return models.load(name) if name else None
    except (ValueError, ConfigError):
        return None
