"""Passes a robot's telemetry and laser scans to its protective zones.

It imports no ROS before the first scan; then it looks up once in tf where the laser is mounted on the robot.
"""

import math
from typing import Any, Optional

from mrl_driver.errors import ConfigError, one_line
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.odometry import AnyTwist, Twist
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.safety.protective_zones import Scan, Zones
from mrl_driver.yaml_file import short
from ros1_bridge.node.plane_poses import transform_pose
from ros1_bridge.node.robot_parameters import Parameters
from ros1_bridge.node.stamp_age import StampAge

LONGEST_S = 0.5  # after a longer gap between two frames, the distance driven meanwhile is unknown
SCAN_OLD_S = 0.5
"""An older scan is not used [s]; that of a slow laser, with five turns a second, is 0.2 s old when it is complete."""


def assumed_twist(driver: Any, telemetry: Telemetry) -> AnyTwist:
    """Return the measured speeds of a driver's robot; those of the command in force if the motors have no encoders."""
    if driver.model.has_odometry:
        return telemetry.twist
    command: Optional[AnyTwist] = driver.command
    return command or Twist(0.0, 0.0)


class ZoneWatch:
    """The zones of one robot, and the readings passed to them."""

    def __init__(self, parameters: Parameters, model: RobotModel, build_assumed: bool = False) -> None:
        """`parameters`: those of robot_node, with `zones` other than none.  `build_assumed`: see `assumes_sonars`.

        Raises:
            ConfigError: the zones need sonars, and the board has none, or it is not known to have any.
        """
        by_sonar = parameters.zones_by_sonar
        if by_sonar and build_assumed:
            raise ConfigError(
                f"parameter zones is {parameters.zones}, but this board of 2013 does not report whether it has sonars "
                "or gas sensors, which would look like ranges; set parameter build to sonar or environment"
            )
        if by_sonar and not model.sonars:
            raise ConfigError(
                f"parameter zones is {parameters.zones}, but this board has no sonars, expected scan or none"
            )
        settings = parameters.zone_settings(model.limits.linear_acceleration_m_s2)
        self.zones = Zones(settings, model.body, model.sonars if by_sonar else {}, parameters.zones_by_laser)
        self._stamp_s: Optional[float] = None
        self._scan_age, self._inf_is_free = StampAge(SCAN_OLD_S), parameters.zone_inf_is_free

    def on_telemetry(self, telemetry: Telemetry, standing: bool) -> None:
        """Pass on the distance and the new ranges of a frame; if the robot stands still, check the zones ahead."""
        zones, before, now = self.zones, self._stamp_s, telemetry.arrival_s
        self._stamp_s = telemetry.stamp_s
        if before is not None and telemetry.stamp_s - before < LONGEST_S:
            dt_s = telemetry.stamp_s - before
            zones.moved(telemetry.twist[0] * dt_s, now, sum(telemetry.twist[2:]) * dt_s)
        for name in telemetry.fresh:
            zones.on_range(name, telemetry.ranges[name], now)
        if standing:
            zones.limit(0.0, now)

    def on_scan(self, message: Any, mount: Pose, clock_s: float, now: float) -> str:
        """Pass on a sensor_msgs/LaserScan; the laser is at `mount`: x, y, yaw in base_frame [m m rad].

        `clock_s` is the clock of its stamp.  Returns why the scan is ignored; empty if it is not.
        """
        age, rays = self._scan_age, (message.ranges, message.angle_min, message.angle_increment)
        far_m = message.range_max if message.range_max > 0 else math.inf  # 0: the driver does not say it
        scan = Scan(*rays, message.range_min, mount, far_m, self._inf_is_free)
        return age.trouble(message.header.stamp.to_sec(), clock_s, now) or self.zones.on_scan(
            scan, age.made_s
        )


def mount_of(transform: Any) -> Pose:
    """x, y, yaw of a geometry_msgs/Transform from base_frame to a laser; ValueError if it is tilted or upside down."""
    turn = transform.rotation
    if math.hypot(turn.x, turn.y) > 0.05:
        raise ValueError("the laser is tilted or upside down, expected one that lies flat and upright")
    return transform_pose(transform)


class MountFinder:
    """Listens to tf from the first call until the mount is known; a mount does not change."""

    def __init__(self, base_frame: str) -> None:
        self._base = base_frame
        self._buffer: Any = None
        self._listener: Any = None
        self._mount: Optional[Pose] = None
        self._frame = ""
        self.trouble = ""  # why the mount is not known

    def mount(self, frame: str) -> Optional[Pose]:
        """x, y, yaw of `frame` in base_frame [m m rad].

        None if it is unknown, or if the first scan had another frame; `trouble` says why.
        """
        if self._mount is None:
            self._look(frame)
        elif frame != self._frame:
            expected = f"expected {short(self._frame)} as before: the zones watch one laser"
            self.trouble = f"it is in frame {short(frame)}, {expected}"
            return None
        return self._mount

    def _look(self, frame: str) -> None:
        import tf2_ros  # late: most robots have no laser, and their node does not load tf
        from genpy import Time

        if self._buffer is None:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer)
        try:
            found = self._buffer.lookup_transform(self._base, frame, Time())
            mount = mount_of(found.transform)
            if not all(map(math.isfinite, mount)):
                raise ValueError(f"tf has it at {mount}, expected finite numbers")
        except (tf2_ros.TransformException, ValueError) as error:
            self.trouble = f"frame {short(frame)} has no place on the robot: {one_line(str(error))}"
            return
        self._mount, self._frame = mount, frame
        self._listener.unregister()
        self._listener = None
