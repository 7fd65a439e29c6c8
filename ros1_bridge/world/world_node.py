"""ROS node `world_node`: publishes ground truth, laser scans and a map of the world that the emulated sonars see.

The robots are those of all `mrl-sim` processes that share a world by name.  Each robot has `base_pose_ground_truth`
and `scan` in its own namespace.  With `~only` there is one robot, without a namespace.  `true_map` is latched; it is
not called `map`, because a mapper or map_server publishes a map of that name.  Unless `~localise` is false, /tf has the
true position of each robot's odom frame in the map.
"""

import math
import time
from typing import Any, Dict, Optional, Tuple

import rospy
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from mrl_driver.geometry import ORIGIN, Pose, wrap_angle
from mrl_driver.robot import models
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.plane_poses import correction, planar, write_pose
from ros1_bridge.node.run_node import node
from ros1_bridge.topics.fast_publisher import direct_publisher
from ros1_bridge.topics.messages import transform_of
from sim_arduino.hardware.laser import URG_04LX, Laser, LaserScanner
from sim_arduino.world import grid_map, world_file
from sim_arduino.world.grid_map import GridMap
from sim_arduino.world.shared_robots import SharedRegistry

STILL_S = 1.0
"""If two poses are further apart in time than this, the speed is unknown, and zero in the message."""
PARAMETERS = (
    Row("world", str, "room", "", "Name of a world, or path of a .yaml file"),
    Row("world_name", str, "world", "", "Name under which the boards share the world"),
    Row("only", str, "", "", "Serve only this robot, without its name as namespace; empty: all robots"),
    Row("prefix", str, "", "", "Prefix of that robot's frames"),
    Row("robot", str, "traxbot", "", "Model, or path of a robot's .yaml file, that says where the laser is"),
    Row("map_frame", str, "map", "", "Frame of the map"),
    Row("resolution", float, 0.025, "m", "Side of a map cell", 0.005, 1.0),
    Row(
        "localise", bool, True, "", "Publish the true map to odom on /tf; set false if amcl or gmapping does"
    ),
)
"""The node's private parameters."""


def scan_of(header: Header, laser: Laser, ranges: Any) -> LaserScan:
    """A scan of a laser; `ranges` [m] are an array `(rays,)` as in REP-117."""
    last_rad = laser.first_rad + laser.step_rad * (len(ranges) - 1)
    angles, times = (laser.first_rad, last_rad, laser.step_rad), (0.0, 1.0 / laser.rate_hz)
    return LaserScan(header, *angles, *times, laser.near_m, laser.far_m, ranges.tolist(), [])


def truth_of(
    header: Header, base_frame: str, pose: Pose, before: Tuple[float, Pose], now_s: float
) -> Odometry:
    """The exact true pose in the frame of `header`, with the speeds since the pose `before` (its time [s], pose)."""
    message = Odometry(header=header, child_frame_id=base_frame)
    write_pose(pose, message.pose.pose)
    then_s, then = before
    dt_s = now_s - then_s
    if 0 < dt_s < STILL_S:
        twist, moved = message.twist.twist, pose.relative_to(then._replace(yaw_rad=pose.yaw_rad))
        twist.linear.x, twist.linear.y = moved.x_m / dt_s, moved.y_m / dt_s
        twist.angular.z = wrap_angle(pose.yaw_rad - then.yaw_rad) / dt_s
    return message


def new_map(frame: str, stamp: rospy.Time, grid: GridMap) -> OccupancyGrid:
    """A map as a message."""
    message = OccupancyGrid()
    message.header.frame_id, message.header.stamp = frame, stamp
    message.info.map_load_time, message.info.resolution = stamp, grid.resolution_m
    message.info.height, message.info.width = grid.cells.shape
    message.info.origin.position.x, message.info.origin.position.y = grid.origin.x_m, grid.origin.y_m
    message.info.origin.orientation.w = 1.0
    message.data = grid.cells.ravel().tolist()
    return message


class RobotTopics:
    """Topics of one robot in the world of a node."""

    def __init__(self, node: "WorldNode", name: str) -> None:
        space, prefix = ("", node.given["prefix"]) if node.given["only"] else (f"{name}/", f"{name}/")
        self._map, self._prefix, self._name = node.given["map_frame"], prefix, name
        self._measured: Optional[Pose] = None
        self._place_out = None
        if node.given["localise"]:
            self._place_out = direct_publisher(rospy.Publisher, "/tf", TFMessage)
            rospy.Subscriber(f"{space}odom", Odometry, self._on_odometry, queue_size=1, tcp_nodelay=True)
        self._scanner = LaserScanner(node.world, node.laser, sum(name.encode()))
        self._scan_out = direct_publisher(rospy.Publisher, f"{space}scan", LaserScan)
        self._truth_out = direct_publisher(rospy.Publisher, f"{space}base_pose_ground_truth", Odometry)
        self._before: Tuple[float, Pose] = (-math.inf, ORIGIN)

    def _on_odometry(self, message: Odometry) -> None:
        self._measured = planar(message.pose.pose)

    def publish(self, pose: Pose) -> None:
        """Publish the pose and a scan of this moment."""
        stamp, now_s = rospy.Time.now(), time.monotonic()
        header, base = Header(0, stamp, self._map), f"{self._prefix}base_link"
        self._truth_out.publish(truth_of(header, base, pose, self._before, now_s))
        self._before = now_s, pose
        if self._place_out is not None and self._measured is not None:
            place, odom = correction(pose, self._measured), f"{self._prefix}odom"
            self._place_out.publish(TFMessage([transform_of(self._map, odom, place, stamp=stamp)]))
        if self._scan_out.impl.has_connections():
            header, ranges = Header(0, stamp, f"{self._prefix}laser"), self._scanner.scan(pose, self._name)
            self._scan_out.publish(scan_of(header, self._scanner.laser, ranges))


class WorldNode:
    """One world and the robots in it."""

    def __init__(self, given: Dict[str, Any]) -> None:
        """Raises ConfigError if there is no such world or robot model."""
        self.given = given
        self.laser = URG_04LX._replace(mount=models.load(self.given["robot"]).laser)
        self.world = world_file.load(self.given["world"])
        self.world.registry = SharedRegistry(self.given["world_name"])
        self._robots: Dict[str, RobotTopics] = {}
        grid = grid_map.draw(self.world, self.given["resolution"])
        self._map_out = direct_publisher(rospy.Publisher, "true_map", OccupancyGrid, latch=True)
        self._map_out.publish(new_map(self.given["map_frame"], rospy.Time.now(), grid))

    def run(self) -> None:
        """Publish until the shutdown; robots may come and go meanwhile."""
        rate = rospy.Rate(URG_04LX.rate_hz, reset=True)
        while not rospy.is_shutdown():
            for mover in self.world.robots():
                if self.given["only"] in ("", mover.name):
                    if mover.name not in self._robots:
                        self._robots[mover.name] = RobotTopics(self, mover.name)
                    self._robots[mover.name].publish(mover.pose)
            rate.sleep()


main = node("world_node", PARAMETERS, lambda given: WorldNode(given).run())
