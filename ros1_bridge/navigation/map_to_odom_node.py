"""ROS node `map_to_odom`: publishes map to odom on /tf, ahead of time, from the poses of a mapper on `slam_out_pose`.

hector_mapping can begin its search at the pose that odometry expects (`use_tf_pose_start_estimate`).  To do so, it
looks up map to base_link at the time of the scan.  Its own map to odom has the time of the scan before, so that each of
these lookups would fail after 0.5 s.  This node publishes the transform in its place, with times in the future.
"""

import math
import threading
import time
from typing import Any, Dict

import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped
from tf2_msgs.msg import TFMessage

from mrl_driver.geometry import ORIGIN, Pose, wrap_angle
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.plane_poses import correction, planar, transform_pose
from ros1_bridge.node.run_node import node
from ros1_bridge.node.stamp_age import StampAge
from ros1_bridge.topics.fast_publisher import direct_publisher
from ros1_bridge.topics.messages import transform_of

PERIOD_S = 0.05
SILENT_S = 2.0
"""After a pose, the next one must come within this time; otherwise nothing is published until it comes."""
JUMP_M, JUMP_RAD = 0.5, 0.5
"""A pose farther from where odometry expects the robot is refused: no motion between two scans explains it."""
TF_TIMEOUT_S = 0.2
WARN_EVERY_S = 5.0
_AHEAD = "Stamps are this far in the future; more than the time between two"
PARAMETERS = (
    Row("map_frame", str, "map", "", "Frame of the poses"),
    Row("odom_frame", str, "odom", "", "Frame of the odometry"),
    Row("base_frame", str, "base_link", "", "Frame of the robot"),
    Row("ahead", float, 0.1, "s", _AHEAD, 0.06, 1.0),
)
"""The node's private parameters."""


class MapToOdom:
    """Publishes one transform."""

    def __init__(self, given: Dict[str, Any]) -> None:
        self._map, self._odom, self._base = (given[f"{name}_frame"] for name in ("map", "odom", "base"))
        self._ahead = rospy.Duration(given["ahead"])
        self._lock = threading.Lock()  # guards the next two
        self._place, self._heard_s = ORIGIN, float("inf")
        self._age = StampAge(SILENT_S)
        self._out = direct_publisher(rospy.Publisher, "/tf", TFMessage)
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)
        rospy.Subscriber("slam_out_pose", PoseStamped, self._on_pose, queue_size=1, tcp_nodelay=True)

    def run(self) -> None:
        """Publish until the shutdown: at first that both frames agree, so that the mapper can begin."""
        while not rospy.is_shutdown():
            with self._lock:
                place, silent_s = self._place, time.monotonic() - self._heard_s
            if silent_s <= SILENT_S:
                stamp = rospy.Time.now() + self._ahead
                self._out.publish(TFMessage([transform_of(self._map, self._odom, place, stamp=stamp)]))
            else:
                rospy.logwarn_throttle(
                    WARN_EVERY_S, f"no {self._map} to {self._odom}: slam_out_pose is silent"
                )
            time.sleep(PERIOD_S)

    def _on_pose(self, message: PoseStamped) -> None:
        stamp = message.header.stamp
        try:
            trouble = self._age.trouble(stamp.to_sec(), rospy.get_time(), time.monotonic())
            if not trouble:  # tf2 ends the program at a stamp near the end of its range
                pose, odometry = planar(message.pose), self._odometry(stamp)
                place, trouble = correction(pose, odometry), self._jump(pose, odometry)
        except (ValueError, tf2_ros.TransformException) as error:
            trouble = str(error)
        if trouble:
            rospy.logwarn_throttle(WARN_EVERY_S, f"pose of the mapper not used: {trouble}")
            return
        with self._lock:
            self._place, self._heard_s = place, time.monotonic()

    def _jump(self, pose: Pose, odometry: Pose) -> str:
        """Why a pose is a jump; empty if it is none, or if the last good pose is so old that there is nothing better.

        The mapper, which begins its search where odometry expects the robot, can find the robot again meanwhile.
        """
        with self._lock:
            expected, age_s = self._place.compose(*odometry), time.monotonic() - self._heard_s
        off_m = math.hypot(pose.x_m - expected.x_m, pose.y_m - expected.y_m)
        off_rad = abs(wrap_angle(pose.yaw_rad - expected.yaw_rad))
        if not 0 <= age_s <= SILENT_S or (off_m <= JUMP_M and off_rad <= JUMP_RAD):
            return ""
        return (
            f"it is {off_m:.2f} m and {math.degrees(off_rad):.0f} deg from where odometry expects the robot, expected "
            f"at most {JUMP_M:g} m and {math.degrees(JUMP_RAD):.0f} deg; drive more slowly, or in view of more walls"
        )

    def _odometry(self, stamp: rospy.Time) -> Pose:
        found = self._buffer.lookup_transform(self._odom, self._base, stamp, rospy.Duration(TF_TIMEOUT_S))
        return transform_pose(found.transform)


main = node("map_to_odom", PARAMETERS, lambda given: MapToOdom(given).run())
