"""ROS node `go_to_goal`: the action `move_base` (move_base_msgs/MoveBaseAction) from odometry and sonars alone.

Takes goals by the action, by `move_base_simple/goal` (rviz's 2D Nav Goal), and several in a row by `waypoints`
(nav_msgs/Path).  Goals may be in any frame that tf connects with that of `odom`.
"""

import math
import sys
import threading
from typing import Dict, List, Optional

import actionlib
import rospy
import tf2_ros
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, Twist
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback, MoveBaseGoal, MoveBaseResult
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import Range

from mrl_driver.goal_seeker import GoalSeeker, Pose, carried
from mrl_driver.robots import Limits
from mrl_driver.sonar import NAMES

RATE_HZ = 20.0
ODOM_LATE_S = 0.5
TF_TIMEOUT_S = 1.0


class GoToGoal:
    """Serves one robot."""

    def __init__(self) -> None:
        self._limits = Limits(
            float(rospy.get_param("~linear_speed", 0.25)),
            float(rospy.get_param("~angular_speed", 0.9)),
            math.inf,
            math.inf,
        )
        self._avoid = bool(rospy.get_param("~avoid", True))
        self._odometry: Optional[Odometry] = None
        self._odometry_s = -math.inf
        self._ranges: Dict[str, float] = {}
        self._cmd_vel = rospy.Publisher("cmd_vel", Twist, queue_size=1, tcp_nodelay=True)
        self._plan = rospy.Publisher("plan", Path, queue_size=1, latch=True)
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._server = actionlib.SimpleActionServer(
            "move_base", MoveBaseAction, self._execute, auto_start=False
        )
        self._client = actionlib.SimpleActionClient("move_base", MoveBaseAction)
        rospy.Subscriber("odom", Odometry, self._on_odometry, queue_size=1, tcp_nodelay=True)
        for name in NAMES:
            rospy.Subscriber(f"sonar/{name}", Range, self._on_range, callback_args=name, queue_size=1)
        rospy.Subscriber("move_base_simple/goal", PoseStamped, self._on_goal, queue_size=1)
        rospy.Subscriber("waypoints", Path, self._on_waypoints, queue_size=1)
        self._tour = 0
        self._server.start()

    def _on_odometry(self, message: Odometry) -> None:
        self._odometry, self._odometry_s = message, rospy.get_time()

    def _on_range(self, message: Range, name: str) -> None:
        self._ranges[name] = message.range

    def _on_goal(self, message: PoseStamped) -> None:
        self._tour += 1
        self._client.send_goal(MoveBaseGoal(message))

    def _on_waypoints(self, message: Path) -> None:
        self._tour += 1
        threading.Thread(target=self._visit, args=(message, self._tour), daemon=True).start()

    def _visit(self, path: Path, tour: int) -> None:
        """Each pose in turn, until one cannot be reached or other goals come."""
        for pose in path.poses:
            if tour != self._tour or rospy.is_shutdown():
                return
            pose.header.frame_id = pose.header.frame_id or path.header.frame_id
            self._client.send_goal_and_wait(MoveBaseGoal(pose))
            if self._client.get_state() != actionlib.GoalStatus.SUCCEEDED:
                rospy.logwarn("waypoints given up: one could not be reached")
                return

    def _execute(self, goal: MoveBaseGoal) -> None:
        """Called by the action server for each goal, on its own thread."""
        rate = rospy.Rate(RATE_HZ)
        target = self._in_odom(goal.target_pose)
        if target is None:
            self._server.set_aborted(
                MoveBaseResult(), "no odometry, or no transform from the goal's frame to it"
            )
            return
        seeker = GoalSeeker(target, self._limits, rospy.get_time())
        self._show(target)
        while not rospy.is_shutdown():
            if self._server.is_preempt_requested():
                if not self._server.is_new_goal_available():
                    self._cmd_vel.publish(Twist())
                self._server.set_preempted()
                return
            if not self._drive(seeker):
                break
            rate.sleep()
        self._cmd_vel.publish(Twist())
        if seeker.reached:
            self._server.set_succeeded(MoveBaseResult(), "reached")
        else:
            self._server.set_aborted(
                MoveBaseResult(), "blocked" if seeker.blocked else "odometry has stopped"
            )

    def _drive(self, seeker: GoalSeeker) -> bool:
        """One step; False at the end."""
        odometry, now_s = self._odometry, rospy.get_time()
        if odometry is None or now_s - self._odometry_s > ODOM_LATE_S:
            return False
        ranges = self._ranges if self._avoid else {}
        linear, angular = seeker.command(_planar(odometry.pose.pose), ranges, now_s)
        if seeker.reached or seeker.blocked:
            return False
        twist = Twist()
        twist.linear.x, twist.angular.z = linear, angular
        self._cmd_vel.publish(twist)
        self._server.publish_feedback(MoveBaseFeedback(PoseStamped(odometry.header, odometry.pose.pose)))
        return True

    def _in_odom(self, goal: PoseStamped) -> Optional[Pose]:
        odometry = self._odometry
        if odometry is None:
            return None
        frame, pose = odometry.header.frame_id, _planar(goal.pose)
        if goal.header.frame_id in ("", frame):
            return pose
        try:
            found = self._buffer.lookup_transform(
                frame, goal.header.frame_id, rospy.Time(), rospy.Duration(TF_TIMEOUT_S)
            ).transform
        except tf2_ros.TransformException as error:
            rospy.logwarn(f"goal refused: {error}")
            return None
        return carried(pose, (found.translation.x, found.translation.y, _yaw(found.rotation)))

    def _show(self, target: Pose) -> None:
        odometry = self._odometry
        assert odometry is not None
        end = PoseStamped(odometry.header, PoseMessage())
        end.pose.position.x, end.pose.position.y = target[0], target[1]
        end.pose.orientation.z, end.pose.orientation.w = math.sin(target[2] / 2), math.cos(target[2] / 2)
        self._plan.publish(Path(odometry.header, [PoseStamped(odometry.header, odometry.pose.pose), end]))


def _planar(pose: PoseMessage) -> Pose:
    return pose.position.x, pose.position.y, _yaw(pose.orientation)


def _yaw(rotation: object) -> float:
    x, y, z, w = (getattr(rotation, axis) for axis in "xyzw")
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def main(argv: Optional[List[str]] = None) -> int:
    """Run the node; returns the exit code."""
    rospy.init_node("go_to_goal", argv=argv or sys.argv)
    node = GoToGoal()
    rospy.spin()
    del node
    return 0
