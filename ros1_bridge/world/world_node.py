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

from mrl_driver.geometry import ORIGIN, Pose, yaw_of
from mrl_driver.robot import models
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.plane_poses import correction
from ros1_bridge.node.run_node import node
from ros1_bridge.topics.fast_publisher import direct_publisher
from ros1_bridge.topics.messages import transform_of
from sim_arduino.hardware.laser import URG_04LX, LaserScanner
from sim_arduino.world import grid_map, world_file
from sim_arduino.world.shared_robots import SharedRegistry

from . import world_messages

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


class RobotTopics:
    """Topics of one robot in the world of a node."""

    def __init__(self, node: "WorldNode", name: str) -> None:
        space, prefix = ("", node.given["prefix"]) if node.given["only"] else (f"{name}/", f"{name}/")
        self._map, self._prefix, self._name = node.given["map_frame"], prefix, name
        self._odometry: Optional[Odometry] = None
        self._place_out = None
        if node.given["localise"]:
            self._place_out = direct_publisher(rospy.Publisher, "/tf", TFMessage)
            rospy.Subscriber(f"{space}odom", Odometry, self._on_odometry, queue_size=1, tcp_nodelay=True)
        self._scanner = LaserScanner(node.world, node.laser, sum(name.encode()))
        self._scan_out = direct_publisher(rospy.Publisher, f"{space}scan", LaserScan)
        self._truth_out = direct_publisher(rospy.Publisher, f"{space}base_pose_ground_truth", Odometry)
        self._before: Tuple[float, Pose] = (-math.inf, ORIGIN)

    def _on_odometry(self, message: Odometry) -> None:
        self._odometry = message

    def publish(self, pose: Pose) -> None:
        """Publish the pose and a scan of this moment."""
        stamp, now_s = rospy.Time.now(), time.monotonic()
        header, base = Header(0, stamp, self._map), f"{self._prefix}base_link"
        self._truth_out.publish(world_messages.truth_of(header, base, pose, self._before, now_s))
        self._before = now_s, pose
        odometry = self._odometry
        if self._place_out is not None and odometry is not None:
            at, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
            measured = Pose(at.x, at.y, yaw_of(turn.x, turn.y, turn.z, turn.w))
            place, odom = correction(pose, measured), f"{self._prefix}odom"
            self._place_out.publish(TFMessage([transform_of(self._map, odom, place, stamp=stamp)]))
        if self._scan_out.impl.has_connections():
            ranges, laser = self._scanner.scan(pose, without=self._name), self._scanner.laser
            header, rays = (
                Header(0, stamp, f"{self._prefix}laser"),
                (laser.first_rad, laser.step_rad, laser.rate_hz),
            )
            self._scan_out.publish(world_messages.scan_of(header, *rays, ranges, laser.near_m, laser.far_m))


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
        self._map_out.publish(world_messages.new_map(self.given["map_frame"], rospy.Time.now(), grid))

    def run(self) -> None:
        """Publish until the shutdown; robots may come and go meanwhile."""
        rate = rospy.Rate(URG_04LX.rate_hz)
        while not rospy.is_shutdown():
            for mover in self.world.robots():
                if self.given["only"] in ("", mover.name):
                    if mover.name not in self._robots:
                        self._robots[mover.name] = RobotTopics(self, mover.name)
                    self._robots[mover.name].publish(mover.pose)
            rate.sleep()


main = node("world_node", PARAMETERS, lambda given: WorldNode(given).run())
