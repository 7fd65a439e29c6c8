"""ROS node `mirror_node`: puts a real robot into the world of emulated ones, and adds their echoes to its ranges.

The robot is driven by `robot_node` or by any other driver that publishes `odom`.  It appears in a world that `mrl-sim`
processes share by name, at its odometry from a start pose, or at a localised pose.  Each range on `sonar/...` is
published again on `mirror/sonar/...`: the closer of real and virtual.  `mirror/scan` has the virtual robots alone, in
the directions that the sonars watch, so that the zones of `robot_node` can add them to the real sonars; with `~laser`
it is the closer of `scan` and virtual.

What is not known is not free.  If the odometry is silent, or the robot is not localised, all ranges are NaN and no scan
is published, but the robot stays in the world, so that others avoid it.
"""

import contextlib
import math
import threading
import time
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np
import rospy
import tf2_ros
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan, Range
from std_msgs.msg import Header

from mrl_driver.errors import ConfigError, one_line
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot import models
from mrl_driver.robot.models import SonarMount
from mrl_driver.safety.free_distance import BESIDE_RAD
from mrl_driver.safety.protective_zones import STALE_S
from mrl_driver.yaml_file import short
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.plane_poses import correction, planar, transform_pose
from ros1_bridge.node.run_node import node
from ros1_bridge.node.stamp_age import StampAge
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.hardware.laser import Laser
from sim_arduino.hardware.mirror import Margin, Mirror
from sim_arduino.hardware.sonars import RANGE_M
from sim_arduino.world import world_file
from sim_arduino.world.shared_robots import SharedRegistry
from sim_arduino.world.world import World

from .world_node import scan_of

RATE_HZ = 10.0
RAY_RAD = math.radians(1.0)
LASER_NEAR_M = 0.02
ODOM_LATE_S = 0.5
"""If odometry is older than this, the place of the robot is not known."""
PLACE_LATE_S = 2.0
"""The frame of the map must be on tf within this time; amcl and gmapping repeat it many times a second."""
JUMP_M = 0.5
"""Odometry that moves farther between two messages began again."""
STATUS_S = 1.0
WARN_EVERY_S = 5.0
START, POSE, TF = "start", "pose", "tf"
_PLACE = "Place of the robot: start is ~pose and odometry, pose the topic amcl_pose, tf the frame of the map"
_MARGIN = "Virtual obstacles are this much closer, for the error of the place"
_DRIFT = "The margin grows by this share of the distance driven since then"
PARAMETERS = (
    Row("world_name", str, "world", "", "Name under which the boards share the world"),
    Row("name", str, "real", "", "Name of the robot in that world"),
    Row("robot", str, "traxbot", "", "Model, or path of a robot's .yaml file, that has body and sonars"),
    Row("footprint", str, "box", "", "Body from above: box is the model's, circle:RADIUS is round [m]"),
    Row("pose", str, "0,0,0", "", "Pose in the world at which the odometry is 0: x, y [m], yaw [deg]"),
    Row("localisation", str, START, "", _PLACE, choices=(START, POSE, TF)),
    Row("map_frame", str, "map", "", "Frame of the world, for a localised robot"),
    Row("margin", float, Margin().start_m, "m", _MARGIN, 0.0, 5.0),
    Row("drift", float, Margin().share, "", _DRIFT, 0.0, 1.0),
    Row(
        "laser", bool, False, "", "The robot has a laser on scan: mirror/scan is the closer of it and virtual"
    ),
    Row("walls", bool, False, "", "The walls of ~world are obstacles too; the real sonars see the real ones"),
    Row(
        "world", str, "room", "", "Name of a world, or path of a .yaml file; its parked robots are obstacles"
    ),
)
"""The node's private parameters."""


def arc_of(sonars: Sequence[SonarMount]) -> Tuple[float, float]:
    """First and last direction of the arc around straight ahead that sonars watch without a gap [rad].

    It is where a scan may say that nothing is there.  If no sonar looks ahead, the arc is that of the most forward one.
    """
    cones = sorted((each.pose.yaw_rad, each.kind.field_of_view_rad / 2) for each in sonars)
    yaw_rad, half_rad = min(cones, key=lambda cone: abs(cone[0]))
    first, last = yaw_rad - half_rad, yaw_rad + half_rad
    for yaw_rad, half_rad in cones:
        if yaw_rad - half_rad <= last + 2 * BESIDE_RAD:
            last = max(last, yaw_rad + half_rad)
    for yaw_rad, half_rad in reversed(cones):
        if yaw_rad + half_rad >= first - 2 * BESIDE_RAD:
            first = min(first, yaw_rad - half_rad)
    return first, last


class Place:
    """Where the odometry of the robot begins in the world, if it is known.  No locks: the node has one."""

    def __init__(self, localisation: str, map_frame: str, start: Pose, buffer: tf2_ros.Buffer) -> None:
        self._localisation, self._map, self._buffer = localisation, map_frame, buffer
        self.origin: Optional[Pose] = start if localisation == START else None
        self.trouble = "" if localisation == START else f"not localised yet: no {localisation}"
        """Why the place is not known; empty if it is."""
        self._pose: Optional[Tuple[Pose, rospy.Time]] = None

    def localised(self, message: PoseWithCovarianceStamped) -> None:
        """Take a localised pose; ValueError if it has another frame, or is not finite."""
        if message.header.frame_id != self._map:
            raise ValueError(f"frame is {short(message.header.frame_id)}, expected {self._map!r}")
        self._pose = planar(message.pose.pose), message.header.stamp

    def update(self, odometry: Odometry) -> Optional[Pose]:
        """A new origin, if there is one since the last call."""
        before = self.origin
        odom, base = odometry.header.frame_id, odometry.child_frame_id
        try:
            if self._localisation == TF:
                found = self._buffer.lookup_transform(self._map, odom, rospy.Time())
                age_s = (rospy.Time.now() - found.header.stamp).to_sec()
                if found.header.stamp != rospy.Time() and age_s > PLACE_LATE_S:  # zero: it is static
                    self.origin, self.trouble = None, f"{self._map} to {odom} is {age_s:.1f} s old"
                    return None
                self.origin = transform_pose(found.transform)
            elif self._pose is not None:
                place, stamp = self._pose
                self._pose = None
                self.origin = correction(place, self._odometry_at(odom, base, stamp, odometry))
        except (tf2_ros.TransformException, ValueError) as error:
            self.origin, self.trouble = None, f"not localised: {error}"
            return None
        if self.origin is not None:
            self.trouble = ""
        return self.origin if self.origin != before else None

    def _odometry_at(self, odom: str, base: str, stamp: rospy.Time, now: Odometry) -> Pose:
        """Odometry at the time of the localised pose; if tf does not have it, the last one."""
        with contextlib.suppress(tf2_ros.TransformException):
            return transform_pose(self._buffer.lookup_transform(odom, base, stamp).transform)
        return planar(now.pose.pose)


def _send(publisher: rospy.Publisher, message: Any) -> None:
    """Publish, unless the shutdown has closed the topic meanwhile; it does so before `is_shutdown` is true."""
    try:
        publisher.publish(message)
    except rospy.ROSException:
        if not rospy.core.is_shutdown_requested():
            raise


class MirrorNode:
    """One real robot in a shared world."""

    def __init__(self, given: Dict[str, Any]) -> None:
        """Puts the robot into the world at its first odometry; ConfigError if it has no body, or its name is taken."""
        start = world_file.parse_pose(given["pose"], ORIGIN)
        self._name, self._laser = given["name"], given["laser"]
        self._model = models.load(given["robot"])
        self._join(given, start)
        self._lock = threading.Lock()  # guards mirror, world and the next lines
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._place = Place(given["localisation"], given["map_frame"], start, self._buffer)
        self._odometry: Optional[Odometry] = None
        self._odometry_age = StampAge(ODOM_LATE_S)
        self._range_ages = {name: StampAge(STALE_S) for name in self._model.sonars}
        self._mounts: Dict[str, SonarMount] = {}
        self._heard: Dict[str, Range] = {}
        self._laser_mount: Optional[Pose] = None
        self._said: Optional[bool] = None
        self._rival = ""
        self._status_out = rospy.Publisher("mirror/status", DiagnosticStatus, queue_size=10, latch=True)
        fast = {"queue_size": 1, "tcp_nodelay": True}
        self._ranges_out = {
            name: rospy.Publisher(f"mirror/sonar/{name}", Range, **fast) for name in self._model.sonars
        }
        self._scan_out = rospy.Publisher("mirror/scan", LaserScan, **fast)
        if given["localisation"] == POSE:
            rospy.Subscriber("amcl_pose", PoseWithCovarianceStamped, self._on_pose, queue_size=1)
        rospy.Subscriber("odom", Odometry, self._on_odometry, **fast)
        for name in self._model.sonars:
            rospy.Subscriber(f"sonar/{name}", Range, self._on_range, callback_args=name, queue_size=1)
        rospy.Subscriber("mirror/scan", rospy.AnyMsg, self._on_own_scan, queue_size=1)
        if self._laser:
            rospy.Subscriber("scan", LaserScan, self._on_scan, **fast)

    def _join(self, given: Dict[str, Any], start: Pose) -> None:
        """Puts the robot into the world."""
        footprint = footprint_for(self._model, given["footprint"])
        if footprint is None:
            raise ConfigError(
                f"robot {given['robot']} with footprint {given['footprint']} has no body, "
                "expected a ~footprint such as circle:0.2"
            )
        self._world: World = world_file.load(given["world"])
        self._registry = self._world.registry = SharedRegistry(given["world_name"])
        if not given["walls"]:
            self._world = self._world.without_walls()
        margin = Margin(given["margin"], given["drift"])
        self._mirror = Mirror(self._world, self._name, footprint, start, margin)
        self._mirror.moved(*ORIGIN)
        if given["localisation"] != START:  # its name is free; its place is not known yet
            self._mirror.close()
            self._mirror.locate(start)

    def run(self) -> None:
        """Publish scans, silent sonars and the status until the shutdown."""
        due_s = -math.inf
        rate = rospy.Rate(RATE_HZ, reset=True)
        while not rospy.is_shutdown():
            now_s = time.monotonic()
            with self._lock:
                trouble = self._trouble(now_s)
                silent = [name for name in self._heard if now_s - self._range_ages[name].made_s > STALE_S]
                scan = self._virtual_scan() if not (self._laser or trouble) else None
            for name in silent:
                self._publish(name, self._heard[name], math.nan, rospy.Time.now())
            if scan is not None:
                _send(self._scan_out, scan)
            if bool(trouble) != self._said or now_s >= due_s:
                due_s = now_s + STATUS_S
                self._tell(trouble, silent)
            rate.sleep()

    def close(self) -> None:
        """Take the robot out of the world."""
        with self._lock:
            self._mirror.close()
            self._registry.close()

    def _trouble(self, now_s: float) -> str:
        """Why the place of the robot in the world is not known now; empty if it is.  With the lock."""
        if self._rival:
            return self._rival
        if self._odometry is None:
            return "no odometry yet"
        silent_s = now_s - self._odometry_age.made_s
        if silent_s > ODOM_LATE_S:
            return f"no odometry for {silent_s:.0f} s"
        return self._place.trouble

    def _on_odometry(self, message: Odometry) -> None:
        try:
            pose = planar(message.pose.pose)
        except ValueError as error:
            rospy.logwarn_throttle(WARN_EVERY_S, f"odometry not used: {error}")
            return
        with self._lock:
            if not self._is_fresh(self._odometry_age, message, "odometry"):
                return
            before, self._odometry = self._odometry, message
            origin = self._place.update(message)
            if origin is not None:
                self._mirror.locate(origin)
            elif before is not None:
                self._warn_of_jump(planar(before.pose.pose), pose)
            if not self._place.trouble:
                self._mirror.moved(*pose)

    def _is_fresh(self, age: StampAge, message: Any, what: str) -> bool:
        """Whether a message may be used, by its stamp; log why not."""
        trouble = age.trouble(message.header.stamp.to_sec(), rospy.get_time(), time.monotonic())
        if trouble:
            rospy.logwarn_throttle(WARN_EVERY_S, f"{what} not used: {trouble}")
        return not trouble

    def _warn_of_jump(self, before: Pose, pose: Pose) -> None:
        jump_m = math.dist(before[:2], pose[:2])
        if jump_m > JUMP_M:
            rospy.logwarn(
                f"odometry jumped by {jump_m:.2f} m, and with it the robot in the world: if it began again elsewhere "
                "than at ~pose, start this node again"
            )

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        try:
            with self._lock:
                self._place.localised(message)
        except ValueError as error:
            rospy.logwarn_throttle(WARN_EVERY_S, f"pose not used: {error}")

    def _on_own_scan(self, message: rospy.AnyMsg) -> None:
        """Notice another publisher: zones that get both scans would miss what only one of them has."""
        other = message._connection_header["callerid"]
        if other != rospy.get_name():
            with self._lock:
                self._rival = (
                    f"{other} publishes {self._scan_out.resolved_name} too; start this node again, with laser:=true "
                    "if the robot has a laser"
                )

    def _on_range(self, message: Range, name: str) -> None:
        with self._lock:
            fresh = self._is_fresh(self._range_ages[name], message, f"range of {name}")
            self._heard[name] = message
            mount = self._mount(name, message.header.frame_id)
            range_m = math.nan
            if fresh and mount is not None and not self._trouble(time.monotonic()):
                range_m = self._mirror.closer(message.range, mount)
        self._publish(name, message, range_m, message.header.stamp)

    def _publish(self, name: str, real: Range, range_m: float, stamp: rospy.Time) -> None:
        header = Header(stamp=stamp, frame_id=real.header.frame_id)
        limits = real.field_of_view, real.min_range, real.max_range
        _send(self._ranges_out[name], Range(header, real.radiation_type, *limits, range_m))

    def _mount(self, name: str, frame: str) -> Optional[SonarMount]:
        """Position of a sonar on the robot, from tf; None if it is not known yet.  It does not move."""
        if name not in self._mounts:
            place = self._on_robot(frame)
            if place is None:
                return None
            x_m, y_m, yaw_rad = place
            own = self._model.sonars[name]
            self._mounts[name] = own._replace(x_m=x_m, y_m=y_m, yaw_deg=math.degrees(yaw_rad))
        return self._mounts[name]

    def _on_robot(self, frame: str) -> Optional[Pose]:
        if self._odometry is None:
            return None
        base = self._odometry.child_frame_id
        try:
            return transform_pose(self._buffer.lookup_transform(base, frame, rospy.Time()).transform)
        except (tf2_ros.TransformException, ValueError) as error:
            words = f"no transform from {frame or 'the frame of a range'} to {base}: {error}"
            rospy.logwarn_throttle(WARN_EVERY_S, one_line(words))
            return None

    def _virtual_scan(self) -> Optional[LaserScan]:
        """The virtual robots in the directions of the sonars; None before the first sonar is known."""
        if not self._mounts:
            return None
        assert self._odometry is not None
        first_rad, last_rad = arc_of(list(self._mounts.values()))
        rays = first_rad, RAY_RAD, 1 + int((last_rad - first_rad) / RAY_RAD)
        ranges = np.minimum(
            self._mirror.scan(ORIGIN, *rays, RANGE_M, LASER_NEAR_M), RANGE_M
        )  # +Inf may be no reading
        header = Header(0, self._odometry.header.stamp, self._odometry.child_frame_id)
        return scan_of(header, Laser(*rays, RATE_HZ, LASER_NEAR_M, RANGE_M, 0.0, 0.0), ranges)

    def _on_scan(self, message: LaserScan) -> None:
        with self._lock:
            if self._laser_mount is None:
                self._laser_mount = self._on_robot(message.header.frame_id)
            if self._laser_mount is None or self._trouble(time.monotonic()):
                return
            rays = message.angle_min, message.angle_increment, len(message.ranges)
            virtual = self._mirror.scan(self._laser_mount, *rays, message.range_max, message.range_min)
        message.ranges = np.minimum(message.ranges, virtual).tolist()
        _send(self._scan_out, message)

    def _tell(self, trouble: str, silent: List[str]) -> None:
        """Publish the status; log a change."""
        with self._lock:
            pose, margin_m = self._mirror.pose or ORIGIN, self._mirror.margin_m
            others = self._world.robots(self._name)
        if trouble:
            rospy.logwarn_throttle(WARN_EVERY_S, f"the ranges of {self._name} are invalid: {trouble}")
        elif self._said is not False:
            rospy.loginfo(f"{self._name} is in the world, with {len(others)} other robots")
        self._said = bool(trouble)
        level = DiagnosticStatus.WARN if trouble or silent else DiagnosticStatus.OK
        words = trouble or (f"no range of {', '.join(silent)}" if silent else "ok")
        x, y, yaw = f"{pose.x_m:.3f}", f"{pose.y_m:.3f}", f"{math.degrees(pose.yaw_rad):.1f}"
        names = ", ".join(mover.name for mover in others)
        values = {"x": x, "y": y, "yaw": yaw, "margin": f"{margin_m:.2f}", "others": names}
        pairs = [KeyValue(key, value) for key, value in values.items()]
        _send(self._status_out, DiagnosticStatus(level, "mirror", words, self._name, pairs))


def _run(given: Dict[str, Any]) -> None:
    with contextlib.closing(MirrorNode(given)) as mirror:
        mirror.run()


main = node("mirror_node", PARAMETERS, _run)
